"""The CoM state between two plans: against the same in plain numpy, and what a broken measurement does to it."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.com_state import ALARM_TIME, PUSH_SHARE, PUSH_TIME, VELOCITY_SHARE, ComState
from wbmpc.planner.settings import PlannerSettings
from wbmpc.signals import GRAVITY

PERIOD, HEIGHT = 0.01, 0.3  # [s], [m]
SETTINGS = PlannerSettings()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.001, 0.01, 0.1]))
def test_the_planned_state_is_drawn_to_the_measured_one(seed: int, size: float) -> None:
    """Errors of `size` [m], [m/s]: below the knee, in it and far beyond."""
    rng = np.random.default_rng(seed)
    state = ComState(SETTINGS, com=np.zeros(3), period=PERIOD)
    velocity, push, alarm = np.zeros(2), np.zeros(2), 0.0
    for _ in range(5):
        planned, com, speed = rng.normal(scale=size, size=(3, 3)), *rng.normal(scale=size, size=(2, 3))
        before, wanted = velocity, planned.copy()
        velocity = before + VELOCITY_SHARE * (speed[:2] - before)
        push = push + PUSH_SHARE * ((velocity - before) / PERIOD - planned[:2, 2] - push)
        error, rate_error = com[:2] - planned[:2, 0], velocity - planned[:2, 1]
        capture_error = np.linalg.norm(error + rate_error / np.sqrt(GRAVITY / HEIGHT))
        now = np.clip(capture_error / SETTINGS.feedback_knee - 1.0, 0.0, 1.0)
        share = SETTINGS.feedback + now * (SETTINGS.feedback_large - SETTINGS.feedback)
        wanted[:2, 0] += share * error
        wanted[:2, 1] += share * rate_error
        alarm = max(now, alarm - PERIOD / ALARM_TIME)
        state.filter(speed)
        state.update(planned, measured=com, height=HEIGHT)
        assert_allclose(state.value, wanted, atol=1e-12)
        assert_allclose(state.alarm, alarm, atol=1e-12)
        wanted[:2, 1] += alarm * PUSH_TIME * push
        assert_allclose(state.anticipated, wanted, atol=1e-12)


def test_a_broken_measurement_changes_nothing() -> None:
    state = ComState(SETTINGS, com=np.zeros(3), period=PERIOD)
    state.update(np.zeros((3, 3)), measured=np.array([0.05, 0.0, 0.0]), height=HEIGHT)
    alarm = state.alarm
    assert alarm > 0.0
    planned = np.arange(9.0).reshape(3, 3)
    state.filter(np.array([0.1, np.nan, 0.0]))
    state.update(planned.copy(), measured=np.array([0.0, np.inf, 0.0]), height=HEIGHT)
    assert_allclose(state.value, planned)
    assert state.alarm == alarm
    state.filter(np.zeros(3))
    state.update(np.zeros((3, 3)), measured=np.zeros(3), height=HEIGHT)
    assert_allclose(state.value, np.zeros((3, 3)))  # nothing of it is left in the filter
