"""`pytest --wbmpc`: what is collected, what runs, what a failure says, with pytest-xdist and --junitxml."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import wbmpc.session
from wbmpc.checks.result import CheckResult
from wbmpc.commands.pytest_scenarios import looks_like_scenario
from wbmpc.timing import LoopTiming
from wbmpc.verdict import Verdict

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[1]
PLUGIN = ("-p", "pytest_wbmpc", "--wbmpc")  # by name, since an environment may have been made before the entry point
SCENARIO = """\
# a comment before the keys
name: {name}
duration: 0.6
planner: {{horizon_steps: 5}}
tasks: [{{kind: stand}}]
checks:
  - {{kind: torque_peak, max: {peak}}}
  - {{kind: upright_at_end, duration: 0.1}}
counterfactuals:
  heavy: {{set: {{plant.mass_scale: 2.0}}, expect: pass}}
  weak:
    set: {{seed: 7}}
    expect: fail
    failing: [torque_peak]
    checks: [{{kind: contact_patches, max_count: 0}}]
"""


def write(pytester: pytest.Pytester, name: str, *, peak: float = 0.9, file: str = "") -> Path:
    path = pytester.path / (file or f"{name}.yaml")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SCENARIO.format(name=name, peak=peak), encoding="utf-8")
    return path


@pytest.fixture(autouse=True)
def no_ci(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY", "GITHUB_WORKSPACE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def faked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Runs without a simulation: the peak torque is 0.5, twice that with seed 7. Collects the names that ran."""
    ran: list[str] = []

    def run_scenario(scenario: Any, *, name: str, recording: Path | None, **_: Any) -> Any:
        ran.append(name)
        if scenario.duration == 5.0:
            raise IndexError("off by one")
        if recording is not None:
            recording.write_text("a recording")
        value, threshold = (1.0 if scenario.seed == 7 else 0.5), scenario.checks[0].max
        checks = [
            CheckResult("no_fall", True, 1.0, 0.3, "1", "up", None),
            CheckResult("torque_peak", value <= threshold, value, threshold, "1", "at left_knee", 0.25),
        ]
        timing = LoopTiming(expected_ticks=1).summary() | {"real_time_factor": 1.5}
        metrics = {"simulated_time": 0.6, "first_hand_contact": float("nan")}
        verdict = Verdict(name, scenario.seed, checks, metrics, {}, timing, "ab" * 32)
        columns = {column: np.zeros((3, 2)) for column in ("time", "qpos", "qvel", "torque")}
        recorder = SimpleNamespace(**columns, column=columns.__getitem__)
        return SimpleNamespace(verdict=verdict, recorder=recorder, wall_time=0.1)

    monkeypatch.setattr(wbmpc.session, "run_scenario", run_scenario)
    return ran


def output(result: pytest.RunResult) -> str:
    return result.stdout.str()


def test_a_run_and_its_counterfactuals_are_tests(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "calm", peak=0.9)
    result = pytester.runpytest_inprocess(*PLUGIN, "-v", "--wbmpc-out", "results")
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(["*calm.yaml::calm PASSED*", "*calm.yaml::heavy PASSED*", "*calm.yaml::weak PASSED*"])
    assert faked == ["calm", "calm.heavy", "calm.weak"]
    written = {path.name for path in (pytester.path / "results").iterdir()}
    assert {f"{name}.{suffix}" for name in faked for suffix in ("json", "rrd")} == written


def test_nothing_happens_without_the_option(pytester: pytest.Pytester) -> None:
    """Not even an import: any project in the same environment loads the plugin."""
    write(pytester, "calm")
    pytester.makepyfile(
        """
        import sys
        def test_light():
            heavy = {"wbmpc", "numpy", "pydantic", "rich", "mujoco"} & set(sys.modules)
            assert not heavy, heavy
        """
    )
    result = pytester.runpytest_subprocess("-p", "pytest_wbmpc", "-p", "no:hypothesispytest")
    result.assert_outcomes(passed=1)


def test_selection_by_marker_keyword_and_node_id(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "calm")
    collect = (*PLUGIN, "--collect-only", "-q", "--strict-markers")
    for words, names in (
        (("-m", "counterfactual"), {"heavy", "weak"}),
        (("-m", "scenario"), {"calm"}),
        (("-k", "stand and not weak"), {"calm", "heavy"}),  # the kind of its task
        (("-k", "surena_mini"), {"calm", "heavy", "weak"}),
        (("calm.yaml::heavy",), {"heavy"}),
    ):
        found = output(pytester.runpytest_inprocess(*collect, *words))
        assert {line.split("::")[1] for line in found.splitlines() if "::" in line} == names, words
    assert not faked
    assert not (pytester.path / "out").exists()


def test_a_failure_shows_its_checks_and_the_command(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "hard", peak=0.4)
    result = pytester.runpytest_inprocess(*PLUGIN, "--wbmpc-set", "plant.friction=0.7")
    result.assert_outcomes(passed=1, failed=2)
    text = output(result)
    assert "FAIL hard: torque_peak 0.5 against 0.4" in text
    (row,) = [line for line in text.splitlines() if "FAIL" in line and "at left_knee" in line and "0.5" in line][:1]
    assert row.split()[:4] == ["torque_peak", "0.5", "0.4", "1"]
    assert "(first at t = 0.250 s)" in row
    assert "no_fall " not in text  # a check that passed
    assert f"recording: {Path('out', 'hard.rrd')}" in text
    assert "reproduce: wbmpc run hard.yaml --set plant.friction=0.7\n" in text
    assert "reproduce: wbmpc run hard.yaml --set plant.friction=0.7 --set plant.mass_scale=2.0\n" in text
    assert "Traceback" not in text


def test_a_counterfactual_that_does_not_fail_fails(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "soft", peak=1.0)
    result = pytester.runpytest_inprocess(*PLUGIN, "-k", "weak")
    result.assert_outcomes(failed=1, deselected=2)
    text = output(result)
    assert "FAIL soft.weak: expected to fail, but passed" in text
    # Its additional checks are part of the run.
    assert "--set seed=7 --set 'checks=[" in text
    assert '{"kind": "contact_patches", "max_count": 0}' in text


def test_the_command_makes_the_same_run(pytester: pytest.Pytester, faked: list[str]) -> None:
    from wbmpc.commands.run import RunOptions, jobs_of
    from wbmpc.scenario import load_scenario, parse_overrides

    path = write(pytester, "calm")
    options = RunOptions(Path("out"), {"plant.friction": 0.7}, 3, False, False, True, None, False)
    for job in jobs_of(path, options):
        words = shlex.split(job.command)
        assert words[:5] == ["wbmpc", "run", str(path), "--seed", "3"]
        again = load_scenario(path, parse_overrides(words[6::2]), 3 if job.variant != "weak" else None)
        assert again.model_dump(exclude={"counterfactuals", "sweep"}) == job.scenario.model_dump(
            exclude={"counterfactuals", "sweep"}
        ), job.name


def test_a_broken_file_is_one_line_with_its_place(pytester: pytest.Pytester, faked: list[str]) -> None:
    path = write(pytester, "calm")
    path.write_text(path.read_text().replace("duration: 0.6", "durations: 0.6"))
    write(pytester, "good")
    result = pytester.runpytest_inprocess(*PLUGIN, "--continue-on-collection-errors")
    result.assert_outcomes(passed=3, errors=1)
    result.stdout.fnmatch_lines(["calm.yaml:3:1: durations: unknown key, did you mean 'duration'?"])
    assert "Traceback" not in output(result)
    path.write_text("tasks: [\nchecks: {\n")
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.stdout.fnmatch_lines(["calm.yaml:3:1: not valid YAML: *"])


def test_other_yaml_files_are_left_alone_unless_named(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "calm")
    (pytester.path / "compose.yaml").write_text("services: {}\ntasks: []\n")
    (pytester.path / "empty.yml").write_text("")
    (pytester.path / "binary.yaml").write_bytes(b"\xff\xfe\0")
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=3)
    result = pytester.runpytest_inprocess(*PLUGIN, "compose.yaml")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["compose.yaml:1:1: services: unknown key*"])


def test_every_shipped_scenario_looks_like_one_and_no_workflow_does() -> None:
    shipped = list((ROOT / "scenarios").glob("*.yaml"))
    assert shipped
    assert all(looks_like_scenario(path) for path in shipped)


@pytest.mark.parametrize(
    ("option", "message"),
    [("duration", "--wbmpc-set duration: expected KEY=VALUE"), ("a=[", "--wbmpc-set a: not valid YAML")],
)
def test_a_bad_option_is_a_usage_error(pytester: pytest.Pytester, option: str, message: str) -> None:
    result = pytester.runpytest_inprocess(*PLUGIN, "--wbmpc-set", option)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert message in result.stderr.str()


def test_an_override_that_a_scenario_lacks_and_a_folder_that_cannot_be(
    pytester: pytest.Pytester, faked: list[str]
) -> None:
    write(pytester, "calm")
    result = pytester.runpytest_inprocess(*PLUGIN, "--wbmpc-set", "patches.table.on=x")
    result.assert_outcomes(errors=1)
    assert "--set patches.table.on: unknown key 'table' in patches" in output(result)
    result = pytester.runpytest_inprocess(*PLUGIN, "--wbmpc-out", "/dev/null/out", "-k", "heavy")
    result.assert_outcomes(errors=1, deselected=2)
    assert "--out /dev/null/out: " in output(result)


def test_two_files_of_one_name_are_refused(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "calm", file="a/one.yaml")
    write(pytester, "calm", file="b/two.yaml")
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["b/two.yaml: a/one.yaml is named 'calm', too: *"])


def test_an_internal_error_is_a_failure_without_a_traceback(pytester: pytest.Pytester, faked: list[str]) -> None:
    write(pytester, "calm")
    result = pytester.runpytest_inprocess(*PLUGIN, "--wbmpc-set", "duration=5", "-k", "heavy")
    result.assert_outcomes(failed=1, deselected=2)
    assert "FAIL calm.heavy: internal error: IndexError: off by one (traceback in" in output(result)
    assert "Traceback" not in output(result)


def test_warnings_of_a_project_do_not_change_a_run(
    pytester: pytest.Pytester, faked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    good = wbmpc.session.run_scenario

    def warns(*arguments: Any, **options: Any) -> Any:
        import warnings

        warnings.warn("divided by zero", RuntimeWarning, stacklevel=1)
        return good(*arguments, **options)

    monkeypatch.setattr(wbmpc.session, "run_scenario", warns)
    write(pytester, "calm")
    result = pytester.runpytest_inprocess(*PLUGIN, "-W", "error", "-k", "heavy")
    result.assert_outcomes(passed=1, deselected=2, warnings=1)


def test_real_runs_with_xdist_junit_and_ci(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two workers; metrics in junit.xml; annotations and summary once, from the process that hears of all."""
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_WORKSPACE", str(pytester.path.parent))
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(pytester.path / "summary.md"))
    write(pytester, "hard", peak=0.001)
    broken = write(pytester, "broken")
    broken.write_text(broken.read_text().replace("kind: stand", "kind: stnd"))
    words = ("-n", "2", "--junitxml", "junit.xml", "--continue-on-collection-errors", "-k", "hard and not weak")
    result = pytester.runpytest_subprocess(*PLUGIN, *words)
    result.assert_outcomes(failed=2, errors=1)
    text = output(result)
    folder = pytester.path.name
    annotations = [line for line in text.splitlines() if line.startswith("::error ")]
    assert [line.split(",title")[0] for line in annotations] == [
        f"::error file={folder}/broken.yaml,line=5,col=16",
        f"::error file={folder}/hard.yaml,line=7,col=5",  # the check
        f"::error file={folder}/hard.yaml,line=10,col=41",  # what the counterfactual is expected to do
    ]
    summary = (pytester.path / "summary.md").read_text(encoding="utf-8")
    assert re.findall("^### .*", summary, re.MULTILINE) == ["### wbmpc: 0 of 2 runs ended as declared"]
    cases = {case.get("name"): case for case in ElementTree.parse(pytester.path / "junit.xml").iter("testcase")}
    properties = {item.get("name"): item.get("value") for item in cases["hard"].iter("property")}
    verdict = json.loads((pytester.path / "out" / "hard.json").read_text())
    assert properties["state_sha256"] == verdict["state_sha256"]
    assert float(properties["metrics.com_height_min"]) == verdict["metrics"]["com_height_min"]
    assert Path(properties["recording"]).name == "hard.rrd"
    assert "reproduce: wbmpc run hard.yaml" in (cases["hard"].find("failure").text or "")


def test_the_entry_point_is_declared_and_the_wheel_has_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (module,) = project["project"]["entry-points"]["pytest11"].values()
    assert hasattr(importlib.import_module(module), "pytest_addoption")
    assert f"{module}.py" in project["tool"]["hatch"]["build"]["targets"]["wheel"]["only-include"]


def test_the_repositorys_own_configuration_goes_with_it() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *PLUGIN, "--collect-only", "scenarios"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "scenarios/reach.yaml::no_contact_stage" in done.stdout
