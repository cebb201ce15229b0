"""The command line: exit codes, the files of a run, one-line messages. Runs are faked but for two short real ones."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import wbmpc.session
from wbmpc.checks.result import CheckResult
from wbmpc.cli import app
from wbmpc.commands.exits import ExitCode, guarded
from wbmpc.commands.one_run import dump_last_states
from wbmpc.counterfactuals import objection
from wbmpc.errors import WbmpcError
from wbmpc.scenario import Counterfactual
from wbmpc.timing import LoopTiming
from wbmpc.verdict import Verdict

STAND = Path(__file__).parents[1] / "scenarios" / "stand.yaml"
SCENARIO = """
name: {name}
duration: 2.0
tasks: [{{kind: stand}}]
checks: [{{kind: upright_at_end}}, {{kind: torque_peak, max: 0.9}}]
counterfactuals:
  weak: {{set: {{plant.mass_scale: 2.0}}, expect: fail, failing: [torque_peak]}}
  same: {{set: {{seed: 5}}, expect: pass}}
"""
KEYS = [
    "scenario",
    "seed",
    "passed",
    "checks",
    "triage",
    "golden",
    "metrics",
    "solver",
    "timing",
    "versions",
    "state_sha256",
]
KEPT_UP: dict[str, float] = {
    "real_time_factor": 1.5,
    "planner_rate": 98.5,
    "plans": 200,
    "late_plans": 10,
    "skipped_plans": 7,
    "plan_ready_p50": 0.006,
    "plan_ready_p99": 0.012,
    "plan_ready_max": 0.015,
    "missed_deadlines": 3,
    "ticks": 2000,
    "drift": 0.004,
}
CHECK_KEYS = ["name", "passed", "value", "threshold", "unit", "message", "first_violation"]


def check(name: str, passed: bool = True, value: float = 0.5) -> CheckResult:
    return CheckResult(name, passed, value, 1.0, "m", "so far", None if passed else 0.25)


def verdict(name: str, checks: list[CheckResult], seed: int = 0) -> Verdict:
    return Verdict(
        scenario=name,
        seed=seed,
        checks=checks,
        metrics={"com_height_min": 0.2, "first_hand_contact": float("nan"), "simulated_time": 2.0},
        solver={"tracker": {"solves": 10, "failures": 0, "p50": 1e-4, "p99": 2e-4, "max": 3e-4}},
        timing=LoopTiming(expected_ticks=1).summary() | KEPT_UP,
        state_sha256="ab" * 32,
    )


def recorder_of(last: float) -> Any:
    """What a run of 300 ticks recorded, as far as the command reads it; `last` is the last velocity."""
    columns = {name: np.zeros((300, 2)) for name in ("time", "qpos", "qvel", "torque")}
    columns["qvel"][-1, 1] = last
    return SimpleNamespace(**columns, column=columns.__getitem__)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Replaces the run: everything passes, but torque_peak fails at twice the mass. Collects the scenarios it ran."""
    ran: list[Any] = []

    def run_scenario(
        scenario: Any, *, name: str, recording: Path | None, realtime: bool, on_progress: Any, viewer: str | None
    ) -> Any:
        ran.append(SimpleNamespace(scenario=scenario, name=name, recording=recording, realtime=realtime))
        if on_progress is not None:
            on_progress(scenario.duration)
        weak = scenario.plant.mass_scale == 2.0
        checks = [check("upright_at_end"), check("torque_peak", passed=not weak, value=2.0 if weak else 0.5)]
        return SimpleNamespace(verdict=verdict(name, checks, scenario.seed), recorder=recorder_of(1.0), wall_time=0.1)

    monkeypatch.setattr(wbmpc.session, "run_scenario", run_scenario)
    return ran


@pytest.fixture
def call(tmp_path: Path) -> Callable[..., Result]:
    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    return write(tmp_path, "calm")


def write(folder: Path, name: str) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(SCENARIO.format(name=name), encoding="utf-8")
    return path


def test_a_passing_run_exits_0_and_leaves_its_verdict(
    call: Any, fake: list[Any], scenario: Path, tmp_path: Path
) -> None:
    result = call("run", scenario, "--out", tmp_path / "out", "--seed", 3)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS calm"
    document = json.loads((tmp_path / "out" / "calm.json").read_text())
    assert list(document) == KEYS
    assert all(list(row) == CHECK_KEYS for row in document["checks"])
    assert (document["passed"], document["seed"], document["state_sha256"]) == (True, 3, "ab" * 32)
    assert document["metrics"]["first_hand_contact"] is None  # JSON has no nan
    assert document["timing"]["real_time_factor"] == 1.5
    assert document["timing"]["tick_late_max"] is None
    assert document["versions"]["mujoco"] != "absent"


def test_a_failing_check_exits_1_with_value_and_threshold(
    call: Any, fake: list[Any], scenario: Path, tmp_path: Path
) -> None:
    result = call("run", scenario, "--out", tmp_path, "--set", "plant.mass_scale=2.0")
    assert result.exit_code == 1
    assert result.output.splitlines()[-1] == "FAIL calm: torque_peak 2 m against 1 m"
    assert "first at t = 0.250 s" in result.output
    assert json.loads((tmp_path / "calm.json").read_text())["passed"] is False


def test_options_reach_the_run(call: Any, fake: list[Any], scenario: Path, tmp_path: Path) -> None:
    call("run", scenario, "--out", tmp_path, "--no-record", "--realtime", "--set", "duration=1.75")
    call("run", scenario, "--out", tmp_path)
    assert [run.recording for run in fake] == [None, tmp_path / "calm.rrd"]
    assert [run.realtime for run in fake] == [True, False]
    assert [run.scenario.duration for run in fake] == [1.75, 2.0]


def test_a_real_time_run_says_how_it_kept_up(call: Any, fake: list[Any], scenario: Path, tmp_path: Path) -> None:
    result = call("run", scenario, "--out", tmp_path, "--realtime")
    (line,) = (line for line in result.output.splitlines() if "plans/s" in line)
    plans, ticks = line.split("; ")
    assert plans == "calm: 98.5 plans/s, 5.0 % late, 7 skipped, ready after [ms] p50 6, p99 12, max 15"
    assert ticks == "3 of 2000 ticks missed, drift 0.004 s"
    assert "plans/s" not in call("run", scenario, "--out", tmp_path).output


def test_counterfactuals_pass_when_they_end_as_declared(
    call: Any, fake: list[Any], scenario: Path, tmp_path: Path
) -> None:
    result = call("run", scenario, "--out", tmp_path, "--counterfactuals", "--jobs", 1)
    assert result.exit_code == 0, result.output
    assert [run.name for run in fake] == ["calm", "calm.weak", "calm.same"]
    assert [line for line in result.output.splitlines() if line.startswith("runs: ")] == [
        "runs: 1/3 PASS calm",
        "runs: 2/3 PASS calm.weak: fails torque_peak, as declared",
        "runs: 3/3 PASS calm.same: passes, as declared",
    ]
    rows = [" ".join(line.split()) for line in result.output.splitlines()]
    assert any(row.endswith("failing checks simulated [s] wall [s]") for row in rows)
    assert "calm pass PASS upright_at_end 0.5 m, torque_peak 0.5 m 2.0 0.1" in rows
    assert "weak fail: torque_peak PASS fails torque_peak 2 m 2.0 0.1" in rows
    assert rows[-1] == "PASS: all 3 runs ended as declared"
    assert json.loads((tmp_path / "calm.weak.json").read_text())["passed"] is False
    suites = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert [suite.get("name") for suite in suites] == ["calm", "calm.weak", "calm.same"]
    assert [suite.get("failures") for suite in suites] == ["0", "0", "0"]
    assert [case.get("name") for case in suites[0]] == ["upright_at_end", "torque_peak"]


def test_a_counterfactual_that_ends_otherwise_fails(call: Any, fake: list[Any], scenario: Path, tmp_path: Path) -> None:
    text = scenario.read_text().replace("plant.mass_scale: 2.0", "seed: 7")
    scenario.write_text(text)
    result = call("run", scenario, "--out", tmp_path, "--counterfactuals", "--jobs", 1)
    assert result.exit_code == 1
    lines = result.output.splitlines()
    assert lines[-1] == "FAIL calm.weak: expected to fail, but passed"
    table = [line.split() for line in lines if len(set(line.split()) & {"PASS", "FAIL"}) == 1 and " 2.0 " in line]
    assert [("FAIL" in row, row[0]) for row in table] == [(False, "calm"), (False, "same"), (True, "calm")]
    failure = ElementTree.parse(tmp_path / "junit.xml").getroot().find("testsuite[@name='calm.weak']/testcase/failure")
    assert failure is not None
    assert "expected to fail" in str(failure.get("message"))


@pytest.mark.parametrize(
    ("expect", "failing", "passed", "objects"),
    [
        ("pass", (), True, None),
        ("pass", (), False, "expected to pass, but failed b"),
        ("fail", (), False, None),
        ("fail", (), True, "expected to fail, but passed"),
        ("fail", ("b",), False, None),
        ("fail", ("a", "b"), False, "expected to fail a, but failed only b"),
        ("fail", ("c",), False, "expected to fail c, but there is no such check: a, b"),
    ],
)
def test_outcomes_of_counterfactuals(expect: Any, failing: tuple[str, ...], passed: bool, objects: str | None) -> None:
    declared = Counterfactual(set={"seed": 1}, expect=expect, failing=failing)
    assert objection(declared, verdict("x", [check("a"), check("b", passed)])) == objects


def test_no_checks_are_no_pass() -> None:
    assert not verdict("x", []).passed


def one_line(result: Result) -> str:
    lines = result.output.strip().splitlines()
    assert len(lines) == 1, result.output
    assert "Traceback" not in result.output
    return lines[0]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "duration"), "--set duration: expected KEY=VALUE"),
        (("--set", "durations=1"), "--set durations: unknown key"),
        (("--set", "tasks.7.kind=stand"), "--set tasks.7.kind: '7' is not an index"),
        (("--set", "duration=-1"), "--set duration: "),
        (("--set", "duration=.nan"), "--set duration: "),
        (("--set", "duration=[1"), "--set duration: not valid YAML"),
        (("--out", "/dev/null/folder"), "--out /dev/null/folder: "),
        (("--realtime", "--jobs", "2"), "--jobs 2: real-time runs share no cores"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    call: Any, fake: list[Any], scenario: Path, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    result = call("run", scenario, "--out", tmp_path, *words)
    assert result.exit_code == 2
    assert one_line(result).startswith(message)
    assert not fake


def test_a_bad_second_scenario_is_found_before_the_first_one_runs(
    call: Any, fake: list[Any], scenario: Path, tmp_path: Path
) -> None:
    result = call("run", scenario, tmp_path / "absent.yaml", "--out", tmp_path)
    assert result.exit_code == 2
    assert "absent.yaml: no such file" in one_line(result)
    result = call("run", scenario, scenario, "--out", tmp_path)
    assert result.exit_code == 2
    assert "two scenarios are named 'calm'" in one_line(result)
    assert not fake


def test_an_internal_error_is_one_line_and_a_traceback_file_and_the_others_still_run(
    call: Any, fake: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = wbmpc.session.run_scenario

    def breaks(scenario: Any, **options: Any) -> Any:
        if scenario.name == "broken":
            raise IndexError("off by one\nsecond line")
        return good(scenario, **options)

    monkeypatch.setattr(wbmpc.session, "run_scenario", breaks)
    (tmp_path / "broken.json").write_text("of an earlier run")
    words = ("run", write(tmp_path, "broken"), write(tmp_path, "calm"), "--out", tmp_path, "--jobs", 1)
    result = call(*words)
    assert result.exit_code == 3
    assert result.output.splitlines()[-1].startswith(
        "FAIL broken: internal error: IndexError: off by one (traceback in"
    )
    assert "Traceback" not in result.output
    assert "Traceback" in (tmp_path / "broken.traceback.txt").read_text()
    assert not (tmp_path / "broken.json").exists()
    assert "PASS calm" in result.output
    suites = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert [suite.get("failures") for suite in suites] == ["1", "0"]
    assert "Traceback" in call(*words, "--debug").output


def test_the_last_states_are_kept_only_when_they_are_not_finite(tmp_path: Path) -> None:
    path = tmp_path / "run.last_states.npz"
    dump_last_states(recorder_of(np.inf), path)
    with np.load(path) as kept:
        assert kept["qvel"].shape == (200, 2)
        assert np.isinf(kept["qvel"][-1, 1])
    dump_last_states(recorder_of(1.0), path)
    assert not path.exists()


def raising(error: BaseException) -> Callable[[], ExitCode]:
    def work() -> ExitCode:
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "code"),
    [(WbmpcError("bad"), 2), (KeyboardInterrupt(), 130), (ZeroDivisionError("oops"), 3)],
)
def test_every_exception_has_its_exit_code(error: BaseException, code: int, tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "traceback.txt"
    assert guarded(raising(error), traceback_path=path, debug=False) == code
    assert path.exists() == (code == 3)


def test_validate_reads_all_files_and_shows_the_offending_line(call: Any, scenario: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text(scenario.read_text().replace("duration:", "durations:"))
    result = call("validate", bad, scenario)
    assert result.exit_code == 2
    assert f"{bad}:3:1: durations: unknown key, did you mean 'duration'?" in result.output
    assert "\ndurations: 2.0\n^" in result.output
    assert f"{scenario}: valid" in result.output
    assert call("validate", scenario).exit_code == 0


def test_schema_is_json_and_knows_the_checks(call: Any) -> None:
    result = call("schema")
    assert result.exit_code == 0
    assert {"properties", "$defs"} <= set(json.loads(result.output))
    assert "push_recovery" in result.output


def test_usage_errors_exit_2(call: Any, scenario: Path) -> None:
    for words in ((), ("frobnicate",), ("run",), ("run", scenario, "--seed", "-1"), ("sweep", scenario)):
        result = call(*words)
        assert result.exit_code == 2, words
        assert "Usage" in result.output


def test_versions_come_quickly() -> None:
    """Neither the simulator nor the solvers are imported for `--version`."""
    program = (
        "import sys; from wbmpc.cli import app; app(['--version'], standalone_mode=False);"
        "print({'mujoco', 'pinocchio', 'rerun', 'daqp', 'numpy'} & set(sys.modules) or 'light')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "mujoco " in done.stdout
    assert "light" in done.stdout


def test_a_real_run_and_its_hash(call: Any, tmp_path: Path) -> None:
    """Recorded, unrecorded and repeated runs have the same states; with sensor noise another seed has others."""

    short = ("--set", "duration=0.6", "--set", "planner.horizon_steps=5")

    def run(*words: object) -> str:
        result = call("run", STAND, "--out", tmp_path, *short, *words)
        assert result.exit_code == 0, result.output
        return str(json.loads((tmp_path / "stand.json").read_text())["state_sha256"])

    recorded = run()
    assert (tmp_path / "stand.rrd").stat().st_size > 0
    assert run("--no-record") == recorded
    noisy = run("--no-record", "--set", "sensors.noise_scale=1.0")
    assert noisy != recorded
    assert run("--no-record", "--set", "sensors.noise_scale=1.0") == noisy
    assert run("--no-record", "--set", "sensors.noise_scale=1.0", "--seed", 1) != noisy
