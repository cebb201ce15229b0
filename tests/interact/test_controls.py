"""Keys, one by one, without a window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.interact.controls import DIRECTIONS, SLOWEST, STEP, Controls, Key, Wish
from wbmpc.signals import TargetMove


def two_reaches() -> Controls:
    return Controls({1: np.array([0.4, 0.1, 0.3]), 4: np.array([0.3, -0.2, 0.2])})


def test_arrows_move_the_chosen_target_and_no_other() -> None:
    controls = two_reaches()
    order = controls.press(Key.UP.value)
    assert isinstance(order, TargetMove)
    assert order.task == 1
    assert_allclose(order.target, [0.4 + STEP, 0.1, 0.3])
    controls.press(Key.HOME.value)
    order = controls.press(Key.PAGE_DOWN.value)
    assert isinstance(order, TargetMove)
    assert order.task == 4
    assert_allclose(controls.places, [[0.4 + STEP, 0.1, 0.3], [0.3, -0.2, 0.2 - STEP]])
    controls.press(Key.HOME.value)
    assert controls.chosen == 0


def test_targets_given_are_not_changed() -> None:
    given_places = {0: np.array([0.4, 0.1, 0.3])}
    Controls(given_places).press(Key.LEFT.value)
    assert_allclose(given_places[0], [0.4, 0.1, 0.3])


def test_an_order_keeps_its_place_when_more_keys_follow() -> None:
    controls = two_reaches()
    first = controls.press(Key.UP.value)
    controls.press(Key.UP.value)
    assert isinstance(first, TargetMove)
    assert first.target[0] == pytest.approx(0.41)


@given(st.lists(st.integers(-1, 400)))
def test_any_keys_leave_sound_controls(codes: list[int]) -> None:
    controls = two_reaches()
    expected = controls.places
    for code in codes:
        chosen = controls.chosen
        answer = controls.press(code)
        if code in {key.value for key in DIRECTIONS}:
            assert isinstance(answer, TargetMove)
            expected[chosen] += STEP * np.array(DIRECTIONS[Key(code)])
            expected[chosen, 2] = max(expected[chosen, 2], 0.0)
        assert SLOWEST <= controls.pace <= 1.0
    assert_allclose(controls.places, expected, atol=1e-12)
    assert controls.paused == (codes.count(Key.SPACE.value) % 2 == 1)
    assert controls.plan_shown == (codes.count(Key.INSERT.value) % 2 == 0)


def test_pace_halves_and_doubles() -> None:
    controls = two_reaches()
    for _ in range(3):
        controls.press(Key.MINUS.value)
    assert controls.pace == 1 / 8
    controls.press(Key.EQUAL.value)
    assert controls.pace == 1 / 4


@pytest.mark.parametrize(("key", "wish"), [(Key.ENTER, Wish.PUSH), (Key.BACKSPACE, Wish.RESET), (Key.END, Wish.QUIT)])
def test_wishes(key: Key, wish: Wish) -> None:
    assert two_reaches().press(key.value) is wish


def test_without_a_reach_the_arrows_do_nothing() -> None:
    controls = Controls({})
    for key in (*DIRECTIONS, Key.HOME):
        assert controls.press(key.value) is None
    assert controls.places.shape == (0, 3)
