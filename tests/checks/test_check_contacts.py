"""declared_contacts, penetration, contact_patches."""

from __future__ import annotations

import pytest
from synthetic import FLOOR, LEFT_FOOT, LEFT_PALM, RIGHT_FOOT, RIGHT_PALM, TABLE, TORSO, WALL, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.contacts import DeclaredContactsCheck, PenetrationCheck
from wbmpc.checks.hand_contacts import ContactPatchesCheck
from wbmpc.checks.result import CheckResult
from wbmpc.signals import ContactPhase, SolveStatus

UP = [0.0, 0.0, 5.0]
SOLVED, NOT_RUN = SolveStatus.SOLVED, SolveStatus.NOT_RUN


def braced_run() -> SyntheticRun:
    """The right palm on the table from 0.3 s to 0.7 s, on a patch chosen at 0.2 s and given up at 0.65 s."""
    run = SyntheticRun(200)
    run.plan(0.0)
    run.plan(0.2, right=("table_1", ContactPhase.CHOSEN), statuses=(SOLVED, SOLVED, SOLVED))
    run.plan(0.3, right=("table_1", ContactPhase.LOADED))
    run.plan(0.65, right=("table_1", ContactPhase.RELEASED))
    run.touch(range(30, 70), TABLE, RIGHT_PALM, UP)
    return run


def declared(run: SyntheticRun, **values: float) -> CheckResult:
    return DeclaredContactsCheck(settings.DeclaredContacts(**values)).evaluate(run.context(), "declared_contacts")


def test_feet_and_a_chosen_palm_are_declared() -> None:
    assert declared(braced_run(), release_time=0.1).passed


def test_feet_on_a_walkable_object_and_objects_among_themselves_are_declared() -> None:
    run = SyntheticRun()
    run.touch(range(10), TABLE, LEFT_FOOT, UP)
    run.touch(range(10), FLOOR, TABLE, UP)
    run.walkable |= {TABLE}
    assert declared(run).passed
    run.touch(range(20, 30), FLOOR, RIGHT_PALM, UP)  # walkable is for feet
    assert declared(run).first_violation == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        ((TABLE, TORSO), "torso – table"),
        ((TABLE, LEFT_FOOT), "left_foot – table"),  # a sill is not made for walking
        ((TORSO, WALL), "torso – wall"),
        ((FLOOR, RIGHT_PALM), "right_palm – floor"),
        ((TABLE, LEFT_PALM), "left_palm – table"),  # chosen for the right hand only
        ((WALL, RIGHT_PALM), "right_palm – wall"),  # chosen, but for another object
        ((LEFT_FOOT, RIGHT_FOOT), "left_foot – right_foot"),
        ((LEFT_PALM, TORSO), "left_palm – torso"),
    ],
)
def test_any_other_pair_is_named(pair: tuple[int, int], words: str) -> None:
    run = braced_run()
    run.touch(range(40, 50), *pair, [3.0, 0.0, 4.0])
    result = declared(run)
    assert not result.passed
    assert words in result.message
    assert result.value == pytest.approx(5.0)
    assert result.first_violation == pytest.approx(0.4)


def test_a_palm_before_its_patch_is_chosen_is_undeclared() -> None:
    run = braced_run()
    run.touch(range(15, 30), TABLE, RIGHT_PALM, UP)
    assert declared(run).first_violation == pytest.approx(0.15)


def test_a_palm_that_stays_after_its_release_is_undeclared() -> None:
    run = braced_run()
    run.touch(range(70, 120), TABLE, RIGHT_PALM, UP)
    # Given up by the plan of 0.65 s, so last declared at 0.64 s; 0.2 s of grace end with tick 84.
    assert declared(run, release_time=0.2).first_violation == pytest.approx(0.85)


def test_a_touch_lighter_than_the_bound_is_ignored() -> None:
    run = SyntheticRun()
    run.touch(range(10), TABLE, TORSO, [0.0, 0.0, 0.009])
    assert declared(run).passed


def test_penetration_takes_the_deepest_contact_and_names_it() -> None:
    run = SyntheticRun()
    run.touch([20], TABLE, RIGHT_PALM, UP, distance=-0.0015)
    result = PenetrationCheck(settings.Penetration()).evaluate(run.context(), "penetration")
    assert result.passed
    assert result.value == pytest.approx(0.0015)
    run.touch([60], FLOOR, RIGHT_FOOT, UP, distance=-0.0025)
    run.touch([70], FLOOR, RIGHT_FOOT, UP, distance=-0.0035)
    result = PenetrationCheck(settings.Penetration()).evaluate(run.context(), "penetration")
    assert not result.passed
    assert result.value == pytest.approx(0.0035)
    assert "right_foot" in result.message
    assert result.first_violation == pytest.approx(0.6)


def test_penetration_of_a_robot_in_the_air_is_none() -> None:
    run = SyntheticRun()
    run.contacts = [[] for _ in range(run.ticks)]
    result = PenetrationCheck(settings.Penetration()).evaluate(run.context(), "penetration")
    assert result.passed
    assert result.value == 0.0


def patches(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.ContactPatches(kind="contact_patches", **values)  # type: ignore[arg-type]
    return ContactPatchesCheck(config).evaluate(run.context(), "contact_patches")


def test_one_contact_on_an_allowed_patch() -> None:
    result = patches(braced_run(), allowed=("table_1",), min_count=1, max_count=1)
    assert result.passed
    assert result.value == 1


def test_a_patch_that_is_not_allowed_fails_when_it_is_chosen() -> None:
    result = patches(braced_run(), allowed=("table_2", "wall_1"), min_count=1)
    assert not result.passed
    assert "not allowed: table_1" in result.message
    assert result.first_violation == pytest.approx(0.2)


def test_a_chosen_patch_that_is_never_touched_is_no_contact() -> None:
    run = SyntheticRun()
    run.plan(0.1, right=("table_1", ContactPhase.APPROACHING))
    assert not patches(run, min_count=1).passed


def test_short_losses_do_not_count_as_new_contacts_but_long_ones_do() -> None:
    run = SyntheticRun(200)
    run.touch([*range(10, 40), *range(55, 70), *range(110, 120)], TABLE, LEFT_PALM, UP)  # gaps of 0.15 and 0.40 s
    result = patches(run, max_count=1)
    assert not result.passed
    assert result.value == 2
    assert result.first_violation == pytest.approx(1.1)


def test_no_contact_allowed_means_that_stage_3_must_not_fire_either() -> None:
    run = SyntheticRun()
    run.plan(0.1)
    assert patches(run, max_count=0).passed
    run.plan(0.4, statuses=(SOLVED, SOLVED, SolveStatus.INFEASIBLE))
    result = patches(run, max_count=0)
    assert not result.passed
    assert result.first_violation == pytest.approx(0.4)


def test_no_contact_allowed_fails_on_a_touch_without_any_plan_for_it() -> None:
    run = SyntheticRun()
    run.plan(0.0)
    run.touch(range(30, 40), TABLE, RIGHT_PALM, UP)
    result = patches(run, max_count=0)
    assert not result.passed
    assert result.first_violation == pytest.approx(0.3)
    assert run.plans[0].stage3.status == NOT_RUN
