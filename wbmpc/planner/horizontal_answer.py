"""What the solution of the horizontal CoM motion's QP says, in compiled loops."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel, short_kernel
from wbmpc.planner.horizontal_kernel import End, FreeMotion, HalfPlanes, Matrices, Slots, slots_of
from wbmpc.planner.support import MAX_EDGES
from wbmpc.signals import Vector

WORTH_TOLERANCE = 1e-4  # relative, of a shift's worth above its price: 1e-9 m of the shift
KEPT_WORTH = 0.5  # of the price: shifts worth that may be asked for at the next plan are among its first guess


@kernel
def read_answer(
    x: Vector,
    courses: Vector,
    steps: Vector,
    unmoved: tuple[Vector, ...],
    matrices: tuple[Vector, ...],
    state: Vector,
    a: Vector,
    b: Vector,
    offset: Vector,
    normals: Vector,
    offsets: Vector,
    shift: Vector,
    rest_normals: Vector,
    rest_offsets: Vector,
    rest_shift: Vector,
    ask: bool,
    signs: Vector,
    price: float,
    zmp_cost: float,
    rest_cost: float,
    footsteps: int,
    size: int,
) -> bool:
    """`read_motion` into `courses` and `steps`; with `ask`, also `ask_for_shifts`."""
    n = len(a)
    read_motion(
        *(courses, steps, x, state, Matrices(*matrices), FreeMotion(*unmoved), footsteps, slots_of(signs, size))
    )
    if not ask:
        return False
    edges = HalfPlanes(normals, offsets, shift, rest_normals, rest_offsets, rest_shift)
    return ask_for_shifts(
        *(signs, price, courses, steps, End(a[n - 1], b[n - 1], offset[n - 1]), edges, zmp_cost, rest_cost)
    )


@short_kernel
def read_motion(
    courses: Vector,
    steps: Vector,
    x: Vector,
    state: Vector,
    matrices: Matrices,
    unmoved: FreeMotion,
    footsteps: int,
    slots: Slots,
) -> None:
    """Write jerk, CoM, velocity, acceleration, ΔZ and ZMP of a solution (6, N, 2), and its footsteps (F, 2)."""
    P_pu, P_vu, P_au = matrices.P_pu, matrices.P_vu, matrices.P_au
    free, free_velocity, free_zmp, P_zu = unmoved
    jerk, com, velocity, acceleration, delta_z, zmp = courses
    n = len(free_zmp)
    delta_z[:] = 0.0
    steps[:] = 0.0
    for axis in range(2):
        for f in range(footsteps):
            steps[f, axis] = x[2 * n + axis * footsteps + f]
    for i in range(len(slots.knots)):
        if slots.knots[i] >= 0:
            delta_z[slots.knots[i], slots.axes[i]] = x[2 * n + 2 * footsteps + i]
    for k in range(n):
        for axis in range(2):
            jerk[k, axis] = x[axis * n + k]
            c, v, z = free[axis, k], free_velocity[axis, k], free_zmp[k, axis] + delta_z[k, axis]
            dv = state[axis, 2]
            for j in range(k + 1):
                u = x[axis * n + j]
                c += P_pu[k, j] * u
                v += P_vu[k, j] * u
                dv += P_au[k, j] * u
                z += P_zu[k, j] * u
            com[k, axis], velocity[k, axis], acceleration[k, axis], zmp[k, axis] = c, v, dv, z


@short_kernel
def ask_for_shifts(
    signs: Vector,
    price: float,
    courses: Vector,
    steps: Vector,
    end: End,
    edges: HalfPlanes,
    zmp_cost: float,
    rest_cost: float,
) -> bool:
    """Whether a shift worth more than `price` is no variable yet; `signs` (N, 2), of those that are, gets its own.

    When none is missing, `signs` becomes what to begin the next plan with.
    """
    worth = worth_of_shifts(courses[1], courses[2], courses[4], courses[5], steps, end, edges, zmp_cost, rest_cost)
    missing = False
    for k in range(len(signs)):
        for axis in range(2):
            asks = abs(worth[k, axis]) > (1.0 + WORTH_TOLERANCE) * price
            if asks and signs[k, axis] != -np.sign(worth[k, axis]):
                signs[k, axis], missing = -np.sign(worth[k, axis]), True
    if not missing:
        for k in range(len(signs)):
            for axis in range(2):
                kept = abs(worth[k, axis]) > KEPT_WORTH * price
                signs[k, axis] = -np.sign(worth[k, axis]) if kept else 0.0
    return missing


@short_kernel
def worth_of_shifts(
    com: Vector,
    velocity: Vector,
    delta_z: Vector,
    zmp: Vector,
    steps: Vector,
    end: End,
    edges: HalfPlanes,
    zmp_cost: float,
    rest_cost: float,
) -> Vector:
    """By how much a shift of the ZMP (N, 2) would make the soft rows' cost grow [cost / m].

    The rows are soft with cost ½ w s², so their multipliers are w s. `steps` (F, 2): displacements of the footsteps.
    """
    normals, offsets, shift, rest_normals, rest_offsets, rest_shift = edges
    n = len(zmp)
    worth = np.zeros((n, 2))
    z = np.empty(2)
    for k in range(n):
        for axis in range(2):
            z[axis] = zmp[k, axis]
            for f in range(len(steps)):
                z[axis] -= shift[k, f] * steps[f, axis]
        for e in range(MAX_EDGES):
            beyond = normals[k, e, 0] * z[0] + normals[k, e, 1] * z[1] - offsets[k, e]
            if beyond > 0.0:
                for axis in range(2):
                    worth[k, axis] += zmp_cost * beyond * normals[k, e, axis]
    tau = np.sqrt(end.b / end.a)
    for axis in range(2):
        z[axis] = end.a * (com[n - 1, axis] + tau * velocity[n - 1, axis]) + end.offset[axis] + delta_z[n - 1, axis]
        for f in range(len(steps)):
            z[axis] -= rest_shift[f] * steps[f, axis]
    for e in range(MAX_EDGES):
        beyond = rest_normals[e, 0] * z[0] + rest_normals[e, 1] * z[1] - rest_offsets[e]
        if beyond > 0.0:
            for axis in range(2):
                worth[n - 1, axis] += rest_cost * beyond * rest_normals[e, axis]
    return worth
