"""The compiled support over the horizon against plain numpy, interval by interval."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footstep import Feet
from wbmpc.planner.footstep_bounds import FootstepBounds
from wbmpc.planner.support_horizon import NEVER, SupportHorizon
from wbmpc.planner.support_interval import Interval, Transfer
from wbmpc.planner.support_preview import MAX_FOOTSTEPS
from wbmpc.signals import Vector

TIMES = 0.1 * np.arange(1, 17)  # [s]
HALF = np.array([0.06, 0.035])  # [m]
MARGIN, GROWTH = 0.01, 0.005  # [m], [m/s]
M = MAX_FOOTSTEPS
NO_BOUNDS = FootstepBounds(*(np.zeros((M, 2)), np.zeros((M, 2, 2)), *(np.zeros((M, 2)) for _ in range(4))))


def random_intervals(rng: np.random.Generator, *, level: bool) -> list[Interval]:
    """Stand, swing, stand on, with load that goes over or not: any order of them will do."""
    intervals, end = [], 0.0
    for _ in range(rng.integers(1, 7)):
        positions = np.column_stack(
            [rng.uniform(-0.2, 0.2, 2), np.array([0.06, -0.06]) + rng.uniform(-0.03, 0.03, 2), np.zeros(2)]
        )
        if not level:
            positions[:, 2] = rng.uniform(0.0, 0.1, 2)
        begin, end = end, end + rng.uniform(0.02, 0.6)
        transfer = None
        swing = int(rng.integers(-1, 2))
        if swing < 0 and rng.integers(2):
            shares = rng.dirichlet((1.0, 1.0), 2)
            transfer = Transfer(begin, tuple(shares[0]), tuple(shares[1]))
        moved = tuple(int(m) for m in rng.choice([-1, 0, 1, 2, 3], 2, replace=False))
        intervals.append(Interval(end, Feet(positions, rng.uniform(-0.5, 0.5, 2), 0), swing, moved, transfer))
    intervals.append(Interval(NEVER, intervals[-1].feet, -1, (0, 1)))
    return intervals


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), level=st.booleans())
def test_every_knot_has_its_intervals_polygon(seed: int, level: bool) -> None:
    rng = np.random.default_rng(seed)
    intervals = random_intervals(rng, level=level)
    com = np.column_stack([rng.uniform(-0.2, 0.2, (16, 2)), rng.uniform(0.25, 0.4, 16)])
    horizon = SupportHorizon(intervals, TIMES, standing=[0.0])
    assert (horizon.plane is None) == level
    preview = horizon.preview(
        half_extents=HALF, margin=MARGIN, growth=GROWTH, com=com, com_velocity=np.zeros((16, 2)), bounds=NO_BOUNDS
    )
    for k, t in enumerate(TIMES):
        interval = next(i for i in intervals if t <= i.end + 1e-9)
        onto = None if level else (0.0, com[k])
        expected = interval.polygon(float(t), half_extents=HALF, margin=MARGIN + GROWTH * t, onto=onto)
        polygon = preview.polygons[k]
        for name in ("vertices", "normals", "offsets", "centre"):
            assert_allclose(getattr(polygon, name), getattr(expected, name), atol=1e-12)
        assert polygon.plane_height == pytest.approx(expected.plane_height, abs=1e-12)
        assert_allclose(preview.normals[k], expected.normals, atol=1e-12)
        assert_allclose(preview.offsets[k], expected.offsets, atol=1e-12)
        assert_allclose(preview.shift[k], interval.shares(float(t), M), atol=1e-12)
        assert preview.centring[k] == float(interval.transfer is not None or interval.swing >= 0)
        assert_allclose(preview.com_reference[k], interval.feet.positions[:, :2].mean(axis=0), atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1))
def test_at_rest_both_feet_of_the_end_carry(seed: int) -> None:
    rng = np.random.default_rng(seed)
    intervals = random_intervals(rng, level=True)
    preview = SupportHorizon(intervals, TIMES, standing=[0.0]).preview(
        half_extents=HALF,
        margin=MARGIN,
        growth=GROWTH,
        com=np.zeros((16, 3)),
        com_velocity=np.zeros((16, 2)),
        bounds=NO_BOUNDS,
    )
    at = next(j for j, i in enumerate(intervals) if i.end + 1e-9 >= TIMES[-1])
    feet: Feet = intervals[at if intervals[at].swing < 0 else at + 1].feet
    expected = Interval(NEVER, feet, -1, (-1, -1)).polygon(0.0, half_extents=HALF, margin=MARGIN + GROWTH * TIMES[-1])
    assert_allclose(preview.rest_normals, expected.normals, atol=1e-12)
    assert_allclose(preview.rest_offsets, expected.offsets, atol=1e-12)


def test_a_knot_at_the_end_of_an_interval_is_still_in_it() -> None:
    feet = [Feet(np.array([[x, 0.06, 0.0], [x, -0.06, 0.0]]), np.zeros(2), -1) for x in (0.0, 0.1)]
    intervals = [Interval(0.1, feet[0], -1, (-1, -1)), Interval(NEVER, feet[1], -1, (-1, -1))]
    headings: Vector = SupportHorizon(intervals, TIMES, standing=[0.0]).headings
    assert headings.shape == TIMES.shape
    preview = SupportHorizon(intervals, TIMES, standing=[0.0]).preview(
        half_extents=HALF,
        margin=0.0,
        growth=0.0,
        com=np.zeros((16, 3)),
        com_velocity=np.zeros((16, 2)),
        bounds=NO_BOUNDS,
    )
    assert_allclose(preview.com_reference[:2, 0], [0.0, 0.1])
