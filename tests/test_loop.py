"""The lockstep loop: bits, rates, the delay of plans, and the end of a run that went wrong."""

from __future__ import annotations

import gc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_run import ROBOT, finished, new_session, short, stand

from wbmpc.errors import ScenarioError
from wbmpc.initial import initial_posture
from wbmpc.loop import Session
from wbmpc.planner.planner import Planner
from wbmpc.scenario import build_world, robot_path
from wbmpc.session import run_scenario
from wbmpc.signals import RobotState

NOISY = {"duration": 0.25, "sensors__noise_scale": 1.0}


def sha(**changes: Any) -> str:
    return finished(stand(**changes))[1].state_sha256


def test_same_seed_gives_the_same_bits_and_another_seed_others() -> None:
    first = sha(**NOISY, seed=3)
    assert sha(**NOISY, seed=4) != first
    finished(short("squat", duration=0.1))  # what ran before in this process leaves no trace
    assert sha(**NOISY, seed=3) == first


def test_seed_drives_the_noise_and_nothing_else() -> None:
    assert sha(duration=0.1, seed=3) == sha(duration=0.1, seed=4)


def test_recording_changes_nothing(tmp_path: Path) -> None:
    scenario = stand(**NOISY)
    unrecorded = run_scenario(scenario, name="unrecorded").verdict
    recorded = run_scenario(scenario, name="recorded", recording=tmp_path / "run.rrd").verdict
    assert (tmp_path / "run.rrd").stat().st_size > 0
    assert recorded.state_sha256 == unrecorded.state_sha256


class StampingPlanner(Planner):
    """Writes the time of a plan's snapshot where the tracker carries it along unused: a stance foot's yaw."""

    def solve(self, state: RobotState) -> Any:
        return replace(super().solve(state), foot_yaw=np.full(2, state.time))


@pytest.mark.parametrize(
    ("planner_rate", "delay"), [(100, 0.01), (100, 0.0), (125, 0.003), (40, 0.025), (200, 0.017), (1000, 0.002)]
)
def test_a_plan_takes_effect_after_its_delay_and_not_before(
    monkeypatch: pytest.MonkeyPatch, planner_rate: int, delay: float
) -> None:
    monkeypatch.setattr("wbmpc.loop.Planner", StampingPlanner)
    timing, recorder = finished(stand(duration=0.06, loop__planner_rate=planner_rate, loop__planner_delay=delay))
    for tick, used in enumerate(recorder.setpoint_foot_yaw[:, 0]):
        # in whole milliseconds: the newest snapshot that is at least `delay` old; the first plan is there at once
        snapshots = range(0, tick + 1, 1000 // planner_rate)
        ready = [s for s in snapshots if s + round(1000 * delay) <= tick]
        assert used == pytest.approx(1e-3 * max(ready, default=0), abs=1e-9), tick
    assert recorder.ticks == 60
    assert len(recorder.plans) == 1 + 59 * planner_rate // 1000
    np.testing.assert_allclose(timing.plan_latency, np.full(len(recorder.plans) - 1, delay), atol=1e-12)
    assert timing.missed_deadlines == timing.late_plans == 0


def test_other_physics_rates_work() -> None:
    timing, recorder = finished(stand(duration=0.2, loop__physics_rate=500, loop__planner_rate=50, recording__rate=50))
    assert recorder.ticks == 100
    np.testing.assert_allclose(np.diff(recorder.time), 0.002, atol=1e-12)
    assert timing.simulated_time == pytest.approx(0.2)
    assert recorder.torso_up.min() > 0.999


def break_at(monkeypatch: pytest.MonkeyPatch, tick: int, velocity: float) -> None:
    """Give one joint this velocity [rad/s] in the plant at one tick."""
    tick_once, count = Session.tick, 0

    def broken(session: Session, plan: Any) -> bool:
        nonlocal count
        if count == tick:
            session.plant.data.qvel[8] = velocity
        count += 1
        return tick_once(session, plan)

    monkeypatch.setattr(Session, "tick", broken)


@pytest.mark.parametrize("velocity", [np.nan, np.inf, 1e11])
def test_a_state_that_is_not_finite_ends_the_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, velocity: float
) -> None:
    """1e11 is finite, but MuJoCo resets the robot to its initial posture for it: that must not pass for standing."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warning to a file in the working directory
    break_at(monkeypatch, 30, velocity)
    with np.errstate(all="ignore"):
        _, recorder = finished(stand(duration=0.1))
    assert recorder.ticks == 31
    assert "not finite" in recorder.events[-1].text


def test_a_torque_that_is_not_finite_ends_the_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = stand(duration=0.1)
    session, recorder = new_session(scenario)
    solve = session.tracker.solve

    def broken(state: RobotState, setpoint: Any) -> Any:
        command = solve(state, setpoint)
        return replace(command, torque=command.torque * np.nan) if recorder.ticks == 5 else command

    monkeypatch.setattr(session.tracker, "solve", broken)
    assert [session.tick(None) for _ in range(6)] == [True] * 5 + [False]


def test_sink_and_progress_follow_the_run() -> None:
    flushed: list[float] = []
    progress: list[float] = []

    class Sink:
        def flush(self, now: float) -> None:
            flushed.append(now)

    finished(stand(duration=1.1), sink=Sink(), on_progress=progress.append)
    assert flushed == progress == pytest.approx([0.5, 1.0])


def test_a_run_ends_when_it_is_told_to_and_says_why() -> None:
    answers = iter([None, "seen enough"])
    timing, recorder = finished(stand(duration=1.6), ended=lambda: next(answers))
    assert recorder.ticks == 1000
    assert timing.simulated_time == pytest.approx(1.0)
    assert recorder.events[-1].text == "seen enough, run ended"


def test_a_fallen_robot_ends_its_run() -> None:
    """Pushed over, the robot falls within a second; without the early end the run would last twenty."""
    push = [{"kind": "impulse", "body": "torso", "time": 0.1, "duration": 0.1, "impulse": [4.0, 0.0, 0.0]}]
    scenario = stand(duration=20.0, disturbances=push, planner__horizon_steps=5)
    result = run_scenario(scenario, name="pushed")
    assert {"no_fall", "completed"} <= set(result.verdict.failing)
    fall = next(check.first_violation for check in result.verdict.checks if check.name == "no_fall")
    assert fall is not None
    assert fall + 1.0 <= result.recorder.time[-1] + 1.5e-3 <= fall + 2.0


@pytest.mark.parametrize("enabled", [True, False])
def test_the_garbage_collector_is_as_it_was(enabled: bool) -> None:
    """Off in the loop, and back to its state even when the loop breaks."""
    seen: list[bool] = []

    def broken() -> str:
        seen.append(gc.isenabled())
        raise ZeroDivisionError

    (gc.enable if enabled else gc.disable)()
    try:
        with pytest.raises(ZeroDivisionError):
            finished(stand(duration=0.6), ended=broken)
        assert (seen, gc.isenabled()) == ([False], enabled)
    finally:
        gc.enable()


def test_a_tick_leaves_no_garbage() -> None:
    """What makes it safe to run without the collector: memory is bounded by what is recorded."""
    finished(stand(duration=0.1))  # what is made once
    gc.collect()
    session, _ = new_session(stand(duration=1.0))
    gc.collect()
    gc.disable()
    try:
        for _ in range(300):
            session.tick(lambda state: session.mailbox.post(session.planner.solve(state), available_at=state.time))
        assert gc.collect() < 30  # fewer than one object in ten ticks
    finally:
        gc.enable()


def test_initial_posture_has_its_joints_and_its_soles_on_the_floor() -> None:
    scenario = stand(initial__joints={"left_knee": 0.9, "right_knee": 0.9})
    model = build_world(scenario, robot_path(scenario))
    qpos = initial_posture(scenario, ROBOT, model)
    home = model.key("home").qpos
    changed = {ROBOT.joint_names[j] for j in np.flatnonzero(qpos[7:] != home[7:])}
    assert changed <= {"left_knee", "right_knee"}
    assert qpos[7 + ROBOT.joint_index("left_knee")] == 0.9
    session, _ = new_session(scenario)
    assert session.plant.data.site("left_sole").xpos[2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("world", "message"),
    [
        (
            {"staircase": {"position": [0, 0], "steps": 2, "rise": 0.03, "depth": 0.2, "landing": 0.3, "width": 0.5}},
            r"the robot starts inside 'tread_0': its (left|right)_foot is \d+ mm deep in it",
        ),
        (
            {"objects": {"wall": {"kind": "box", "size": [0.1, 1.0, 1.0], "position": [0.0, 0.0]}}},
            r"the robot starts inside 'wall': its \w+ is \d+ mm deep in it",
        ),
    ],
)
def test_a_robot_that_starts_inside_of_something_is_refused(world: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as raised:
        new_session(stand(world=world))
    assert raised.value.exit_code == 2
    assert "\n" not in str(raised.value)
