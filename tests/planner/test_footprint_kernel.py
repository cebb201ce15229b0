"""The footholds' compiled loops against the same in plain numpy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footprint_kernel import is_inside, swept, things_under
from wbmpc.planner.support import convex_hull, foot_corners
from wbmpc.signals import Vector

HALF = np.array([0.07, 0.035])


def box(rng: np.random.Generator) -> Vector:
    return foot_corners(
        position=rng.uniform(-0.2, 0.2, 2), yaw=rng.uniform(-3.0, 3.0), half_extents=rng.uniform(0.01, 0.2, 2)
    )


def beyond(inner: Vector, outer: Vector) -> Vector:
    """How far each point (n, 2) is outside each edge of a convex polygon (k, 2): (k, n), not normalised."""
    edges = np.roll(outer, -1, axis=0) - outer
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    return normals @ inner.T - np.sum(normals * outer, axis=1)[:, None]


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_outlines_and_overlaps_are_those_of_the_plain_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end, yaw = rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.2, 0.2, 2), rng.uniform(-3.0, 3.0)
    outline = swept(start, end, yaw, HALF, 0.01)
    ends = ((start, HALF), (end, HALF + 0.01))
    corners = [foot_corners(position=place, yaw=yaw, half_extents=half) for place, half in ends]
    assert_allclose(outline, convex_hull(np.vstack(corners)), atol=1e-12)
    things = np.array([box(rng) for _ in range(5)])
    apart = [
        (beyond(outline, t) >= 0.0).all(axis=1).any() or (beyond(t, outline) >= 0.0).all(axis=1).any() for t in things
    ]
    assert things_under(outline, things).tolist() == np.flatnonzero(~np.array(apart)).tolist()
    assert is_inside(corners[0], things[0]) == (beyond(corners[0], things[0]) <= 1e-9).all()
