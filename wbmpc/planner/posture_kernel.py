"""One iteration of a posture in one compiled call; tests/planner/plain_posture.py says the same in numpy."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.frame_terms import frame_rows, rotation_of, turn_to_level
from wbmpc.jit import kernel
from wbmpc.qp.cholesky import factor, substitute
from wbmpc.signals import Vector

SOLE_COST, PALM_COST, ELBOW_COST, HEIGHT_COST, POSTURE_COST = 1e4, 1e3, 3e2, 3.0, 2e-3
ELBOW_CLEARANCE = 0.03  # [m] of an elbow over the tangent plane through its palm: the forearm is as thick as the palm
DAMPING = 1e-2
STEP_LIMIT = 0.3  # [rad, m] largest change of one coordinate per iteration
LONGEST_PULL = 0.1  # [m] of a palm's error in one iteration
SOLE_ROW, PALM_ROW, ELBOW_ROW, COM_ROW, TILT_ROW, ROWS = 0, 12, 18, 20, 23, 25


class Targets(NamedTuple):
    """What a posture is to do; written anew when it changes."""

    soles: Vector  # (2, 3) [m]
    yaws: Vector  # (2,) [rad]
    palms: Vector  # (2, 3) [m]
    normals: Vector  # (2, 3) of the palms' surfaces
    given: NDArray[np.int64]  # (2,) of a palm: 0 nothing, 1 its place, 2 its place and normal
    com: Vector  # (3,) [m]


@kernel
def posture_step(
    pin: Any,
    frames: NDArray[np.int64],
    chains: NDArray[np.int64],
    lengths: NDArray[np.int64],
    targets: Targets,
    com_cost: float,
    tilt_cost: float,
    q: Vector,
    nominal: Vector,
    lower: Vector,
    upper: Vector,
    delta: Vector,
    found: Vector,
) -> None:
    """Write the step `delta` (nv,) of one iteration from `q` (nq,), and what there is at `q`.

    Args:
        pin: Pinocchio's views at q, see `Kinematics`.
        frames, chains, lengths: of soles, palms, elbows and torso, see `chains_of`.
        nominal: (nq,) the posture to deviate from as little as possible.
        lower, upper: (nj,) [rad].
        found: (5,) palm errors [m], largest palm or sole error [m], how far an elbow is too low [m], largest change.
    """
    J, com_jacobian, com, poses = pin
    nv = len(delta)
    rows, wanted, weight = np.zeros((ROWS, nv)), np.zeros(ROWS), np.zeros(ROWS)
    turn = np.empty(3)
    found[:] = 0.0
    for side in range(2):
        first, sole = SOLE_ROW + 6 * side, poses[frames[side], 3]
        frame_rows(J, chains[side], lengths[side], sole, rows[first : first + 6])
        turn_to_level(targets.yaws[side], rotation_of(poses, frames[side]), turn)
        square = 0.0
        for i in range(3):
            wanted[first + i] = targets.soles[side, i] - sole[i]
            wanted[first + 3 + i] = turn[i]
            square += wanted[first + i] ** 2
        weight[first : first + 6] = SOLE_COST
        found[2] = max(found[2], sqrt(square))
    for side in range(2):
        if targets.given[side] == 0:
            continue
        first, palm = PALM_ROW + 3 * side, poses[frames[2 + side], 3]
        frame_rows(J, chains[2 + side], lengths[2 + side], palm, rows[first : first + 3])
        square = 0.0
        for i in range(3):
            wanted[first + i] = targets.palms[side, i] - palm[i]
            square += wanted[first + i] ** 2
        found[side] = sqrt(square)
        found[2] = max(found[2], found[side])
        for i in range(3):
            wanted[first + i] *= min(1.0, LONGEST_PULL / max(found[side], 1e-9))
        weight[first : first + 3] = PALM_COST
        if targets.given[side] == 1:
            continue
        excess, elbow = ELBOW_CLEARANCE, poses[frames[4 + side], 3]
        for i in range(3):
            excess -= targets.normals[side, i] * (elbow[i] - palm[i])
        if excess > 0.0:
            found[3] = max(found[3], excess)
            moved, row = np.zeros((3, nv)), ELBOW_ROW + side
            frame_rows(J, chains[4 + side], lengths[4 + side], elbow, moved)
            for i in range(3):
                for k in range(nv):
                    rows[row, k] += targets.normals[side, i] * (moved[i, k] - rows[first + i, k])
            wanted[row], weight[row] = excess, ELBOW_COST
    for i in range(3):
        rows[COM_ROW + i] = com_jacobian[i]
        wanted[COM_ROW + i] = targets.com[i] - com[i]
        weight[COM_ROW + i] = com_cost if i < 2 else HEIGHT_COST
    if tilt_cost > 0.0:
        torso = rotation_of(poses, frames[6])
        for c in range(lengths[6]):
            k = chains[6, c]
            rows[TILT_ROW, k], rows[TILT_ROW + 1, k] = J[3, k], J[4, k]
        wanted[TILT_ROW], wanted[TILT_ROW + 1] = torso[1, 2], -torso[0, 2]  # own vertical × up
        weight[TILT_ROW], weight[TILT_ROW + 1] = tilt_cost, tilt_cost
    H = np.zeros((nv, nv))
    delta[:] = 0.0
    for row in range(ROWS):
        if weight[row] == 0.0:
            continue
        for i in range(nv):
            scaled = weight[row] * rows[row, i]
            if scaled == 0.0:
                continue
            delta[i] += scaled * wanted[row]
            for k in range(i, nv):
                H[i, k] += scaled * rows[row, k]
    for i in range(nv):
        H[i, i] += DAMPING
        if i >= 6:
            H[i, i] += POSTURE_COST
            delta[i] += POSTURE_COST * (nominal[1 + i] - q[1 + i])
    _solve_within(H, delta, q, lower, upper)
    for i in range(nv):
        delta[i] = min(max(delta[i], -STEP_LIMIT), STEP_LIMIT)
        found[4] = max(found[4], abs(delta[i]))


@kernel
def _solve_within(H: Vector, delta: Vector, q: Vector, lower: Vector, upper: Vector) -> None:
    """Replace the gradient in `delta` by the step; joints that would leave their range are fixed at it, once.

    The upper triangle of `H` is given.
    """
    nv = len(delta)
    U, gradient = H.copy(), delta.copy()
    if not factor(U, nv):
        delta[:] = np.nan
        return
    substitute(U, delta, nv)
    free, count = np.empty(nv, np.int64), 0
    for i in range(nv):
        if i >= 6 and (q[1 + i] + delta[i] < lower[i - 6] or q[1 + i] + delta[i] > upper[i - 6]):
            delta[i] = min(max(q[1 + i] + delta[i], lower[i - 6]), upper[i - 6]) - q[1 + i]
        else:
            free[count] = i
            count += 1
    if count == nv:
        return
    rest = np.empty(count)
    for a in range(count):
        rest[a] = gradient[free[a]]
        for b in range(a, count):
            U[a, b] = H[free[a], free[b]]
    for i in range(nv):
        taken = True
        for a in range(count):
            if free[a] == i:
                taken = False
        if taken:
            for a in range(count):
                rest[a] -= (H[free[a], i] if free[a] < i else H[i, free[a]]) * delta[i]
    factor(U, count)
    substitute(U, rest, count)
    for a in range(count):
        delta[free[a]] = rest[a]
