"""contact_sequence, and how touches make contacts."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from synthetic import LEFT_PALM, RIGHT_PALM, STEP, TABLE, WALL, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.hand_contacts import ContactSequenceCheck, hand_contacts
from wbmpc.checks.result import CheckResult
from wbmpc.checks.stretches import joined
from wbmpc.signals import ContactPhase

OBJECT = {"table_1": TABLE, "table_2": TABLE, "wall_1": WALL}


def sequence_run(*contacts: tuple[str, str], force: float = 2.0, ticks: int = 50) -> SyntheticRun:
    """Contacts (hand, patch) one after another, one each second, chosen half a second before."""
    run = SyntheticRun(100 * len(contacts) + 100)
    run.plan(0.0)
    for k, (hand, patch) in enumerate(contacts):
        start = 100 * k + 50
        run.plan((start - 40) * STEP, **{hand: (patch, ContactPhase.CHOSEN)})  # type: ignore[arg-type]
        run.plan(start * STEP, **{hand: (patch, ContactPhase.LOADED)})  # type: ignore[arg-type]
        run.plan((start + ticks) * STEP, **{hand: (patch, ContactPhase.RELEASED)})  # type: ignore[arg-type]
        palm = LEFT_PALM if hand == "left" else RIGHT_PALM
        run.touch(range(start, start + ticks), OBJECT[patch], palm, [0.0, 0.0, force])
    return run


def sequence(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.ContactSequence(kind="contact_sequence", **{"min_contacts": 2, **values})  # type: ignore[arg-type]
    return ContactSequenceCheck(config).evaluate(run.context(), "sequence")


def test_two_contacts_by_two_hands() -> None:
    run = sequence_run(("right", "table_1"), ("left", "wall_1"))
    result = sequence(run, hands_alternate=True)
    assert result.passed
    assert result.value == 2
    assert "right table_1, left wall_1" in result.message
    assert not sequence(run, min_contacts=3).passed


def test_one_patch_twice_in_a_row_is_no_sequence() -> None:
    result = sequence(sequence_run(("right", "table_1"), ("left", "table_1")))
    assert not result.passed
    assert "one patch twice" in result.message
    assert result.first_violation == pytest.approx(1.5)


def test_one_hand_twice_in_a_row_only_where_hands_need_not_alternate() -> None:
    run = sequence_run(("right", "table_1"), ("right", "table_2"))
    assert sequence(run).passed
    result = sequence(run, hands_alternate=True)
    assert not result.passed
    assert "one hand twice" in result.message


def test_coming_back_to_the_patch_just_left_makes_no_new_contact() -> None:
    assert sequence(sequence_run(("right", "table_1"), ("right", "table_1"))).value == 1
    returning = sequence_run(("right", "table_1"), ("left", "table_2"), ("right", "table_1"))
    assert sequence(returning, hands_alternate=True).value == 3


@pytest.mark.parametrize(("force", "ticks", "count"), [(0.5, 10, 2), (0.49, 10, 0), (0.5, 9, 0)])
def test_a_contact_must_carry_load_for_a_while(force: float, ticks: int, count: int) -> None:
    run = sequence_run(("right", "table_1"), ("left", "wall_1"), force=force, ticks=ticks)
    assert sequence(run).value == count


def test_a_touch_of_another_object_or_of_an_unchosen_hand_does_not_count() -> None:
    run = sequence_run(("right", "table_1"), ("left", "wall_1"))
    for contacts in run.contacts:
        for k, (first, second, force, distance) in enumerate(contacts):
            if first == WALL:
                contacts[k] = (TABLE, second, force, distance)
    assert sequence(run).value == 1
    run.plans = run.plans[:1]  # nothing was ever chosen
    assert sequence(run).value == 0


def test_a_hand_that_still_touches_at_the_end_is_not_released() -> None:
    run = sequence_run(("right", "table_1"), ("left", "wall_1"))
    run.touch(range(295, 300), TABLE, RIGHT_PALM, [0.0, 0.0, 1.0])
    result = sequence(run)
    assert not result.passed
    assert "at the end" in result.message
    assert sequence(run, released=False).passed


def test_both_hands_at_once_are_in_the_order_of_their_beginnings() -> None:
    run = SyntheticRun(200)
    run.plan(0.0, left=("wall_1", ContactPhase.LOADED), right=("table_2", ContactPhase.LOADED))
    run.touch(range(50, 150), WALL, LEFT_PALM, [0.0, -2.0, 0.0])
    run.touch(range(40, 150), TABLE, RIGHT_PALM, [0.0, 0.0, 2.0])
    assert "right table_2, left wall_1" in sequence(run, hands_alternate=True).message


def test_touches_are_joined_for_each_hand_and_object() -> None:
    run = SyntheticRun(200)
    run.touch([*range(10, 20), *range(49, 60)], TABLE, LEFT_PALM, [0.0, 0.0, 5.0])  # 0.29 s apart: one contact
    run.touch(range(25, 30), TABLE, RIGHT_PALM, [0.0, 0.0, 5.0])
    run.touch(range(65, 70), WALL, LEFT_PALM, [0.0, -5.0, 0.0])
    run.touch(range(90, 95), TABLE, LEFT_PALM, [0.0, 0.0, 5.0])  # 0.30 s after: another one
    found = [(contact.side, contact.start, contact.stop) for contact in hand_contacts(run.context())]
    assert found == [(0, 10, 60), (1, 25, 30), (0, 65, 70), (0, 90, 95)]


@hypothesis_settings(max_examples=100, deadline=None)
@given(st.lists(st.booleans(), max_size=40), st.integers(1, 6))
def test_joined_stretches_are_whole_and_far_apart(active: list[bool], gap: int) -> None:
    found = joined(np.array(active, dtype=bool), gap)
    assert all(active[start] and active[stop - 1] for start, stop in found)
    assert {k for k, now in enumerate(active) if now} <= {k for start, stop in found for k in range(start, stop)}
    assert all(later[0] - earlier[1] >= gap for earlier, later in itertools.pairwise(found))
    for start, stop in found:
        gaps = "".join("x" if now else "." for now in active[start:stop]).split("x")
        assert all(len(lost) < gap for lost in gaps)
