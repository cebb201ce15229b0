"""The CoM bands of stages 1 and 2 against the inequality |R − C| ≤ d itself, tried point by point."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.bands import NO_FOOT, height_band, horizontal_band
from wbmpc.planner.settings import HeightSettings
from wbmpc.signals import Vector

N = 5
SETTINGS = HeightSettings()


def ends(rng: np.random.Generator, *, count: int, axes: int) -> Vector:
    """Random references (count, N, axes), some knots without one."""
    references = rng.uniform(-0.3, 0.3, (count, N, axes))
    references[rng.random((count, N)) < 0.3] = np.nan
    return references


@given(seed=st.integers(0, 2**32 - 1), feet=st.integers(0, 1))
def test_horizontal_band_is_where_every_end_reaches(seed: int, feet: int) -> None:
    rng = np.random.default_rng(seed)
    palms, foot = ends(rng, count=2, axes=3), rng.uniform(-0.3, 0.3, (feet, N, 2))
    of_palms, of_foot = rng.uniform(0.05, 0.4, (2, 2)), rng.uniform(0.05, 0.4, (feet, N, 2))
    band = horizontal_band(palms, of_palms, foot, of_foot)
    references = np.concatenate([palms[:, :, :2], foot])
    distance = np.concatenate([np.tile(of_palms[:, None], (1, N, 1)), of_foot])
    assert band.shape == (2, N, 2)
    for axis in range(2):
        for k in range(N):
            place = references[:, k, axis]
            d = distance[:, k, axis]
            for c in rng.uniform(-0.8, 0.8, 20):
                reached = [abs(p - c) <= margin for p, margin in zip(place, d, strict=True) if np.isfinite(p)]
                low, high = band[axis, k]
                if low < high:
                    assert (low <= c <= high) == all(reached)
                else:  # two ends disagree: no c pleases both
                    assert not all(reached)


def test_where_ends_disagree_the_band_is_the_point_between_them() -> None:
    references = np.array([[[0.5, 0.0, 0.0]], [[-0.3, 0.0, 0.0]]])  # the bounds 0.4 and -0.1 cross
    band = horizontal_band(references, np.array([[0.1, 0.2], [0.2, 0.3]]), NO_FOOT, NO_FOOT)
    assert_allclose(band[0, 0], 0.15)
    assert_allclose(band[1, 0], [-0.2, 0.2])


def test_without_ends_nothing_binds() -> None:
    band = horizontal_band(np.full((2, N, 3), np.nan), np.full((2, 2), 0.1), NO_FOOT, NO_FOOT)
    assert np.isneginf(band[:, :, 0]).all()
    assert np.isposinf(band[:, :, 1]).all()


@given(seed=st.integers(0, 2**32 - 1), plane=st.floats(-0.1, 0.3))
def test_height_band_is_where_hands_and_legs_reach(seed: int, plane: float) -> None:
    rng = np.random.default_rng(seed)
    references = ends(rng, count=2, axes=3) + plane + 0.2
    distance = rng.uniform(0.05, 0.3, 2)
    band = height_band(SETTINGS, references, distance, plane)
    for k, (low, high) in enumerate(band):
        for c in plane + rng.uniform(0.0, 0.5, 20):
            legs = SETTINGS.lowest <= c - plane <= SETTINGS.highest
            ends_z = zip(references[:, k, 2], distance, strict=True)
            hands = all(abs(z - c) <= d for z, d in ends_z if np.isfinite(z))
            assert (low <= c <= high) == (legs and hands)
