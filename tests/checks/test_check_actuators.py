"""torque_limit, speed_limit, torque_peak, solver_failures, push_recovery."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import MASS, STEP, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.actuators import SpeedLimitCheck, TorqueLimitCheck, TorquePeakCheck
from wbmpc.checks.push import PushRecoveryCheck
from wbmpc.checks.result import CheckResult
from wbmpc.checks.solvers import SolverFailuresCheck
from wbmpc.checks.stretches import stretches
from wbmpc.signals import SolveStatus


def test_torque_at_its_limit_passes_and_above_it_fails() -> None:
    run = SyntheticRun()
    run.torque[30, 1], run.torque_limit[30, 1] = -1.5, 1.5
    result = TorqueLimitCheck(settings.TorqueLimit()).evaluate(run.context(), "torque_limit")
    assert result.passed
    assert result.value == pytest.approx(1.0)
    run.torque[40, 0], run.torque_limit[40, 0] = 1.0, 0.8
    result = TorqueLimitCheck(settings.TorqueLimit()).evaluate(run.context(), "torque_limit")
    assert not result.passed
    assert result.value == pytest.approx(1.25)
    assert "hip" in result.message
    assert result.first_violation == pytest.approx(0.4)


def test_no_torque_at_the_no_load_speed_is_within_the_limit_of_zero() -> None:
    run = SyntheticRun()
    run.torque_limit[10] = 0.0
    assert TorqueLimitCheck(settings.TorqueLimit()).evaluate(run.context(), "torque_limit").value == 0.0
    run.torque[10, 0] = 0.01
    assert not TorqueLimitCheck(settings.TorqueLimit()).evaluate(run.context(), "torque_limit").passed


def test_speed_counts_joints_only_against_each_joints_own_limit() -> None:
    run = SyntheticRun()
    run.qvel[:, :6] = run.qvel[:, 8:] = 100.0  # the base and loose objects may move as they like
    run.qvel[20, 6:8] = [-4.0, 5.4]
    result = SpeedLimitCheck(settings.SpeedLimit()).evaluate(run.context(), "speed_limit")
    assert result.passed
    assert result.value == pytest.approx(0.9)
    run.qvel[70, 6] = -5.5
    result = SpeedLimitCheck(settings.SpeedLimit()).evaluate(run.context(), "speed_limit")
    assert not result.passed
    assert result.value == pytest.approx(1.1)
    assert result.first_violation == pytest.approx(0.7)


@pytest.mark.parametrize(("torque", "passed"), [(2.2, True), (2.3, False), (np.nan, False)])
def test_torque_peak_is_a_share_of_stall_torque(torque: float, passed: bool) -> None:
    run = SyntheticRun()
    run.torque[50, 1] = torque  # stall torque 2.5
    config = settings.TorquePeak(kind="torque_peak", max=0.9)
    result = TorquePeakCheck(config).evaluate(run.context(), "torque_peak")
    assert result.passed == passed
    np.testing.assert_allclose(result.value, torque / 2.5)


def failures(run: SyntheticRun) -> CheckResult:
    return SolverFailuresCheck(settings.SolverFailures(max=0.01)).evaluate(run.context(), "solver_failures")


def plans(run: SyntheticRun, count: int, *, failed: int, status: SolveStatus, stage: int) -> None:
    """`count` plans whose first two stages ran; in the last `failed` of them `stage` ended with `status`."""
    for k in range(count):
        statuses = [SolveStatus.SOLVED, SolveStatus.SOLVED, SolveStatus.NOT_RUN]
        if k >= count - failed:
            statuses[stage] = status
        run.plan(k * STEP, statuses=tuple(statuses))


def test_no_failures_pass_with_and_without_plans() -> None:
    run = SyntheticRun()
    assert failures(run).passed
    plans(run, 50, failed=0, status=SolveStatus.SOLVED, stage=0)
    assert failures(run).value == 0.0


def test_tracker_fallbacks_are_a_share_of_ticks() -> None:
    run = SyntheticRun(200)
    run.fallback[150:152] = True
    assert failures(run).passed
    run.fallback[60] = True
    result = failures(run)
    assert not result.passed
    assert result.value == pytest.approx(3 / 200)
    assert result.first_violation == pytest.approx(0.6)


@pytest.mark.parametrize("stage", [0, 1])
def test_failed_stages_are_a_share_of_the_stages_that_ran(stage: int) -> None:
    run = SyntheticRun(100)
    plans(run, 100, failed=3, status=SolveStatus.INFEASIBLE, stage=stage)
    result = failures(run)
    assert not result.passed
    assert result.value == pytest.approx(3 / 200)
    assert result.first_violation == pytest.approx(0.97)


@pytest.mark.parametrize(("status", "passed"), [(SolveStatus.INFEASIBLE, True), (SolveStatus.NUMERICAL_ERROR, False)])
def test_no_feasible_contact_is_an_answer_but_a_numerical_error_is_a_failure(status: SolveStatus, passed: bool) -> None:
    run = SyntheticRun(100)
    plans(run, 100, failed=10, status=status, stage=2)
    assert failures(run).passed == passed


def pushed(impulse: float, *, settled_after: float) -> SyntheticRun:
    """A push of `impulse` [N·s] along y from 0.5 to 0.6 s, after which the CoM moves for `settled_after` [s]."""
    run = SyntheticRun(300)
    run.external_force[50:60, 1] = impulse / 0.1
    run.com_velocity[50 : 60 + round(settled_after / STEP), 1] = 0.2
    return run


def recovery(run: SyntheticRun) -> CheckResult:
    config = settings.PushRecovery(kind="push_recovery", min_impulse=0.4, max_time=1.0)
    return PushRecoveryCheck(config).evaluate(run.context(), "push")


def test_a_push_that_is_recovered_from() -> None:
    result = recovery(pushed(0.4 * MASS, settled_after=0.7))
    assert result.passed
    assert result.value == pytest.approx(0.7)


def test_a_slow_recovery_and_none_at_all() -> None:
    assert recovery(pushed(0.4 * MASS, settled_after=1.2)).value == pytest.approx(1.2)
    assert not recovery(pushed(0.4 * MASS, settled_after=1.2)).passed
    result = recovery(pushed(0.4 * MASS, settled_after=2.4))  # still moving at the end
    assert not result.passed
    assert np.isinf(result.value)


def test_a_push_that_is_too_weak_or_absent_proves_nothing() -> None:
    weak = recovery(pushed(0.39 * MASS, settled_after=0.1))
    assert not weak.passed
    assert "0.390" in weak.message
    assert "no push" in recovery(SyntheticRun()).message


def test_every_push_counts_until_the_next_one() -> None:
    run = pushed(0.5 * MASS, settled_after=0.2)
    run.external_force[200:210, 0] = 0.5 * MASS / 0.1
    run.com_velocity[200:280, 0] = 0.2
    result = recovery(run)
    assert result.value == pytest.approx(0.7)
    assert "2.090" in result.message
    assert "recovered in 0.20, 0.70 s" in result.message
    run.com[210:, 0] += 0.1  # a step away from where it was pushed
    assert recovery(run) == result


@given(st.lists(st.booleans(), max_size=40))
def test_stretches_cover_exactly_the_true_entries(active: list[bool]) -> None:
    found = stretches(np.array(active, dtype=bool))
    rebuilt = np.zeros(len(active), dtype=bool)
    for start, stop in found:
        assert start < stop
        rebuilt[start:stop] = True
    assert rebuilt.tolist() == active
    assert all(a[1] < b[0] for a, b in itertools.pairwise(found))  # separated by a false entry


def test_one_weak_push_among_strong_ones_proves_nothing() -> None:
    run = pushed(0.5 * MASS, settled_after=0.2)
    run.external_force[200:210, 0] = 0.3 * MASS / 0.1
    assert not recovery(run).passed
