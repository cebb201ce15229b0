"""The support polygon of the stance feet and its half-planes, which bound the ZMP."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbmpc.jit import kernel
from wbmpc.signals import Vector

PROJECTIONS = 20
CELLS = 1e7  # [1/m] the hull is found among points on a grid of 0.1 µm, on which its sums are exact
COLLINEAR = 1e-7 * CELLS**2  # twice the area of three points on one line: a bump of a few cells on the longest side
UNEVEN = 0.005  # [m] smaller differences of two soles' heights are the estimate's
MAX_EDGES = 8  # two rectangles have a hull of at most eight edges


def foot_corners(*, position: Vector, yaw: float, half_extents: Vector) -> Vector:
    """Corners (4, 2) [m] of a sole in world, counter-clockwise.

    Args:
        position: (3,) or (2,) sole centre in world [m].
        yaw: heading of the sole [rad].
        half_extents: (2,) half length and half width [m].
    """
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)
    c, s = np.cos(yaw), np.sin(yaw)
    return position[:2] + (signs * half_extents) @ np.array([[c, s], [-s, c]])


def convex_hull(points: Vector) -> Vector:
    """Convex hull (k, 2) of points (n, 2), counter-clockwise, collinear points dropped (monotone chain)."""
    cells = np.rint(CELLS * points)
    order = points[np.lexsort((cells[:, 1], cells[:, 0]))]

    def chain(sequence: Vector) -> list[Vector]:
        hull: list[Vector] = []
        for p in sequence:
            while len(hull) >= 2 and not is_corner(hull[-2], hull[-1], p):
                hull.pop()
            hull.append(p)
        return hull

    lower, upper = chain(order), chain(order[::-1])
    return np.array(lower[:-1] + upper[:-1])


@kernel
def is_corner(a: Vector, b: Vector, p: Vector) -> bool:
    """Whether the way a → b → p (2,) turns left at b, for good or because it goes back; decided on the grid.

    Rounding may neither change a turn's sign, which the grid rules out, nor may a side that is all but along y lose its
    end: where the turn is small, b is left out only when it lies between the others.
    """
    bx, by = np.rint(CELLS * b[0]), np.rint(CELLS * b[1])
    ux, uy = bx - np.rint(CELLS * a[0]), by - np.rint(CELLS * a[1])
    vx, vy = np.rint(CELLS * p[0]) - bx, np.rint(CELLS * p[1]) - by
    turn = ux * vy - uy * vx
    return turn > COLLINEAR or (turn > 0.0 and ux * vx + uy * vy < 0.0)


class SupportPolygon(NamedTuple):
    """Half-planes `normals @ z <= offsets` of a convex polygon, padded to MAX_EDGES rows.

    A padded row is 0 <= inf, so that a QP keeps its shape while the polygon changes.
    """

    vertices: Vector  # (k, 2) [m] counter-clockwise, margin not subtracted
    normals: Vector  # (MAX_EDGES, 2) outward unit normals
    offsets: Vector  # (MAX_EDGES,) [m] margin subtracted
    centre: Vector  # (2,) [m] mean of the vertices
    plane_height: float  # [m] of the ZMP plane in world

    @classmethod
    def of_corners(cls, corners: Vector, *, margin: float, plane_height: float) -> SupportPolygon:
        """Polygon of corner points (n, 2) [m], shrunk by `margin` [m] towards the inside."""
        vertices = convex_hull(corners)
        edges = np.roll(vertices, -1, axis=0) - vertices
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        offsets = np.einsum("ij,ij->i", normals, vertices) - margin
        pad = MAX_EDGES - len(vertices)
        if pad < 0:
            raise ValueError(f"a support polygon has at most {MAX_EDGES} edges, received {len(vertices)}")
        return cls(
            vertices=vertices,
            normals=np.vstack([normals, np.zeros((pad, 2))]),
            offsets=np.concatenate([offsets, np.full(pad, np.inf)]),
            centre=vertices.mean(axis=0),
            plane_height=plane_height,
        )

    def shrunk(self, margin: float) -> SupportPolygon:
        """The same polygon with a further inset of `margin` [m]."""
        return self._replace(offsets=self.offsets - margin)

    def nearest(self, point: Vector) -> Vector:
        """The point (2,) of the shrunk polygon nearest to `point` (2,) [m], by Dykstra's alternating projections."""
        return _nearest(self.normals, self.offsets, float(point[0]), float(point[1]))

    def excess(self, point: Vector) -> float:
        """How far `point` (2,) lies outside the shrunk polygon [m]; negative inside (largest edge violation)."""
        return float(np.max(self.normals @ point[:2] - self.offsets))


@kernel
def _nearest(normals: Vector, offsets: Vector, x: float, y: float) -> Vector:
    z, correction = np.array([x, y]), np.zeros_like(normals)
    for _ in range(PROJECTIONS):
        for i in range(len(offsets)):
            bx, by = z[0] + correction[i, 0], z[1] + correction[i, 1]
            beyond = max(normals[i, 0] * bx + normals[i, 1] * by - offsets[i], 0.0)
            z[0], z[1] = bx - beyond * normals[i, 0], by - beyond * normals[i, 1]
            correction[i, 0], correction[i, 1] = bx - z[0], by - z[1]
    return z
