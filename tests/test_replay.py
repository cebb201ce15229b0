"""`wbmpc replay`: recorded runs made again, bit for bit, and what cannot be."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
import small_run
from test_rerun_sink import open_sink
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.provenance import document_of, scenario_of
from wbmpc.replay import open_run
from wbmpc.replay import replay as run_again
from wbmpc.rerun_sink import RerunSink
from wbmpc.scenario import Scenario, load_scenario
from wbmpc.session import run_scenario
from wbmpc.timing import Schedule

ROOT = Path(__file__).parents[1]
PUSHES = [
    {"kind": "impulse", "body": "torso", "time": 0.05, "duration": 0.05, "impulse": [0.3, 0.0, 0.0]},
    {"kind": "impulse", "body": "torso", "time": 0.15, "duration": 0.05, "impulse": [0.0, 0.2, 0.0]},
]


def pushed(duration: float = 0.5) -> Scenario:
    """A short `stand` with pushes and sensor noise."""
    changes = {
        "duration": duration,
        "planner.horizon_steps": 2,
        "sensors.noise_scale": 1.0,
        "disturbances": PUSHES,
        "checks": [{"kind": "torque_peak", "max": 1.0}],
    }
    return load_scenario(ROOT / "scenarios" / "stand.yaml", changes, seed=7)


@pytest.fixture(scope="module")
def threaded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The recording of a threaded run, and the hash in its verdict; a copy of the file as a kill would leave it."""
    path = tmp_path_factory.mktemp("threaded") / "pushed.rrd"
    result = run_scenario(
        pushed(),
        name="pushed",
        recording=path,
        realtime=True,
        on_progress=lambda time: shutil.copy(path, path.with_name("killed.rrd")),
    )
    return path, result.verdict.state_sha256


@pytest.fixture
def call() -> Callable[..., Any]:
    return lambda *words: CliRunner().invoke(app, ["replay", *(str(word) for word in words)])


def test_a_threaded_run_repeats_in_lockstep(call: Any, threaded: tuple[Path, str]) -> None:
    path, sha = threaded
    result = call(path)
    assert result.exit_code == 0, result.output
    recorded, replayed, verdict = result.stdout.splitlines()
    assert recorded.split()[:2] == ["recorded", sha]
    assert "threaded, 500 ticks" in recorded
    assert replayed.split() == ["replayed", sha]
    assert verdict == "same"


@pytest.mark.parametrize("later", [1, 4])
def test_another_latency_of_one_plan_makes_another_motion(threaded: tuple[Path, str], later: int) -> None:
    recorded = open_run(threaded[0])
    effects = dict(recorded.run.schedule.effects)
    # A plan that was in effect for a while; whatever the machine's speed, there is one.
    used = sorted(effects.items(), key=lambda pair: pair[1])
    snapshot, effect = next(a for a, b in pairwise(used[2:]) if b[1] > a[1] + later)
    changed = replace(recorded.run, schedule=Schedule(effects | {snapshot: effect + later}, 500))
    again = run_again(replace(recorded, run=changed))
    assert again.state_sha256 != threaded[1]
    assert again.first_difference == effect + 1  # the torques of one tick move the state of the next


def test_the_command_says_where_a_run_parts(
    call: Any, threaded: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def shortened(path: Path, *, robot: Path | None) -> Any:
        recorded = open_run(path, robot=robot)
        return replace(recorded, run=replace(recorded.run, schedule=Schedule({}, 500)), same_source=False)

    monkeypatch.setattr("wbmpc.commands.replay.open_run", shortened)
    result = call(threaded[0])
    assert result.exit_code == 1
    assert "differs at tick " in result.stdout.splitlines()[-1]
    assert "source" in result.stdout.splitlines()[-1]


def test_a_threaded_run_that_was_killed_has_nothing_to_replay(call: Any, threaded: tuple[Path, str]) -> None:
    result = call(threaded[0].with_name("killed.rrd"))
    assert result.exit_code == 2
    assert "no tick is in it" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_lockstep_run_that_was_killed_is_replayed_as_far_as_it_was_written(
    call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wbmpc.loop.FLUSH_TICKS", 100)
    monkeypatch.setitem(RerunSink.__init__.__kwdefaults__, "block", 0.1)
    path, killed = tmp_path / "whole.rrd", tmp_path / "killed.rrd"

    def copy(time: float) -> None:
        if time == pytest.approx(0.2):
            shutil.copy(path, killed)

    sha = run_scenario(pushed(0.26), name="whole", recording=path, on_progress=copy).verdict.state_sha256
    whole, part = call(path), call(killed)
    assert whole.exit_code == 0, whole.output
    assert f"replayed  {sha}" in whole.stdout
    assert part.exit_code == 0, part.output
    assert "lockstep, 200 ticks, 19 plans" in part.stdout
    assert part.stdout.splitlines()[-1] == "same"
    assert "ends at 0.2 of 0.26 s" in part.stderr


def test_the_run_may_end_before_the_recording(threaded: tuple[Path, str]) -> None:
    recorded = open_run(threaded[0])
    run = replace(recorded.run, schedule=replace(recorded.run.schedule, ticks=50))
    assert run_again(replace(recorded, run=run)).first_difference == 50


def of_another_program(path: Path) -> None:
    recording = rr.RecordingStream("another")
    recording.save(path)
    recording.log("/text", rr.TextDocument("hello"))
    recording.flush()
    recording.disconnect()


def without_a_schedule(path: Path) -> None:
    recorder = small_run.new_recorder()
    with open_sink(path, recorder):
        small_run.append_ticks(recorder, 20)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "no such recording"),
        (lambda path: path.write_text("not rerun's"), "not a readable recording"),
        (of_another_program, "not a recording of wbmpc"),
        (without_a_schedule, "holds no schedule of plans"),
    ],
)
def test_what_cannot_be_replayed_is_one_line(
    call: Any, tmp_path: Path, make: Callable[[Path], Any], message: str
) -> None:
    make(tmp_path / "bad.rrd")
    result = call(tmp_path / "bad.rrd")
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_other_versions_are_refused_by_name(
    call: Any, threaded: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from wbmpc.versions import versions

    monkeypatch.setattr("wbmpc.provenance.versions", lambda: versions() | {"mujoco": "9.9", "rerun-sdk": "9.9"})
    result = call(threaded[0])
    assert result.exit_code == 2
    assert "(here 9.9)" in result.stderr
    assert "rerun" not in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_robot_file_may_move_but_not_change(tmp_path: Path) -> None:
    """A robot given by its path, relative to the scenario: found again from anywhere, or by --robot."""
    mjcf = (ROOT / "models" / "surena_mini.xml").read_text(encoding="utf-8")
    (tmp_path / "mine.xml").write_text(mjcf, encoding="utf-8")
    text = (ROOT / "scenarios" / "stand.yaml").read_text(encoding="utf-8")
    path = tmp_path / "stand.yaml"
    path.write_text(text.replace("robot: surena_mini", "robot: mine.xml"), encoding="utf-8")
    scenario = load_scenario(path)
    document = document_of(scenario, "mine", realtime=False)
    found = scenario_of(document)
    assert found.robot == str(tmp_path / "mine.xml")
    same = {"robot": "mine.xml", "counterfactuals": {}, "sweep": None}
    assert found.to_document() | same == scenario.to_document() | same
    moved = (tmp_path / "mine.xml").rename(tmp_path / "moved.xml")
    with pytest.raises(Exception, match="--robot"):
        scenario_of(document)
    assert scenario_of(document, robot=moved).robot == str(moved)
    moved.write_text(mjcf + "<!-- heavier -->", encoding="utf-8")
    with pytest.raises(Exception, match="not the one of the run"):
        scenario_of(document, robot=moved)


def test_a_document_of_another_format_is_refused(threaded: tuple[Path, str]) -> None:
    document = dict(open_run(threaded[0]).run.document)
    with pytest.raises(Exception, match="format 2"):
        scenario_of(document | {"format": 2})
    with pytest.raises(Exception, match=r"not valid: duration"):
        scenario_of(document | {"scenario": {**document["scenario"], "duration": -1.0}})
