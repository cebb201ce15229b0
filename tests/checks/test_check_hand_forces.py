"""both_hands, hand_impact, hand_force_caps, hands_free_at_end."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import LEFT_PALM, RIGHT_PALM, TABLE, WALL, WEIGHT, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.hand_forces import BothHandsCheck, HandForceCapsCheck, HandImpactCheck, HandsFreeAtEndCheck
from wbmpc.checks.result import CheckResult
from wbmpc.signals import ContactPhase

LOADED = ContactPhase.LOADED


def two_handed_run(left: float = 0.2, right: float = 0.1) -> SyntheticRun:
    """The left palm on the wall from 0.3 s to 1.5 s, the right one on the table from 0.5 s to 1.8 s; of weight."""
    run = SyntheticRun(200)
    run.plan(0.0, left=("wall_1", LOADED), right=("table_1", LOADED))
    run.touch(range(30, 150), WALL, LEFT_PALM, [1.0, -left * WEIGHT, 2.0])
    run.touch(range(50, 180), TABLE, RIGHT_PALM, [1.0, 2.0, right * WEIGHT])
    return run


def both(run: SyntheticRun, **values: float) -> CheckResult:
    config = settings.BothHands(kind="both_hands", **{"min": 0.1, "hold": 0.5, **values})  # type: ignore[arg-type]
    return BothHandsCheck(config).evaluate(run.context(), "both_hands")


def test_both_hands_count_along_their_normals_as_long_as_both_push() -> None:
    result = both(two_handed_run())
    assert result.passed
    assert result.value == pytest.approx(0.1)
    assert both(two_handed_run(), hold=0.99).passed  # 100 ticks, 0.5 s to 1.5 s
    assert not both(two_handed_run(), hold=1.0).passed
    assert not both(two_handed_run(right=0.099)).passed


def test_one_hand_or_two_in_turns_are_not_both() -> None:
    run = two_handed_run()
    run.lift(range(200), RIGHT_PALM)
    assert both(run).value == 0.0
    turns = two_handed_run()
    for tick in range(0, 200, 10):
        turns.lift(range(tick, tick + 5), LEFT_PALM)
        turns.lift(range(tick + 5, tick + 10), RIGHT_PALM)
    assert not both(turns, hold=0.05).passed


def test_a_contact_that_nobody_chose_is_no_brace() -> None:
    run = two_handed_run()
    run.plans.clear()
    run.plan(0.0, left=("wall_1", LOADED))
    assert not both(run).passed


def test_hold_longer_than_the_run() -> None:
    assert np.isnan(both(two_handed_run(), hold=2.0).value)


def impact(run: SyntheticRun, maximum: float = 1.5) -> CheckResult:
    return HandImpactCheck(settings.HandImpact(kind="hand_impact", max=maximum)).evaluate(run.context(), "impact")


def test_impact_is_the_whole_force_of_the_worst_tick() -> None:
    run = two_handed_run()
    run.touch([33], WALL, LEFT_PALM, [0.0, -1.3 * WEIGHT, 0.0])  # on top of the contact's own force
    result = impact(run)
    assert result.value == pytest.approx(np.linalg.norm([1.0, 1.5 * WEIGHT, 2.0]) / WEIGHT)
    assert not result.passed
    assert result.first_violation == pytest.approx(0.33)
    assert "left palm" in result.message
    assert impact(run, 1.6).passed


def test_hands_that_never_touch_have_no_impact() -> None:
    result = impact(SyntheticRun())
    assert result.passed
    assert result.value == 0.0


def caps(run: SyntheticRun, margin: float = 1.0) -> CheckResult:
    config = settings.HandForceCaps(kind="hand_force_caps", margin=margin)
    return HandForceCapsCheck(config).evaluate(run.context(), "caps")


def test_caps_are_those_of_each_hands_own_patch() -> None:
    run = two_handed_run(left=5.5 / WEIGHT, right=5.9 / WEIGHT)  # caps: wall_1 5 N, table_1 8 N
    result = caps(run)
    assert result.passed
    assert result.value == pytest.approx(0.5)
    assert "left hand on wall_1" in result.message
    result = caps(run, 0.4)
    assert not result.passed
    assert result.first_violation == pytest.approx(0.5)  # 0.2 s after the left hand touched


def test_an_impact_is_not_judged_but_a_later_blow_is() -> None:
    run = two_handed_run(left=1.0 / WEIGHT, right=1.0 / WEIGHT)
    run.touch(range(30, 50), WALL, LEFT_PALM, [0.0, -50.0, 0.0])
    assert caps(run).passed
    run.touch([50], WALL, LEFT_PALM, [0.0, -50.0, 0.0])
    assert not caps(run).passed


def test_a_palm_that_presses_on_after_its_release_is_judged_by_the_same_cap() -> None:
    run = two_handed_run(left=6.5 / WEIGHT)
    run.plan(0.31, left=("wall_1", ContactPhase.RELEASED), right=("table_1", LOADED))
    result = caps(run)
    assert not result.passed
    assert result.value == pytest.approx(1.5)


def test_the_mean_over_10_ms_is_what_counts() -> None:
    """In steps of 2 ms: one tick of 20 N among ticks of 2 N is 5.6 N on average."""
    run = two_handed_run(left=2.0 / WEIGHT, right=2.0 / WEIGHT)
    run.facts["timestep"] = 0.002
    run.touch([145], WALL, LEFT_PALM, [0.0, -18.0, 0.0])
    assert caps(run).value == pytest.approx((20 + 4 * 2) / 5 - 5)


@pytest.mark.parametrize(("tick", "passed"), [(129, True), (130, False), (149, False)])
def test_the_first_mean_holds_no_force_of_the_impact(tick: int, passed: bool) -> None:
    run = two_handed_run(left=2.0 / WEIGHT, right=2.0 / WEIGHT)
    run.facts["timestep"] = 0.002  # the left palm touches from tick 30 to 149: 0.2 s are over at tick 130
    run.touch([tick], WALL, LEFT_PALM, [0.0, -40.0, 0.0])
    assert caps(run).passed == passed


def test_no_hand_no_force() -> None:
    assert caps(SyntheticRun()).passed


def free(run: SyntheticRun, duration: float = 0.2) -> CheckResult:
    config = settings.HandsFreeAtEnd(kind="hands_free_at_end", duration=duration)
    return HandsFreeAtEndCheck(config).evaluate(run.context(), "free")


def test_hands_are_free_since_their_last_touch() -> None:
    result = free(two_handed_run())  # the right palm leaves at 1.8 s of 2 s
    assert result.passed
    assert result.value == pytest.approx(0.2)
    assert not free(two_handed_run(), 0.21).passed
    run = two_handed_run()
    run.touch([195], TABLE, LEFT_PALM, [0.0, 0.0, 0.02])  # a light one
    assert free(run).value == pytest.approx(0.04)


def test_hands_that_never_touch_are_free_as_long_as_the_run() -> None:
    assert free(SyntheticRun(), 1.0).value == pytest.approx(1.0)
    assert not free(SyntheticRun(), 1.1).passed
