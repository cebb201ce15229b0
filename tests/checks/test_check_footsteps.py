"""footsteps, com_outside_stance: what is a footstep, and where the CoM is meanwhile."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from synthetic import FLOOR, LEFT_FOOT, RIGHT_FOOT, TABLE, WEIGHT, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.balance import ComOutsideStanceCheck
from wbmpc.checks.footsteps import FootstepsCheck, footsteps
from wbmpc.checks.result import CheckResult


def walking_run(steps: int = 4, length: float = 0.06) -> SyntheticRun:
    """Left and right in turns, 0.3 s in the air every 0.5 s; the first step is half as long as the others."""
    run = SyntheticRun(50 * steps + 50)
    for k in range(steps):
        foot = (LEFT_FOOT, RIGHT_FOOT)[k % 2]
        run.step(foot, 50 * k + 20, 50 * k + 50, (length / 2 if k == 0 else length, 0.0))
    return run


def count(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.Footsteps(kind="footsteps", **{"min_count": 4, **values})  # type: ignore[arg-type]
    return FootstepsCheck(config).evaluate(run.context(), "footsteps")


def test_all_steps_of_a_walk_are_counted_and_measured() -> None:
    result = count(walking_run())
    assert result.passed
    assert result.value == 4
    assert "0.030 to 0.060 m" in result.message
    assert not count(walking_run(), min_count=5).passed


def test_a_footstep_has_its_times_and_its_length() -> None:
    steps = footsteps(walking_run(2).context())
    assert [(step.side, step.lift_off, step.touch_down) for step in steps] == [(0, 20, 50), (1, 70, 100)]
    assert [step.length for step in steps] == pytest.approx([0.03, 0.06])


@pytest.mark.parametrize(("foot", "landings"), [("left", 3), ("right", 2), ("any", 5)])
def test_landings_of_one_foot(foot: str, landings: int) -> None:
    assert count(walking_run(5), foot=foot, min_count=1).value == landings


def test_short_steps_and_those_outside_the_window_do_not_count() -> None:
    assert count(walking_run(), min_length=0.05).value == 3
    assert count(walking_run(), window=(0.9, 1.6)).value == 2  # landings at 0.5, 1.0, 1.5 and 2.0 s


def test_standing_and_sliding_are_no_steps() -> None:
    run = SyntheticRun()
    run.sole_position[:, 0, 0] += np.linspace(0.0, 0.1, run.ticks)
    assert count(run).value == 0


def test_a_foot_that_loses_contact_for_a_moment_has_made_no_step() -> None:
    run = SyntheticRun()
    run.lift(range(20, 29), LEFT_FOOT)  # 0.09 s
    assert count(run).value == 0
    run.lift(range(60, 70), LEFT_FOOT)  # 0.10 s
    assert count(run).value == 1


def test_a_scuff_in_mid_swing_does_not_make_two_steps_of_one() -> None:
    run = SyntheticRun()
    run.step(LEFT_FOOT, 20, 60, (0.06, 0.0))
    run.touch(range(38, 42), FLOOR, LEFT_FOOT, [0.0, 0.0, 0.09 * WEIGHT])
    result = count(run)
    assert result.value == 1
    assert "0.060 m" in result.message
    heavier = SyntheticRun()
    heavier.step(LEFT_FOOT, 20, 60, (0.06, 0.0))
    heavier.touch(range(38, 42), FLOOR, LEFT_FOOT, [0.0, 0.0, 0.11 * WEIGHT])
    assert count(heavier).value == 2


def test_a_foot_that_never_comes_down_or_never_was_down_makes_no_step() -> None:
    run = SyntheticRun()
    run.lift(range(40, 100), LEFT_FOOT)
    run.lift(range(0, 30), RIGHT_FOOT)
    assert count(run).value == 0


def test_a_landing_on_an_object_is_a_landing() -> None:
    run = SyntheticRun()
    run.lift(range(20, 100), LEFT_FOOT)
    run.touch(range(60, 100), TABLE, LEFT_FOOT, [0.0, 0.0, WEIGHT / 2])
    assert count(run).value == 1


@hypothesis_settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(10, 40), st.integers(1, 40), st.floats(-0.1, 0.1)), max_size=5))
def test_whatever_the_rhythm_every_flight_is_one_step(rhythm: list[tuple[int, int, float]]) -> None:
    run = SyntheticRun(sum(air + stance for air, stance, _ in rhythm) + 2)
    tick = 1
    for air, stance, length in rhythm:
        run.step(RIGHT_FOOT, tick, tick + air, (0.0, length))
        tick += air + stance
    found = footsteps(run.context())
    assert [step.touch_down - step.lift_off for step in found] == [air for air, _, _ in rhythm]
    assert [step.length for step in found] == pytest.approx([abs(length) for _, _, length in rhythm], abs=1e-12)


def lateral_run(com: float) -> SyntheticRun:
    """A step of the left foot to the left, 0.4 s to 0.8 s; the CoM is at y = `com` [m] when it lands, and stays."""
    run = SyntheticRun(200)
    run.step(LEFT_FOOT, 40, 80, (0.0, 0.15))
    run.com[40:79, 1] = np.linspace(-0.05, com, 39)
    run.com[79:, 1] = com
    return run


def outside(run: SyntheticRun) -> CheckResult:
    config = settings.ComOutsideStance(kind="com_outside_stance", min=0.05)
    return ComOutsideStanceCheck(config).evaluate(run.context(), "outside")


def test_the_com_is_measured_from_the_stance_sole_alone() -> None:
    # The right sole ends at y = -0.05 + 0.035 = -0.015, the left one is in the air.
    result = outside(lateral_run(0.04))
    assert result.passed
    assert result.value == pytest.approx(0.055)
    assert "left foot" in result.message
    assert outside(lateral_run(0.03)).value == pytest.approx(0.045)
    assert not outside(lateral_run(0.03)).passed


def test_the_com_outside_after_the_landing_or_in_double_support_is_no_matter() -> None:
    run = lateral_run(-0.05)
    run.com[80:, 1] = 0.2
    run.com[:40, 1] = 0.2
    assert outside(run).value == pytest.approx(-0.035)


def test_a_fall_is_no_step() -> None:
    falling = lateral_run(0.2)
    falling.torso_up[100:] = 0.5  # within 0.5 s of the landing at 0.8 s
    result = outside(falling)
    assert not result.passed
    assert np.isnan(result.value)
    fallen_later = lateral_run(0.2)
    fallen_later.torso_up[131:] = 0.5
    assert outside(fallen_later).passed
    never_down = lateral_run(0.2)
    never_down.lift(range(80, 200), LEFT_FOOT)
    assert not outside(never_down).passed


def test_a_hop_has_no_stance_foot() -> None:
    run = lateral_run(0.2)
    run.lift(range(40, 80), RIGHT_FOOT)
    assert not outside(run).passed


def test_a_scuff_is_no_single_support() -> None:
    run = lateral_run(0.04)
    run.touch([60], FLOOR, LEFT_FOOT, [0.0, 0.0, 0.05 * WEIGHT])
    run.com[60, 1] = 0.3
    assert outside(run).value == pytest.approx(0.055)


def test_a_turned_stance_foot_turns_its_rectangle() -> None:
    run = lateral_run(0.04)
    run.sole_yaw[:, 1] = np.pi / 2  # now 0.06 to the left, where it was 0.035
    assert outside(run).value == pytest.approx(0.04 - (-0.05 + 0.06))
