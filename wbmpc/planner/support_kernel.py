"""The support polygons of a whole horizon in one compiled call; `Interval.polygon` says the same in plain numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.support import CELLS, MAX_EDGES, is_corner
from wbmpc.signals import Vector

MAX_POINTS = 16  # corners of w_L P_L ⊕ w_R P_R


@kernel
def horizon_polygons(
    which: NDArray[np.int64],
    times: Vector,
    insets: Vector,
    ends: Vector,
    positions: Vector,
    yaws: Vector,
    swings: NDArray[np.int64],
    moved: NDArray[np.int64],
    transfers: Vector,
    half_extents: Vector,
    plane: float,
    com: Vector,
    footsteps: int,
) -> tuple[NDArray[np.int64], Vector, Vector, Vector, Vector, Vector, Vector]:
    """Polygons of K knots, each in one of I intervals, and how they move with the footsteps.

    Args:
        which: (K,) the interval of each knot.
        times: (K,) [s from now].
        insets: (K,) [m].
        ends: (I,) [s from now].
        positions, yaws: of both soles, (I, 2, 3) [m] and (I, 2) [rad].
        swings: (I,) side of the foot in the air, -1: none.
        moved: (I, 2) number of the footstep that each foot stands on, -1: it stands there already.
        transfers: (I, 5) begin [s from now], shares of left and right before, and after; begin nan: no transfer.
        half_extents: (2,) of a sole [m].
        plane: height [m] of the plane that all soles are seen on from the CoM; nan: each seen from above.
        com: (K, 3) where the CoM will be [m]; without a plane not looked at.
        footsteps: how many may be moved.

    Returns:
        Numbers of edges (K,), vertices (K, MAX_EDGES, 2), normals (K, MAX_EDGES, 2), offsets (K, MAX_EDGES),
        centres (K, 2) and heights of the planes (K,), all as in `SupportPolygon`; shares (K, footsteps) of each
        footstep's displacement by which the polygon moves.
    """
    K = len(which)
    counts = np.empty(K, np.int64)
    vertices, normals = np.zeros((K, MAX_EDGES, 2)), np.zeros((K, MAX_EDGES, 2))
    offsets, centres, planes = np.full((K, MAX_EDGES), np.inf), np.zeros((K, 2)), np.empty(K)
    shares, weights = np.zeros((K, footsteps)), np.empty(2)
    corners, points, hull = np.empty((2, 4, 2)), np.empty((MAX_POINTS, 2)), np.empty((2 * MAX_POINTS, 2))
    for k in range(K):
        i = which[k]
        for side in range(2):
            c, s = np.cos(yaws[i, side]), np.sin(yaws[i, side])
            for j in range(4):
                x = half_extents[0] if j == 0 or j == 3 else -half_extents[0]
                y = half_extents[1] if j < 2 else -half_extents[1]
                corners[side, j, 0] = positions[i, side, 0] + (x * c - y * s)
                corners[side, j, 1] = positions[i, side, 1] + (x * s + y * c)
                if not np.isnan(plane):
                    scale = (com[k, 2] - plane) / (com[k, 2] - positions[i, side, 2])
                    for axis in range(2):
                        corners[side, j, axis] = com[k, axis] + (corners[side, j, axis] - com[k, axis]) * scale
        n = 0
        if np.isnan(transfers[i, 0]):
            for side in range(2):
                weights[side] = 0.0 if side == swings[i] else (0.5 if swings[i] < 0 else 1.0)
                if side != swings[i]:
                    points[n : n + 4] = corners[side]
                    n += 4
        else:
            begin = transfers[i, 0]
            share = min(max((times[k] - begin) / max(ends[i] - begin, 1e-6), 0.0), 1.0)
            for side in range(2):
                weights[side] = transfers[i, 1 + side] + share * (transfers[i, 3 + side] - transfers[i, 1 + side])
            for j in range(4):
                for i_right in range(4):
                    points[n] = weights[0] * corners[0, j] + weights[1] * corners[1, i_right]
                    n += 1
        for side in range(2):
            if side != swings[i] and moved[i, side] >= 0:
                shares[k, moved[i, side]] += weights[side]
        if not np.isnan(plane):
            planes[k] = plane
        elif swings[i] < 0:
            planes[k] = 0.5 * (positions[i, 0, 2] + positions[i, 1, 2])
        else:
            planes[k] = positions[i, 1 - swings[i], 2]
        count = counts[k] = hull_of(points, n, hull)
        if count > MAX_EDGES:
            raise ValueError("a support polygon has more than MAX_EDGES edges")
        for e in range(count):
            ahead = hull[e + 1 if e + 1 < count else 0]
            nx, ny = ahead[1] - hull[e, 1], hull[e, 0] - ahead[0]
            length = np.sqrt(nx * nx + ny * ny)
            vertices[k, e] = hull[e]
            normals[k, e, 0], normals[k, e, 1] = nx / length, ny / length
            offsets[k, e] = normals[k, e, 0] * hull[e, 0] + normals[k, e, 1] * hull[e, 1] - insets[k]
            centres[k] += hull[e]
        centres[k] /= count
    return counts, vertices, normals, offsets, centres, planes, shares


@kernel
def hull_of(points: Vector, n: int, hull: Vector) -> int:
    """Number of vertices, written into `hull`, of the first `n` points, which get sorted: see `convex_hull`."""
    for i in range(1, n):  # sixteen points at most: by insertion
        x, y = points[i, 0], points[i, 1]
        key, minor = np.rint(CELLS * x), np.rint(CELLS * y)
        j = i
        while j > 0:
            ahead = np.rint(CELLS * points[j - 1, 0]) - key
            if ahead < 0.0 or (ahead == 0.0 and np.rint(CELLS * points[j - 1, 1]) <= minor):
                break
            points[j] = points[j - 1]
            j -= 1
        points[j, 0], points[j, 1] = x, y
    count, floor = 0, 0  # the lower chain, and from `floor` on the upper one
    for step in range(2 * n):
        if step == n:
            count -= 1  # the last point of the lower chain is the first of the upper one
            floor = count
        p = points[step if step < n else 2 * n - 1 - step]
        while count >= floor + 2 and not is_corner(hull[count - 2], hull[count - 1], p):
            count -= 1
        hull[count] = p
        count += 1
    return count - 1
