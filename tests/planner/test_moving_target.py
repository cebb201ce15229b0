"""A reach whose target is moved in the middle: smooth references, and all phases of the task."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from robots import surena
from test_reach import DT, TASK, Bench

from wbmpc.planner.moving_target import FREQUENCY, LEAD, MovingTarget
from wbmpc.planner.progress import TaskPhase
from wbmpc.planner.tasks import Tasks
from wbmpc.signals import TargetMove, Vector

ELSEWHERE = np.array([0.38, 0.15, 0.27])
place = st.lists(st.floats(-0.4, 0.4), min_size=3, max_size=3).map(np.array)


@given(place, place, st.integers(1, 40))
def test_it_follows_its_equation_and_its_preview(start: Vector, goal: Vector, steps: int) -> None:
    """Against a fine integration of x'' = ω² (lead) - 2 ω x' with the lead cut at LEAD, piece by piece."""
    target = MovingTarget(start)
    target.goal = goal
    x, v = start.copy(), np.zeros(3)
    for _ in range(steps):
        if not target.moving:
            break
        ahead = target.preview(np.array([DT]))[0]
        way = goal - x
        fixed = x + way * min(1.0, LEAD / max(np.linalg.norm(way), 1e-12))
        for _ in range(200):  # the lead's end stays for one step, as it does between two plans
            a = FREQUENCY**2 * (fixed - x) - 2 * FREQUENCY * v
            x, v = x + DT / 200 * v + 0.5 * (DT / 200) ** 2 * a, v + DT / 200 * a
        target.advance(DT)
        assert_allclose(target.position, ahead if target.moving else goal, atol=1e-12)
        assert_allclose(target.position, x, atol=2e-5)
        assert np.linalg.norm(target.velocity) <= LEAD * FREQUENCY / 2 + 1e-9
        x, v = target.position.copy(), target.velocity.copy()


def test_it_arrives_and_is_still() -> None:
    target = MovingTarget(np.zeros(3))
    target.goal = ELSEWHERE
    steps = 0
    while target.moving:
        target.advance(DT)
        steps += 1
    assert 0.4 / 0.15 < steps * DT < 6.0
    assert target.position is target.goal
    assert not target.velocity.any()


def smooth(bench: Bench, *, acceleration: float) -> None:
    """Velocities and accelerations are the derivatives of the positions, and none of them jumps."""
    positions, velocities = np.array(bench.positions), np.array(bench.velocities)
    assert_allclose((positions[2:] - positions[:-2]) / (2 * DT), velocities[1:-1], atol=1e-2)
    assert np.abs(np.diff(velocities, axis=0)).max() < acceleration * DT


@pytest.mark.parametrize("phase", [TaskPhase.WAIT, TaskPhase.GO, TaskPhase.HOLD, TaskPhase.BACK, TaskPhase.DONE])
def test_a_target_moved_in_any_phase_is_reached_and_held(phase: TaskPhase) -> None:
    bench = Bench()
    bench.run_to(phase)
    for _ in range(20):
        bench.step()
    bench.reach.move(ELSEWHERE, palm=bench.reach.reference()[0])
    begin = bench.time
    bench.run_to(TaskPhase.HOLD)
    bench.run_to(TaskPhase.BACK)
    assert_allclose(bench.reach.target, ELSEWHERE, atol=1e-3)
    met = np.linalg.norm(np.array(bench.positions) - ELSEWHERE, axis=1) < TASK.tolerance
    assert met.sum() * DT > TASK.hold - 0.1  # held there, not at the first place
    assert bench.time - begin > TASK.hold
    bench.run_to(TaskPhase.DONE)
    smooth(bench, acceleration=6.0)


def test_the_hold_begins_anew() -> None:
    still, moved = Bench(), Bench()
    for bench in (still, moved):
        bench.run_to(TaskPhase.HOLD)
        for _ in range(80):
            bench.step()
    moved.reach.move(np.array(TASK.target), palm=np.array(TASK.target))
    assert moved.run_to(TaskPhase.BACK) - still.run_to(TaskPhase.BACK) == pytest.approx(0.8, abs=2 * DT)


def test_a_closed_gate_holds_the_target_back() -> None:
    bench = Bench()
    bench.run_to(TaskPhase.HOLD)
    for _ in range(60):
        bench.step(gate_open=False)
    before = bench.reach.reference()[0]
    bench.reach.move(ELSEWHERE, palm=before)
    for _ in range(20):
        bench.step(gate_open=False)
    assert_array_equal(bench.reach.reference()[0], before)


def test_the_preview_is_what_comes() -> None:
    bench = Bench()
    bench.run_to(TaskPhase.HOLD)
    bench.reach.move(ELSEWHERE, palm=bench.reach.reference()[0])
    bench.step()
    start, near = bench.time, np.array([0.05, 0.1])
    ahead = bench.preview(near, rate=1.0)  # a goal far ahead leads by LEAD and goes on: the preview falls behind slowly
    for time, expected in zip(near, ahead, strict=True):
        while bench.time < start + time - 1e-9:
            bench.step()
        assert_allclose(bench.reach.reference()[0], expected, atol=2e-3)
    assert np.linalg.norm(ahead[1] - np.array(TASK.target)) > 4e-3  # it has gone somewhere


def test_an_order_is_carried_out_with_the_next_plan() -> None:
    events: list[str] = []
    tasks = Tasks(surena(), (TASK,), (), palms=np.zeros((2, 3)), heading=0.0)
    tasks.order(TargetMove(0, ELSEWHERE))
    three = np.zeros((2, 3))
    tasks.advance(0.0, DT, gate_open=True, palms=three, palm_forces=three, homes=three, com=three[0], events=events)
    assert_array_equal(tasks.reaches[0].target, ELSEWHERE)
    assert events == ["reach left: target moved to (0.380, 0.150, 0.270) m"]
