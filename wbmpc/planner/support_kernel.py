"""The support polygons of a whole horizon in one compiled call; `Interval.polygon` says the same in plain numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.support import CELLS, MAX_EDGES, is_corner
from wbmpc.signals import Vector

MAX_POINTS = 16  # corners of w_L P_L ⊕ w_R P_R


@kernel
def place_knots(
    times: Vector, phases: Vector, positions: Vector, yaws: Vector, plane: float, tolerance: float
) -> tuple[NDArray[np.int64], Vector, bool]:
    """Interval (N + 1,) of each knot, the last one that of the rest after the horizon, where both feet stand;
    headings (N,) [rad]; whether any sole is further than `tolerance` [m] from `plane` [m].

    See `horizon_polygons` for the arguments.
    """
    n, last = len(times), len(phases) - 1
    which, headings, uneven = np.empty(n + 1, np.int64), np.empty(n), False
    i = 0
    for k in range(n):
        while i < last and phases[i, 0] + 1e-9 < times[k]:  # a knot at an end is before it
            i += 1
        which[k] = i
        headings[k] = 0.5 * (yaws[i, 0] + yaws[i, 1])
    which[n] = i if phases[i, 1] < 0.0 else min(i + 1, last)
    for i in range(last + 1):
        for side in range(2):
            uneven |= abs(positions[i, side, 2] - plane) > tolerance
    return which, headings, uneven


@kernel
def horizon_polygons(
    which: NDArray[np.int64],
    times: Vector,
    margin: float,
    growth: float,
    phases: Vector,
    positions: Vector,
    yaws: Vector,
    half_extents: Vector,
    plane: float,
    com: Vector,
    footsteps: int,
) -> tuple[NDArray[np.int64], Vector, Vector, Vector, Vector, Vector, Vector, Vector, Vector]:
    """Polygons of N knots, each in one of I intervals, and of the rest after the last, and how they move with the
    footsteps; K = N + 1.

    Args:
        which: (K,) the interval of each, see `place_knots`.
        times: (N,) [s from now].
        margin: inset of the polygons [m], growing by `growth` [m/s].
        phases: (I, 9) end [s from now]; side of the foot in the air, -1: none; number of the footstep that each foot
            stands on, -1: it stands there already; begin of the transfer [s from now], shares of left and right
            before, and after; begin nan: no transfer.
        positions, yaws: of both soles, (I, 2, 3) [m] and (I, 2) [rad].
        half_extents: (2,) of a sole [m].
        plane: height [m] of the plane that all soles are seen on from the CoM; nan: each seen from above.
        com: (N, 3) where the CoM will be [m]; without a plane not looked at.
        footsteps: how many may be moved.

    Returns:
        Numbers of edges (K,), vertices (K, MAX_EDGES, 2), normals (K, MAX_EDGES, 2), offsets (K, MAX_EDGES),
        centres (K, 2) and heights of the planes (K,), all as in `SupportPolygon`; shares (K, footsteps) of each
        footstep's displacement by which the polygon moves; whether (N,) one foot carries, or will in a moment; places
        (N, 2) between the feet [m].
    """
    N, K = len(times), len(times) + 1
    counts = np.empty(K, np.int64)
    vertices, normals = np.zeros((K, MAX_EDGES, 2)), np.zeros((K, MAX_EDGES, 2))
    offsets, centres, planes = np.full((K, MAX_EDGES), np.inf), np.zeros((K, 2)), np.empty(K)
    shares, weights = np.zeros((K, footsteps)), np.empty(2)
    centring, between = np.zeros(N), np.empty((N, 2))
    corners, points, hull = np.empty((2, 4, 2)), np.empty((MAX_POINTS, 2)), np.empty((2 * MAX_POINTS, 2))
    for k in range(K):
        i, t = which[k], min(k, N - 1)
        resting = k == N
        end, begin, swing = phases[i, 0], np.nan if resting else phases[i, 4], -1 if resting else int(phases[i, 1])
        if not resting:
            centring[k] = 1.0 if swing >= 0 or not np.isnan(begin) else 0.0
            for axis in range(2):
                between[k, axis] = 0.5 * (positions[i, 0, axis] + positions[i, 1, axis])
        for side in range(2):
            c, s = np.cos(yaws[i, side]), np.sin(yaws[i, side])
            for j in range(4):
                x = half_extents[0] if j == 0 or j == 3 else -half_extents[0]
                y = half_extents[1] if j < 2 else -half_extents[1]
                corners[side, j, 0] = positions[i, side, 0] + (x * c - y * s)
                corners[side, j, 1] = positions[i, side, 1] + (x * s + y * c)
                if not np.isnan(plane):
                    scale = (com[t, 2] - plane) / (com[t, 2] - positions[i, side, 2])
                    for axis in range(2):
                        corners[side, j, axis] = com[t, axis] + (corners[side, j, axis] - com[t, axis]) * scale
        n = 0
        if np.isnan(begin):
            for side in range(2):
                weights[side] = 0.0 if side == swing else (0.5 if swing < 0 else 1.0)
                if side != swing:
                    points[n : n + 4] = corners[side]
                    n += 4
        else:
            share = min(max((times[t] - begin) / max(end - begin, 1e-6), 0.0), 1.0)
            for side in range(2):
                weights[side] = phases[i, 5 + side] + share * (phases[i, 7 + side] - phases[i, 5 + side])
            for j in range(4):
                for i_right in range(4):
                    points[n] = weights[0] * corners[0, j] + weights[1] * corners[1, i_right]
                    n += 1
        for side in range(2):
            footstep = int(phases[i, 2 + side])
            if side != swing and footstep >= 0:
                shares[k, footstep] += weights[side]
        if not np.isnan(plane):
            planes[k] = plane
        elif swing < 0:
            planes[k] = 0.5 * (positions[i, 0, 2] + positions[i, 1, 2])
        else:
            planes[k] = positions[i, 1 - swing, 2]
        inset = margin + growth * times[t]
        count = counts[k] = hull_of(points, n, hull)
        if count > MAX_EDGES:
            raise ValueError("a support polygon has more than MAX_EDGES edges")
        for e in range(count):
            ahead = hull[e + 1 if e + 1 < count else 0]
            nx, ny = ahead[1] - hull[e, 1], hull[e, 0] - ahead[0]
            length = np.sqrt(nx * nx + ny * ny)
            vertices[k, e] = hull[e]
            normals[k, e, 0], normals[k, e, 1] = nx / length, ny / length
            offsets[k, e] = normals[k, e, 0] * hull[e, 0] + normals[k, e, 1] * hull[e, 1] - inset
            centres[k] += hull[e]
        centres[k] /= count
    return counts, vertices, normals, offsets, centres, planes, shares, centring, between


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
