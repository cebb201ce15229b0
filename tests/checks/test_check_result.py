"""The two comparisons that every check ends with."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wbmpc.checks.result import at_least, at_most, first_time


@pytest.mark.parametrize("compare", [at_most, at_least])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_never_passes(compare, value: float) -> None:  # type: ignore[no-untyped-def]
    assert not compare("x", value, 1.0, "m", "", when=None).passed


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_comparisons_agree_with_arithmetic_up_to_rounding(value: float, threshold: float) -> None:
    tolerance = 2e-9 * abs(threshold)
    most = at_most("x", value, threshold, "m", "", when=3.0)
    least = at_least("x", value, threshold, "m", "", when=3.0)
    assert most.passed or value > threshold
    assert least.passed or value < threshold
    assert not most.passed or value <= threshold + tolerance
    assert not least.passed or value >= threshold - tolerance
    assert (most.first_violation is None) == most.passed


def test_first_time() -> None:
    assert first_time([0.0, 0.1, 0.2], [False, True, True]) == 0.1  # type: ignore[arg-type]
    assert first_time([0.0, 0.1], [False, False]) is None  # type: ignore[arg-type]
