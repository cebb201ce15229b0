"""momentum_balance against motions whose forces follow from elementary mechanics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from synthetic import FLOOR, LEFT_FOOT, LEFT_PALM, MASS, STEP, TABLE, TORSO, WEIGHT, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.momentum import MomentumBalanceCheck
from wbmpc.checks.result import CheckResult


def balance(run: SyntheticRun) -> CheckResult:
    return MomentumBalanceCheck(settings.MomentumBalance(window=0.05)).evaluate(run.context(), "momentum_balance")


def test_standing_and_free_fall_balance() -> None:
    assert balance(SyntheticRun()).value == pytest.approx(0.0, abs=1e-12)
    fall = SyntheticRun()
    fall.contacts = [[] for _ in range(fall.ticks)]
    fall.com_velocity[:, 2] = -9.81 * fall.time
    assert balance(fall).value == pytest.approx(0.0, abs=1e-12)


@hypothesis_settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_forces_balance_with_the_velocities_that_they_make(seed: int) -> None:
    rng = np.random.default_rng(seed)
    run = SyntheticRun(40)
    hand, push = rng.normal(0.0, 20.0, (2, run.ticks, 3))
    for tick in range(run.ticks):
        run.touch([tick], TABLE, LEFT_PALM, hand[tick])
        run.touch([tick], LEFT_FOOT, TORSO, rng.normal(0.0, 50.0, 3))  # inside the robot: no net force
        run.touch([tick], FLOOR, TABLE, rng.normal(0.0, 50.0, 3))  # not on the robot
    run.external_force = push
    acceleration = (hand + push) / MASS  # the feet carry the weight
    run.com_velocity[1:] = np.cumsum(acceleration[:-1] * STEP, axis=0)
    assert balance(run).value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("share", "passed"), [(0.019, True), (0.021, False)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_hidden_support_shows_as_its_share_of_the_weight(axis: int, share: float, passed: bool) -> None:
    run = SyntheticRun()
    hidden = np.zeros(3)
    hidden[axis] = share * WEIGHT
    run.com_velocity[50:] = hidden / MASS * STEP * np.arange(50)[:, None]  # acts from tick 50 on
    result = balance(run)
    assert result.passed == passed
    assert result.value == pytest.approx(share)
    if not passed:
        assert result.first_violation == pytest.approx(0.5)


def test_a_robot_that_hovers_without_contacts_is_found_out() -> None:
    run = SyntheticRun()
    run.contacts = [[] for _ in range(run.ticks)]
    assert balance(run).value == pytest.approx(1.0)


def test_nan_and_too_short_runs_fail() -> None:
    run = SyntheticRun()
    run.com_velocity[30, 0] = np.nan
    assert not balance(run).passed
    assert not balance(SyntheticRun(5)).passed
