"""A lean: the CoM's way, where it begins and ends, and what the hands have to say about it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.lean import Lean
from wbmpc.planner.progress import TaskPhase
from wbmpc.scenario import LeanTask

DT = 0.01
HOME = np.array([0.01, -0.02])
TASK = LeanTask(kind="lean", target=(0.12, 0.01), start=0.5, arrive_by=2.0, hold=0.6, patience=1.0, withdraw=1.0)


def life(*, error: float = 0.0, closed: tuple[float, float] = (0.0, 0.0)) -> dict[TaskPhase, float]:
    """When each phase begins [s], for a CoM that follows its way but for `error` [m] and a gate closed for a time."""
    lean, begun = Lean(TASK), {TaskPhase.WAIT: 0.0}
    for k in range(1200):
        time = k * DT
        way = lean.preview(np.array([lean.progress.sigma]), home=HOME)[0]
        com = np.array([way[0], way[1] + error, 0.25])
        lean.advance(time, DT, gate_open=not closed[0] <= time < closed[1], com=com)
        begun.setdefault(lean.progress.phase, time)
    return begun


def test_a_lean_goes_holds_and_comes_back() -> None:
    begun = life()
    assert begun[TaskPhase.GO] == pytest.approx(0.5, abs=2 * DT)
    assert begun[TaskPhase.HOLD] == pytest.approx(2.0, abs=3 * DT)
    assert begun[TaskPhase.BACK] == pytest.approx(2.6, abs=4 * DT)
    assert begun[TaskPhase.DONE] == pytest.approx(3.6, abs=5 * DT)


def test_a_com_outside_the_tolerance_does_not_count_as_held() -> None:
    begun = life(error=1.1 * TASK.tolerance)
    assert begun[TaskPhase.BACK] - begun[TaskPhase.HOLD] == pytest.approx(TASK.hold + TASK.patience, abs=2 * DT)
    begun = life(error=0.9 * TASK.tolerance)
    assert begun[TaskPhase.BACK] - begun[TaskPhase.HOLD] == pytest.approx(TASK.hold, abs=2 * DT)


def test_a_closed_gate_delays_the_lean() -> None:
    assert life(closed=(1.0, 2.5))[TaskPhase.HOLD] == pytest.approx(2.0 + 1.5, abs=0.05)


@settings(max_examples=30, deadline=None)
@given(x=st.floats(-0.1, 0.1), y=st.floats(-0.1, 0.1))
def test_the_way_is_straight_and_begins_and_ends_at_rest(x: float, y: float) -> None:
    home, sigmas = np.array([x, y]), np.linspace(0.0, 1.0, 1001)
    way = Lean(TASK).preview(sigmas, home=home)
    assert_allclose(way[[0, -1]], [home, TASK.target], atol=1e-12)
    along = TASK.target - home
    assert_allclose(np.cross(np.append(along, 0.0), np.column_stack([way - home, sigmas * 0.0]))[:, 2], 0.0, atol=1e-12)
    speed = np.linalg.norm(np.diff(way, axis=0), axis=1) * 1000.0
    assert max(speed[0], speed[-1]) < 1e-3
    assert speed.max() == pytest.approx(1.875 * np.linalg.norm(along), rel=1e-3)  # of minimum-jerk motion
