"""The palm's paths against finite differences, and what they promise: rest at both ends, up before along."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from wbmpc.planner.hand_path import HandPath, minimum_jerk
from wbmpc.signals import Vector

points = arrays(float, 3, elements=st.floats(-0.5, 0.5))
UP = np.array([0.0, 0.0, 1.0])


@given(phase=st.floats(0.01, 0.99))
def test_minimum_jerk_derivatives(phase: float) -> None:
    h = 1e-5
    before, now, after = (minimum_jerk(phase + d) for d in (-h, 0.0, h))
    assert now[1] == pytest.approx((after[0] - before[0]) / (2 * h), abs=1e-6)
    assert now[2] == pytest.approx((after[1] - before[1]) / (2 * h), abs=1e-6)


def test_minimum_jerk_is_the_rest_to_rest_quintic() -> None:
    """The six conditions at the ends determine it: solve for the coefficients and compare."""
    rows = [[k == 0 for k in range(6)], [k == 1 for k in range(6)], [2.0 * (k == 2) for k in range(6)]]
    rows += [[1.0] * 6, [float(k) for k in range(6)], [float(k * (k - 1)) for k in range(6)]]
    coefficients = np.linalg.solve(np.array(rows, dtype=float), [0, 0, 0, 1, 0, 0])
    for phase in np.linspace(0, 1, 11):
        assert minimum_jerk(phase)[0] == pytest.approx(np.polynomial.polynomial.polyval(phase, coefficients), abs=1e-12)


@given(start=points, end=points, sigma=st.floats(0.01, 0.99))
def test_derivatives_of_a_path(start: Vector, end: Vector, sigma: float) -> None:
    path, h = HandPath(start=start, end=end, away=UP), 1e-5
    before, (_, velocity, acceleration), after = (path.at(sigma + d) for d in (-h, 0.0, h))
    assert_allclose(velocity, (after[0] - before[0]) / (2 * h), atol=1e-6)
    # the third derivative jumps where a component starts or stops: first order there
    assert_allclose(acceleration, (after[1] - before[1]) / (2 * h), atol=3e-3)


@given(start=points, end=points)
def test_a_path_starts_and_ends_at_rest(start: Vector, end: Vector) -> None:
    path = HandPath(start=start, end=end, away=UP)
    for sigma, where in ((0.0, start), (1.0, end), (-0.3, start), (1.7, end)):
        position, velocity, acceleration = path.at(sigma)
        assert_allclose(position, where, atol=1e-12)
        assert_allclose(velocity, 0.0, atol=1e-12)
        assert_allclose(acceleration, 0.0, atol=1e-12)


@given(start=points, end=points, sigma=st.floats(0.0, 1.0), away=arrays(float, 3, elements=st.floats(0.1, 1.0)))
def test_a_palm_leaves_before_it_moves_and_arrives_before_it_sinks(
    start: Vector, end: Vector, sigma: float, away: Vector
) -> None:
    """Away from the surface the outward share is always ahead of the sideways share; towards it, behind."""
    away = away / np.linalg.norm(away)
    way = end - start
    along = float(way @ away)
    sideways = way - along * away
    position = HandPath(start=start, end=end, away=away).at(sigma)[0] - start
    if abs(along) < 1e-3 or np.linalg.norm(sideways) < 1e-3:
        return
    outward_share = float(position @ away) / along
    sideways_share = float(position @ sideways) / float(sideways @ sideways)
    assert -1e-9 <= outward_share <= 1 + 1e-9
    if along > 0:
        assert outward_share >= sideways_share - 1e-9
    else:
        assert outward_share <= sideways_share + 1e-9


def test_the_order_is_not_a_tie() -> None:
    rise = HandPath(start=np.zeros(3), end=np.array([0.2, 0.0, 0.1]), away=UP).at(0.4)[0]
    assert rise[2] / 0.1 > 0.7
    assert rise[0] / 0.2 < 0.1
    sink = HandPath(start=np.array([0.0, 0.0, 0.1]), end=np.array([0.2, 0.0, 0.0]), away=UP).at(0.6)[0]
    assert sink[0] == pytest.approx(0.2)
    assert sink[2] > 0.05


@given(start=points, end=points, sigmas=arrays(float, 5, elements=st.floats(-0.5, 1.5)))
def test_positions_are_the_path_at_each_sigma(start: Vector, end: Vector, sigmas: Vector) -> None:
    path = HandPath(start=start, end=end, away=UP)
    assert_allclose(path.positions(sigmas), [path.at(s)[0] for s in sigmas], atol=1e-12)
