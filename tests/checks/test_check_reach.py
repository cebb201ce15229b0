"""reach, com_beyond_toes, brace_force, and the geometry below them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import LEFT_FOOT, LEFT_PALM, RIGHT_FOOT, RIGHT_PALM, TABLE, TARGET, WALL, WEIGHT, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.balance import ComBeyondToesCheck
from wbmpc.checks.hand_forces import BraceForceCheck
from wbmpc.checks.hold import best_hold
from wbmpc.checks.reach import ReachCheck
from wbmpc.checks.result import CheckResult
from wbmpc.checks.support import distance_outside
from wbmpc.signals import ContactPhase

HOLD = slice(100, 151)  # 0.5 s: 51 ticks


def held_run(error: float = 0.008) -> SyntheticRun:
    """The left palm at `error` [m] from the target during HOLD, farther before and after; the right one never near."""
    run = SyntheticRun(300)
    run.palm_position[:, 0] = TARGET + np.array([0.0, 0.05, 0.0])
    run.palm_position[HOLD, 0] = TARGET + np.array([0.0, 0.0, error])
    return run


def reach(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.Reach(kind="reach", **{"max": 0.01, "hold": 0.5, **values})  # type: ignore[arg-type]
    return ReachCheck(config).evaluate(run.context(), "reach")


def test_reach_value_is_the_largest_error_of_the_best_hold() -> None:
    run = held_run()
    run.palm_position[120, 0] = TARGET + np.array([0.009, 0.0, 0.0])
    result = reach(run)
    assert result.passed
    assert result.value == pytest.approx(0.009)
    assert "left hand" in result.message
    assert "t = 1.00 s" in result.message


def test_either_hand_may_reach_but_they_may_not_take_turns() -> None:
    run = held_run()
    run.palm_position = run.palm_position[:, ::-1].copy()
    assert "right hand" in reach(run).message
    turns = held_run()
    turns.palm_position[125:151, 0] = TARGET + np.array([0.0, 0.05, 0.0])
    turns.palm_position[125:151, 1] = TARGET
    assert reach(turns).value == pytest.approx(0.05)


def test_a_hold_that_is_one_tick_too_short_fails() -> None:
    run = held_run()
    run.palm_position[150, 0] = TARGET + np.array([0.0, 0.05, 0.0])
    result = reach(run)
    assert not result.passed
    assert result.value == pytest.approx(0.05)


def test_a_touch_in_passing_is_no_reach() -> None:
    run = held_run(0.05)
    run.palm_position[120, 0] = TARGET
    assert not reach(run).passed


def test_a_check_may_name_its_own_target() -> None:
    assert not reach(held_run(), target=(0.4, 0.0, 0.25)).passed
    assert reach(held_run(), target=(0.4, 0.05, 0.3)).passed  # where the palm is before the hold


def test_reach_without_a_target_or_shorter_than_its_hold_fails() -> None:
    run = held_run()
    run.facts["reach_targets"] = ()
    assert "no target" in reach(run).message
    short = reach(SyntheticRun(50))
    assert not short.passed
    assert np.isnan(short.value)


def test_a_nan_palm_never_reaches() -> None:
    run = held_run(0.05)
    run.palm_position[:] = np.nan
    assert not reach(run).passed


@given(st.data())
def test_best_hold_agrees_with_trying_every_window(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 30))
    width = data.draw(st.integers(1, n))
    error = np.array(data.draw(st.lists(st.floats(0, 1), min_size=2 * n, max_size=2 * n))).reshape(n, 2)
    value, hand, window = best_hold(error, width)
    assert value == min(error[k : k + width, side].max() for k in range(n - width + 1) for side in range(2))
    assert window.stop - window.start == width
    assert error[window, hand].max() == value


def beyond(run: SyntheticRun, minimum: float = 0.03) -> CheckResult:
    config = settings.ComBeyondToes(kind="com_beyond_toes", min=minimum, hold=0.5)
    return ComBeyondToesCheck(config).evaluate(run.context(), "com_beyond_toes")


def test_com_beyond_toes_counts_from_the_edge_of_the_soles() -> None:
    run = held_run()
    run.com[HOLD, 0] = 0.06 + 0.046  # toes at x = 0.06
    run.com[121, 0] = 0.06 + 0.031
    result = beyond(run)
    assert result.passed
    assert result.value == pytest.approx(0.031)


def test_com_over_the_feet_or_leaning_out_at_another_time_fails() -> None:
    run = held_run()
    assert beyond(run).value == pytest.approx(-0.06)  # in the middle, 0.06 from the toes' edge
    run.com[:100, 0] = run.com[151:, 0] = 0.2
    assert not beyond(run).passed


def test_a_lifted_foot_does_not_belong_to_the_polygon() -> None:
    run = held_run()
    run.com[HOLD, 1] = 0.0
    for tick in range(300):
        run.contacts[tick] = [c for c in run.contacts[tick] if c[1] != LEFT_FOOT]
    assert beyond(run, 0.01).value == pytest.approx(0.015)  # right sole ends at y = -0.015
    for tick in range(300):
        run.contacts[tick] = [c for c in run.contacts[tick] if c[1] != RIGHT_FOOT]
    assert "no foot" in beyond(run).message


def test_distance_outside_of_a_square() -> None:
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 1]], dtype=float)
    assert distance_outside(np.array([3.0, 1.0]), square) == pytest.approx(1.0)
    assert distance_outside(np.array([5.0, 6.0]), square) == pytest.approx(5.0)
    assert distance_outside(np.array([0.5, 1.0]), square) == pytest.approx(-0.5)


def braced(fraction: float) -> SyntheticRun:
    run = held_run()
    run.plan(0.5, right=("table_1", ContactPhase.LOADED))
    run.touch(range(90, 160), TABLE, RIGHT_PALM, [3.0, -2.0, fraction * WEIGHT])  # friction does not count
    return run


def brace(run: SyntheticRun) -> CheckResult:
    config = settings.BraceForce(kind="brace_force", min=0.15, hold=0.5)
    return BraceForceCheck(config).evaluate(run.context(), "brace_force")


def test_brace_force_is_the_smallest_normal_force_of_the_hold() -> None:
    result = brace(braced(0.2))
    assert result.passed
    assert result.value == pytest.approx(0.2)
    assert not brace(braced(0.14)).passed


def test_a_brace_that_lets_go_during_the_hold_fails() -> None:
    run = braced(0.2)
    run.contacts[130] = [c for c in run.contacts[130] if c[1] != RIGHT_PALM]
    result = brace(run)
    assert result.value == 0.0
    assert result.first_violation == pytest.approx(1.3)


def test_a_wall_counts_along_its_own_normal_and_an_unchosen_contact_not_at_all() -> None:
    run = held_run()
    run.plan(0.5, left=("wall_1", ContactPhase.LOADED))  # normal -y
    run.touch(range(90, 160), WALL, LEFT_PALM, [0.0, -0.25 * WEIGHT, 1.0])
    run.touch(range(90, 160), TABLE, RIGHT_PALM, [0.0, 0.0, WEIGHT])
    assert brace(run).value == pytest.approx(0.25)


def leaning_run() -> SyntheticRun:
    """No reach; the CoM is beyond the toes from 0.9 s to 1.6 s, farthest from 1.0 s to 1.5 s, and briefly at 2 s."""
    run = braced(0.2)
    run.facts["reach_targets"] = ()
    run.com[90:161, 0] = 0.06 + 0.035
    run.com[HOLD, 0] = 0.06 + 0.040
    run.com[200:240, 0] = 0.3  # for less than the hold
    return run


def test_without_a_reach_the_hold_is_where_the_com_leans_farthest() -> None:
    result = beyond(leaning_run())
    assert result.passed
    assert result.value == pytest.approx(0.040)
    assert "t = 1.00 s" in result.message
    assert brace(leaning_run()).value == pytest.approx(0.2)
    run = leaning_run()
    run.lift([130], RIGHT_PALM)
    assert brace(run).value == 0.0
    upright = leaning_run()
    upright.com[:, 0] = 0.0
    assert beyond(upright).value == pytest.approx(-0.06)


def test_without_a_reach_and_without_feet_nothing_is_outside() -> None:
    run = leaning_run()
    run.lift(range(300), LEFT_FOOT)
    run.lift(range(300), RIGHT_FOOT)
    assert "no foot" in beyond(run).message
    short = SyntheticRun(50)
    short.facts["reach_targets"] = ()
    assert np.isnan(beyond(short).value)
