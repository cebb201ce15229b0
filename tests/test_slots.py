"""Places of ticks on the wall clock, at any pace."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbmpc.slots import Slots

STEP = 1e-3
changes = st.lists(st.tuples(st.integers(1, 500), st.sampled_from([1.0, 0.5, 0.25, 1 / 16]), st.floats(0.0, 3.0)))


def test_undisturbed_they_are_the_plain_product() -> None:
    slots = Slots(7.3, STEP)
    assert [slots.of(k) for k in range(2000)] == [7.3 + k * STEP for k in range(2000)]


@given(changes)
def test_paces_and_pauses_add_up(course: list[tuple[int, float, float]]) -> None:
    """Against a clock that is moved on tick by tick; what was added is what the start seems later by."""
    slots, pace, tick, now = Slots(7.3, STEP), 1.0, 0, 7.3
    for ticks, new, pause in course:
        for _ in range(ticks):
            assert slots.of(tick) == pytest.approx(now, abs=1e-9)
            tick, now = tick + 1, now + STEP / pace
        if pause:
            now += pause
        slots.go_on(tick, new, at=now if pause else None)
        pace = new
    assert slots.of(tick) == pytest.approx(now, abs=1e-9)
    assert slots.start(tick) == pytest.approx(now - tick * STEP, abs=1e-9)
