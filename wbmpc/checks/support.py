"""Geometry of the support: how far the CoM's ground projection is outside the soles that touch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks.context import CheckContext
from wbmpc.signals import Vector


def com_outside(context: CheckContext, soles: NDArray[np.bool_]) -> Vector:
    """Distance of the CoM's ground projection outside the hull of the chosen soles, at `context.sample_ticks`.

    The hull is that of the true sole corners: the planner's polygon is not trusted.

    Args:
        soles: (m, 2) which soles belong to the support.

    Returns:
        (m,) [m], positive outside, negative inside; -inf where no sole is chosen.
    """
    com = context.recorder.com[context.sample_ticks, :2]
    outside = np.full(len(soles), -np.inf)
    for k in np.flatnonzero(soles.any(axis=1)):
        outside[k] = distance_outside(com[k], context.sole_corners[k, soles[k], :, :2].reshape(-1, 2))
    return outside


def distance_outside(point: Vector, vertices: Vector) -> float:
    """Distance [m] of `point` (2,) from the convex hull of `vertices` (k, 2): positive outside, negative inside."""
    from scipy.spatial import ConvexHull  # scipy: 25 MB that many runs do without

    hull = ConvexHull(vertices)
    corners = vertices[hull.vertices]  # counter-clockwise
    edge = np.roll(corners, -1, axis=0) - corners
    along = np.clip(np.einsum("ij,ij->i", point - corners, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
    distance = np.linalg.norm(corners + along[:, None] * edge - point, axis=1).min()
    inside = (hull.equations[:, :2] @ point + hull.equations[:, 2] <= 0.0).all()
    return float(-distance if inside else distance)
