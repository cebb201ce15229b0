"""`wbmpc branch`: the same state up to a tick, then two futures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_run import ROBOT, new_session
from test_replay import pushed
from typer.testing import CliRunner

from wbmpc.branch import branch
from wbmpc.cli import app
from wbmpc.explain.changes import OF_A_RUN, change_of
from wbmpc.explain.past import open_past
from wbmpc.rerun_sink.reading import Recording
from wbmpc.scenario import build_world, robot_path, vary
from wbmpc.session import run_scenario
from wbmpc.tracker.tracker import Tracker

AT, TICK = 0.3, 300


@pytest.fixture(scope="module", params=["lockstep", "threaded"])
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("branched") / f"{request.param}.rrd"
    run_scenario(pushed(), name=request.param, recording=target, realtime=request.param == "threaded")
    return target


@pytest.fixture
def call() -> Callable[..., Any]:
    return lambda *words: CliRunner().invoke(app, ["branch", *(str(word) for word in words)])


def both(path: Path, recording: Path | None = None, **overrides: Any) -> Any:
    past = open_past(path)
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    return branch(past, change_of(past.run.scenario, changes, allowed=OF_A_RUN), at=AT, recording=recording)


def test_without_a_change_nothing_ever_diverges(path: Path) -> None:
    futures = both(path)
    assert futures.unlike_recording is None
    assert futures.partings == []
    assert futures.original.verdict.state_sha256 == futures.changed.verdict.state_sha256


@pytest.mark.parametrize(
    ("changes", "first"),
    [
        ({"world__floor__friction": 0.05}, {"ZMP of the feet", "sole wrenches, sensed", "true velocity"}),
        ({"plant__mass_scale": 1.2}, {"ZMP of the feet", "true velocity", "CoM", "true posture"}),
        ({"sensors__noise_scale": 2.0}, {"estimated posture"}),
        ({"tracker__com_weight": 300.0}, {"commanded torques"}),
        ({"planner__whole_body__jerk_cost": 1e-2}, {"plan"}),
    ],
)
def test_a_change_shows_after_its_tick_and_first_where_it_acts(
    path: Path, changes: dict[str, Any], first: set[str]
) -> None:
    futures = both(path, **changes)
    assert futures.unlike_recording is None
    before = slice(0, TICK)
    for column in ("qpos", "qvel", "state_q", "command_torque"):
        one, other = (run.recorder.column(column) for run in (futures.original, futures.changed))
        np.testing.assert_array_equal(one[before], other[before])
    parting = futures.partings[0]
    assert parting.signal in first
    assert TICK <= parting.tick <= TICK + 20
    assert min(p.tick for p in futures.partings) == parting.tick


def test_a_push_that_is_added(path: Path) -> None:
    push = {"kind": "impulse", "body": "torso", "time": 0.35, "duration": 0.02, "impulse": [0.0, 0.1, 0.0]}
    futures = both(path, disturbances=[push])
    assert futures.partings[0].signal == "disturbance"
    assert futures.partings[0].time == pytest.approx(0.35)
    assert futures.partings[0].component == "y"


def test_a_later_effect_of_plans(path: Path) -> None:
    futures = both(path, loop__planner_delay=0.02)
    assert futures.unlike_recording is None
    assert futures.partings[0].tick > TICK
    effects = zip(futures.changed.recorder.timing.snapshots, futures.changed.recorder.timing.effects, strict=True)
    assert {effect - snapshot for snapshot, effect in effects if snapshot >= TICK} == {20}


@pytest.mark.parametrize("assembly", ["fused", "plain"])
def test_a_tracker_goes_on_where_another_has_stopped(assembly: str) -> None:
    session, recorder = new_session(pushed(0.2))
    settings = session.scenario.tracker.model_copy(update={"assembly": assembly})
    for _ in range(150):
        session.tick(None)
    session.tracker._assembly.memory[0][2] = 1e-3  # [m s] a height that was missed for long
    going_on, new = (Tracker(ROBOT, settings, step=session.step) for _ in range(2))
    going_on.continue_from(session.tracker)
    state = session.estimator.update(session.plant.measure())
    setpoint = session.mailbox.latest(state.time).sample(state.time)
    expected, torque, from_rest = (t.solve(state, setpoint).torque for t in (session.tracker, going_on, new))
    np.testing.assert_allclose(torque, expected, atol=1e-5)  # its solver starts cold
    assert np.abs(from_rest - expected).max() > 1e-4  # its integral is empty
    assert recorder.ticks == 150


def test_a_changed_plant_is_the_plant_of_the_changed_scenario() -> None:
    scenario = pushed()
    changed = vary(scenario, {"plant.mass_scale": 1.1, "world.floor.friction": 0.6, "sensors.noise_scale": 2.0})
    one, other = (new_session(s)[0].plant for s in (scenario, changed))
    model = build_world(changed, robot_path(changed))
    one.change(model, sensors=changed.sensors, disturbances=changed.disturbances)
    arrays = [name for name in dir(model) if isinstance(getattr(model, name), np.ndarray)]
    assert "geom_friction" in arrays
    for name in arrays:
        np.testing.assert_array_equal(getattr(one.model, name), getattr(model, name), err_msg=name)
    torque = np.linspace(-0.5, 0.5, ROBOT.nj)
    for plant in (one, other):
        for _ in range(3):
            plant.step(torque)
    np.testing.assert_allclose(one.data.qvel, other.data.qvel, rtol=1e-6, atol=1e-9)


def test_both_futures_are_in_the_recording(call: Any, path: Path, tmp_path: Path) -> None:
    result = call(path, "--at", AT, "--set", "world.floor.friction=0.05", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert "recorded ticks the same to the bit; branched at tick 300" in result.stdout
    assert "what diverged first, with world.floor.friction: 0.8 -> 0.05" in result.stdout
    name = path.stem
    recording, original = Recording(tmp_path / f"{name}.branch.rrd"), Recording(path)
    for entity in ("/state/qpos", "/com/x", "/planner/progress"):
        times, mine = recording.column(entity, "scalars")
        np.testing.assert_array_equal(mine, original.column(entity, "scalars")[1])
        beside, _ = recording.column(f"/branch{entity}", "scalars")
        np.testing.assert_array_equal(beside, times[times >= AT - 1e-9])  # before that they are one
    position = [np.array(recording.column(f"{at}/state/qpos", "scalars")[1]) for at in ("", "/branch")]
    apart = np.abs(position[0][-len(position[1]) :] - position[1]).max(axis=1)
    assert apart[0] == 0.0
    assert apart[-1] > 0.0
    assert recording.static("/branch/com/x", "names") == ["CoM measured, branch", "CoM planned, branch"]
    document = json.loads((tmp_path / f"{name}.branch.json").read_text(encoding="utf-8"))
    assert document["tick"] == TICK
    assert document["partings"][0]["tick"] >= TICK
    again = CliRunner().invoke(app, ["replay", str(tmp_path / f"{name}.branch.rrd")])
    assert again.stdout.splitlines()[-1] == "same"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "0.5"], "outside the recording"),
        (["--at", "-1"], "outside the recording, which goes from 0 to 0.499 s"),
        (["--at", "0.3", "--set", "tasks.0.kind=stand"], "in the middle of a run"),
        (["--at", "0.3", "--set", "forbid=table"], "the scenario has none"),
        (["--at", "0.3", "--set", "world.objects.table.friction=0.1"], "table"),
    ],
)
def test_what_cannot_branch_is_one_line(call: Any, path: Path, tmp_path: Path, words: list[str], message: str) -> None:
    result = call(path, "--out", tmp_path, *words)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("*.json"))
