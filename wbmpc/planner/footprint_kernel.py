"""Soles and what lies under them, seen from above, in compiled loops: a search asks thousands of times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.support_kernel import hull_of
from wbmpc.signals import Vector


@kernel
def swept(start: Vector, end: Vector, yaw: float, half: Vector, margin: float) -> Vector:
    """Outline (k, 2) [m] of a sole's straight way between `start` and `end` (2,), with a `margin` [m] at its end."""
    points, hull = np.empty((8, 2)), np.empty((16, 2))
    c, s = np.cos(yaw), np.sin(yaw)
    for i in range(8):
        place, wider, j = (start, 0.0, i) if i < 4 else (end, margin, i - 4)
        x = half[0] + wider if j == 0 or j == 3 else -half[0] - wider
        y = half[1] + wider if j < 2 else -half[1] - wider
        points[i, 0], points[i, 1] = place[0] + (x * c - y * s), place[1] + (x * s + y * c)
    return hull[: hull_of(points, 8, hull)].copy()


@kernel
def things_under(polygon: Vector, corners: Vector) -> NDArray[np.int64]:
    """Which of n footprints (n, 4, 2) overlap a convex `polygon` (k, 2); all counter-clockwise."""
    found, count = np.empty(len(corners), np.int64), 0
    for i in range(len(corners)):
        if _not_apart(polygon, corners[i]) and _not_apart(corners[i], polygon):
            found[count] = i
            count += 1
    return found[:count]


@kernel
def _not_apart(a: Vector, b: Vector) -> bool:
    """Whether no edge of the convex polygon a (k, 2), counter-clockwise, has all of b (m, 2) beyond it."""
    for i in range(len(a)):
        ahead = i + 1 if i + 1 < len(a) else 0
        nx, ny = a[ahead, 1] - a[i, 1], a[i, 0] - a[ahead, 0]
        farthest, nearest = -np.inf, np.inf
        for j in range(len(a)):
            farthest = max(farthest, a[j, 0] * nx + a[j, 1] * ny)
        for j in range(len(b)):
            nearest = min(nearest, b[j, 0] * nx + b[j, 1] * ny)
        if farthest <= nearest:
            return False
    return True


@kernel
def is_inside(inner: Vector, outer: Vector) -> bool:
    """Whether all points (n, 2) are in a convex polygon (k, 2), counter-clockwise."""
    for i in range(len(outer)):
        ahead = i + 1 if i + 1 < len(outer) else 0
        nx, ny = outer[ahead, 1] - outer[i, 1], outer[i, 0] - outer[ahead, 0]
        for j in range(len(inner)):
            if inner[j, 0] * nx + inner[j, 1] * ny > outer[i, 0] * nx + outer[i, 1] * ny + 1e-9:
                return False
    return True
