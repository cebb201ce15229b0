"""The support polygon against SciPy's hull and brute-force distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull, QhullError

from wbmpc.planner.support import MAX_EDGES, SupportPolygon, convex_hull, foot_corners
from wbmpc.planner.support_kernel import hull_of
from wbmpc.signals import Vector

HALF = np.array([0.06, 0.035])
millimetres = st.integers(-300, 300).map(lambda k: k / 1000)  # a grid, so that collinear and equal points do occur


def area(polygon: Vector) -> float:
    """Signed area, positive counter-clockwise (shoelace)."""
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@given(points=st.integers(3, 12).flatmap(lambda n: arrays(float, (n, 2), elements=millimetres)))
def test_hull_is_scipys(points: Vector) -> None:
    try:
        expected = ConvexHull(points)
    except QhullError:
        assume(False)  # all on one line
    assume(expected.volume > 1e-5)
    hull = convex_hull(points)
    assert area(hull) == pytest.approx(expected.volume, abs=1e-12)  # Qhull's volume of a plane hull is its area
    corners = {tuple(p) for p in points[expected.vertices]}
    assert {tuple(p) for p in hull} <= corners
    # ours has corners only: the turn at every vertex is strictly to the left
    ahead, behind = np.roll(hull, -1, axis=0) - hull, hull - np.roll(hull, 1, axis=0)
    assert (behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0] > 0).all()


@given(
    yaw=st.floats(-13, -6).map(lambda e: 10.0**e),
    other=st.floats(-13, -6).map(lambda e: -(10.0**e)),
    x=st.floats(-0.3, 0.3),
    ahead=st.sampled_from([0.0, 1e-10, 1e-8, 0.07]),
)
def test_sides_that_are_straight_but_for_rounding_lose_no_corner(
    yaw: float, other: float, x: float, ahead: float
) -> None:
    feet = [(np.array([x, 0.06]), yaw), (np.array([x + ahead, -0.06]), other)]
    points = np.vstack([foot_corners(position=p, yaw=angle, half_extents=HALF) for p, angle in feet])
    hull = convex_hull(points)
    for angle in 2 * np.pi * np.arange(16) / 16:
        u = np.array([np.cos(angle), np.sin(angle)])
        assert (hull @ u).max() == pytest.approx((points @ u).max(), abs=1e-6)
    assert len(hull) <= MAX_EDGES
    room = np.empty((16, 2))
    assert_allclose(room[: hull_of(points.copy(), 8, room)], hull)


@given(x=millimetres, y=millimetres, yaw=st.floats(-7, 7))
def test_foot_corners_are_the_rotated_rectangle(x: float, y: float, yaw: float) -> None:
    corners = foot_corners(position=np.array([x, y, 0.0]), yaw=yaw, half_extents=HALF)
    turned = (corners[:, 0] + 1j * corners[:, 1] - (x + 1j * y)) * np.exp(-1j * yaw)  # back into the foot's own axes
    assert_allclose(np.abs(turned.real), HALF[0], atol=1e-12)
    assert_allclose(np.abs(turned.imag), HALF[1], atol=1e-12)
    assert area(corners) == pytest.approx(4 * HALF.prod())  # counter-clockwise, all four


def two_feet(yaw: float, shift: float) -> SupportPolygon:
    left = foot_corners(position=np.array([0.0, 0.06]), yaw=yaw, half_extents=HALF)
    right = foot_corners(position=np.array([shift, -0.06]), yaw=-yaw / 2, half_extents=HALF)
    return SupportPolygon.of_corners(np.vstack([left, right]), margin=0.01, plane_height=0.0)


@given(yaw=st.floats(-1.0, 1.0), shift=st.floats(-0.1, 0.1), x=millimetres, y=millimetres)
def test_excess_is_the_largest_signed_edge_distance(yaw: float, shift: float, x: float, y: float) -> None:
    polygon, point = two_feet(yaw, shift), np.array([x, y])
    distances = []
    for start, end in zip(polygon.vertices, np.roll(polygon.vertices, -1, axis=0), strict=True):
        edge = end - start
        side = edge[0] * (point - start)[1] - edge[1] * (point - start)[0]  # positive: to the left, inside
        distances.append(-side / np.hypot(*edge))
    assert polygon.excess(point) == pytest.approx(max(distances) + 0.01, abs=1e-12)


@given(yaw=st.floats(-1.0, 1.0), shift=st.floats(-0.1, 0.1), margin=st.floats(0.0, 0.02), x=millimetres, y=millimetres)
def test_shrunk_moves_every_edge_inwards(yaw: float, shift: float, margin: float, x: float, y: float) -> None:
    polygon, point = two_feet(yaw, shift), np.array([x, y])
    assert polygon.shrunk(margin).excess(point) == pytest.approx(polygon.excess(point) + margin, abs=1e-12)
    assert_allclose(polygon.shrunk(margin).vertices, polygon.vertices)


@given(yaw=st.floats(-1.0, 1.0), shift=st.floats(-0.1, 0.1), x=millimetres, y=millimetres)
def test_nearest_is_the_nearest_point_of_the_shrunk_edges(yaw: float, shift: float, x: float, y: float) -> None:
    polygon, point = two_feet(yaw, shift), np.array([x, y])
    nearest = polygon.nearest(point)
    if polygon.excess(point) <= 0.0:
        assert_allclose(nearest, point, atol=1e-12)
        return
    edges = np.isfinite(polygon.offsets)
    normals, offsets = polygon.normals[edges], polygon.offsets[edges]
    ends = [np.linalg.solve(normals[[k - 1, k]], offsets[[k - 1, k]]) for k in range(len(offsets))]
    distances = []
    for start, end in zip(ends, [*ends[1:], ends[0]], strict=True):
        along = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        distances.append(np.linalg.norm(start + along * (end - start) - point))
    assert np.linalg.norm(nearest - point) == pytest.approx(min(distances), abs=2e-3)  # Dykstra's method stops early
    assert polygon.excess(nearest) < 1e-3


def test_padding_binds_nothing() -> None:
    polygon = SupportPolygon.of_corners(
        foot_corners(position=np.zeros(2), yaw=0.0, half_extents=HALF), margin=0.0, plane_height=0.0
    )
    assert polygon.normals.shape == (MAX_EDGES, 2)
    assert np.isposinf(polygon.offsets[4:]).all()
    assert not polygon.normals[4:].any()


def test_too_many_edges_are_refused() -> None:
    angle = np.linspace(0, 2 * np.pi, 11)[:-1]
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    with pytest.raises(ValueError, match="received 10"):
        SupportPolygon.of_corners(circle, margin=0.0, plane_height=0.0)
