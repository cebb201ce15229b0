"""Progress of a reach: its path in time, gating by time scaling, the hold's count and its patience."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.progress import GATE_TIME, TaskPhase
from wbmpc.planner.reach import Reach
from wbmpc.scenario import ReachTask
from wbmpc.signals import Vector

DT = 0.01
START = np.array([0.05, 0.12, 0.22])
TASK = ReachTask(
    kind="reach", hand="left", target=(0.4, 0.05, 0.3), start=0.5, arrive_by=2.5, hold=1.0, withdraw=1.5, tolerance=0.01
)


class Bench:
    """A reach whose palm is where its reference is, plus an error."""

    def __init__(self, task: ReachTask = TASK) -> None:
        self.reach, self.time, self.error = Reach(task, side=0, palm=START), 0.0, np.zeros(3)
        self.positions: list[Vector] = []
        self.velocities: list[Vector] = []

    def step(self, *, gate_open: bool = True) -> None:
        palm = self.reach.reference()[0] + self.error
        self.reach.advance(self.time, DT, gate_open=gate_open, palm=palm)
        self.time += DT
        for values, value in zip((self.positions, self.velocities), self.reach.reference(), strict=True):
            values.append(value)

    def preview(self, seconds: Vector, *, rate: float) -> Vector:
        return self.reach.preview(self.reach.progress.sigmas(self.time, seconds, rate=rate), seconds)

    def run_to(self, phase: TaskPhase, seconds: float = 12.0) -> float:
        begin = self.time
        while self.reach.progress.phase != phase:
            self.step()
            assert self.time - begin < seconds, f"stuck in {self.reach.progress.phase.name}"
        return self.time - begin


def test_a_reach_takes_its_times() -> None:
    bench = Bench()
    assert not bench.reach.progress.active
    assert bench.run_to(TaskPhase.GO) == pytest.approx(TASK.start, abs=2 * DT)
    assert bench.reach.progress.active
    assert bench.run_to(TaskPhase.HOLD) == pytest.approx(TASK.arrive_by - TASK.start, abs=3 * DT)
    assert_allclose(bench.reach.reference()[0], TASK.target, atol=1e-9)
    assert bench.run_to(TaskPhase.BACK) == pytest.approx(TASK.hold, abs=2 * DT)
    assert bench.run_to(TaskPhase.DONE) == pytest.approx(TASK.withdraw, abs=3 * DT)
    assert_allclose(bench.reach.reference()[0], START, atol=1e-9)
    assert not bench.reach.progress.active


@settings(max_examples=30)
@given(gates=st.lists(st.tuples(st.booleans(), st.integers(1, 60)), max_size=5))
def test_velocity_scales_with_the_clock(gates: list[tuple[bool, int]]) -> None:
    """However the gate opens and closes, the velocity is that of the positions, and does not jump."""
    bench = Bench()
    plan = [gate_open for gate_open, count in gates for _ in range(count)]
    while bench.reach.progress.phase in (TaskPhase.WAIT, TaskPhase.GO):
        bench.step(gate_open=plan.pop() if plan else True)
    p, v = (np.array(x[:-1]) for x in (bench.positions, bench.velocities))
    assert_allclose((p[1:] - p[:-1]) / DT, 0.5 * (v[1:] + v[:-1]), atol=0.02)
    assert np.abs(v).max() > 0.1
    assert np.abs(np.diff(v, axis=0)).max() < 6.0 * DT


def test_a_closed_gate_stops_the_reach_smoothly_and_an_open_one_resumes_it() -> None:
    bench = Bench()
    while bench.time < 1.3:
        bench.step()
    for _ in range(round(GATE_TIME / DT) + 1):
        bench.step(gate_open=False)
    stopped = bench.reach.progress.sigma
    assert bench.reach.progress.rate == 0.0
    assert 0.0 < stopped < 1.0
    for _ in range(200):
        bench.step(gate_open=False)
    assert bench.reach.progress.sigma == stopped
    assert_allclose(bench.reach.reference()[1], 0.0, atol=1e-12)
    bench.run_to(TaskPhase.HOLD)
    speeds = np.linalg.norm(np.diff(np.array(bench.velocities), axis=0), axis=1)
    assert speeds.max() < 0.02  # no jump of velocity anywhere


def test_the_way_back_is_not_gated() -> None:
    bench = Bench()
    bench.run_to(TaskPhase.BACK)
    begin = bench.time
    while bench.reach.progress.phase == TaskPhase.BACK:
        bench.step(gate_open=False)
        assert bench.time < begin + TASK.withdraw + 0.1


def test_the_hold_counts_without_a_break() -> None:
    bench = Bench()
    bench.run_to(TaskPhase.HOLD)
    for _ in range(60):
        bench.step()
    bench.error = np.array([0.02, 0.0, 0.0])
    bench.step()
    bench.error = np.zeros(3)
    assert bench.run_to(TaskPhase.BACK) == pytest.approx(TASK.hold, abs=2 * DT)  # from zero again


def test_a_hold_that_never_succeeds_ends_with_its_patience() -> None:
    bench = Bench()
    bench.error = np.array([0.0, 0.02, 0.0])
    bench.run_to(TaskPhase.HOLD)
    assert bench.run_to(TaskPhase.BACK) == pytest.approx(TASK.hold + TASK.patience, abs=2 * DT)


@pytest.mark.parametrize("at", [0.1, 0.9, 1.7])
def test_preview_is_what_comes(at: float) -> None:
    """At full pace the previewed places are those of the reference later on, the wait included."""
    bench = Bench()
    while bench.time < at:
        bench.step()
    seconds = np.array([0.1, 0.5, 1.0])
    ahead = bench.preview(seconds, rate=1.0)
    first = len(bench.positions)
    for _ in range(100):
        bench.step()
    for place, s in zip(ahead, seconds, strict=True):
        assert_allclose(bench.positions[first + round(s / DT) - 1], place, atol=5e-3)


def test_preview_at_no_pace_stays() -> None:
    bench = Bench()
    while bench.time < 1.5:
        bench.step()
    stay = bench.preview(np.array([0.1, 1.6]), rate=0.0)
    assert_allclose(stay, np.tile(bench.reach.reference()[0], (2, 1)))
    assert bench.preview(np.array([1.6]), rate=1.0)[0, 0] == pytest.approx(TASK.target[0])
