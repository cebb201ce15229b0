"""Numbers of the QP of the horizontal CoM motion, and what its solution says, in compiled loops.

Written a second time, readably and as one QP with the joint velocities, in tests/planner/joint_form.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.support import MAX_EDGES
from wbmpc.signals import Vector


class Matrices(NamedTuple):
    """Those of `Preview` that are used here."""

    P_ps: Vector
    P_vs: Vector
    P_pu: Vector
    P_vu: Vector
    P_au: Vector


class Costs(NamedTuple):
    """Weights of `WholeBodySettings`, and the Hessian of what draws the CoM back to where it should be."""

    jerk: float
    velocity: float
    position: float
    centre: float
    footstep: float
    return_hessian: Vector  # (N, N)


class FreeMotion(NamedTuple):
    """What happens without jerk, and what a jerk does to the ZMP."""

    com: Vector  # (2, N) [m]
    velocity: Vector  # (2, N) [m/s]
    zmp: Vector  # (N, 2) [m]
    P_zu: Vector  # (N, N)


class HalfPlanes(NamedTuple):
    """Where the ZMP may be, as in `SupportPreview`."""

    normals: Vector
    offsets: Vector
    shift: Vector
    rest_normals: Vector
    rest_offsets: Vector
    rest_shift: Vector


class End(NamedTuple):
    """The ZMP's model at the last knot."""

    a: float
    b: float
    offset: Vector  # (2,) [m]


class Slots(NamedTuple):
    """Which ΔZ the last variables are; an unused one has knot -1."""

    knots: NDArray[np.int64]
    axes: NDArray[np.int64]


@kernel
def most_sides(edges: HalfPlanes) -> int:
    """How many sides the polygon with the most of them has; the rest of its rows are padding."""
    most = len(edges.rest_offsets)
    while most > 0 and np.isinf(edges.rest_offsets[most - 1]) and np.isinf(edges.offsets[:, most - 1]).all():
        most -= 1
    return most


@kernel
def free_motion(matrices: Matrices, state: Vector, a: Vector, b: Vector, offset: Vector) -> FreeMotion:
    """From `state` (2, 3) with the ZMP's model a, b (N,), `offset` (N, 2)."""
    P_ps, P_vs, P_pu, P_au = matrices.P_ps, matrices.P_vs, matrices.P_pu, matrices.P_au
    n = len(a)
    free, free_velocity, free_zmp, P_zu = np.zeros((2, n)), np.zeros((2, n)), np.empty((n, 2)), np.empty((n, n))
    for k in range(n):
        for axis in range(2):
            for i in range(3):
                free[axis, k] += P_ps[k, i] * state[axis, i]
                free_velocity[axis, k] += P_vs[k, i] * state[axis, i]
            free_zmp[k, axis] = a[k] * free[axis, k] - b[k] * state[axis, 2] + offset[k, axis]
        for j in range(n):
            P_zu[k, j] = a[k] * P_pu[k, j] - b[k] * P_au[k, j]
    return FreeMotion(free, free_velocity, free_zmp, P_zu)


@kernel
def write_costs(
    hessian: Vector,
    gradient: Vector,
    costs: Costs,
    matrices: Matrices,
    unmoved: FreeMotion,
    com_velocity: Vector,
    com_reference: Vector,
    centres: Vector,
    centring: Vector,
    shift: Vector,
    footsteps: int,
    urgency: float,
    first_curvature: Vector,
    first_gradient: Vector,
) -> None:
    """Costs of jerks and footsteps: all of the Hessian's and gradient's first 2 N + 2 `footsteps` entries.

    `first_curvature` (2, 2), `first_gradient` (2,): what the first jerks cost the joints, ½ uᵀ H u + gᵀ u.
    """
    P_pu, P_vu = matrices.P_pu, matrices.P_vu
    free, free_velocity, free_zmp, P_zu = unmoved
    n = len(centring)
    end = 2 * n + 2 * footsteps
    hessian[:end, :end] = 0.0
    gradient[:end] = 0.0
    for axis in range(2):
        first = axis * n
        for j in range(n):
            for i in range(n):
                hessian[first + j, first + i] = urgency * costs.return_hessian[j, i]
            hessian[first + j, first + j] += costs.jerk
            pull = 0.0
            for k in range(j, n):  # a jerk moves no earlier knot
                pull += costs.velocity * P_vu[k, j] * (free_velocity[axis, k] - com_velocity[k, axis])
                pull += costs.position * P_pu[k, j] * (free[axis, k] - com_reference[k, axis])
            gradient[first + j] = urgency * pull
        for f in range(footsteps):
            hessian[2 * n + axis * footsteps + f, 2 * n + axis * footsteps + f] = costs.footstep
        for k in range(n):  # w_z s_k |Z_k − S_k (F − F_ref) − centre_k|²
            weight = costs.centre * centring[k]
            if weight == 0.0:
                continue
            error = weight * (free_zmp[k, axis] - centres[k, axis])
            for j in range(k + 1):
                gradient[first + j] += P_zu[k, j] * error
                for i in range(k + 1):
                    hessian[first + j, first + i] += weight * P_zu[k, j] * P_zu[k, i]
            for f in range(footsteps):
                if shift[k, f] == 0.0:
                    continue
                column = 2 * n + axis * footsteps + f
                gradient[column] -= shift[k, f] * error
                for j in range(k + 1):
                    cross = weight * shift[k, f] * P_zu[k, j]
                    hessian[first + j, column] -= cross
                    hessian[column, first + j] -= cross
                for g in range(footsteps):
                    hessian[column, 2 * n + axis * footsteps + g] += weight * shift[k, f] * shift[k, g]
        gradient[first] += first_gradient[axis]
        for other in range(2):
            hessian[first, other * n] += first_curvature[axis, other]


@kernel
def write_rows(
    matrix: Vector,
    lower: Vector,
    upper: Vector,
    matrices: Matrices,
    unmoved: FreeMotion,
    end: End,
    edges: HalfPlanes,
    com_band: Vector,
    footsteps: int,
    slots: Slots,
    sides: int,
) -> None:
    """Rows of the ZMP (edge after edge of a knot), of the rest after the last knot, and of where the CoM may be.

    `sides`: edges of the polygon that has most; every knot gets as many rows.
    Variables are jerks (x, then y), footsteps (the same) and the slots of ΔZ.
    """
    P_pu, P_vu = matrices.P_pu, matrices.P_vu
    free, free_velocity, free_zmp, P_zu = unmoved
    normals, offsets, shift, rest_normals, rest_offsets, rest_shift = edges
    n = len(normals)
    steps, first = 2 * n, 2 * n + 2 * footsteps
    rest = n * sides
    matrix[: rest + sides, first:] = 0.0
    tau = np.sqrt(end.b / end.a)
    for k in range(n):
        for e in range(sides):
            row = k * sides + e
            bound = offsets[k, e]
            for axis in range(2):
                edge = normals[k, e, axis]
                for j in range(k + 1):
                    matrix[row, axis * n + j] = edge * P_zu[k, j]
                for f in range(footsteps):
                    matrix[row, steps + axis * footsteps + f] = -edge * shift[k, f]
                bound -= edge * free_zmp[k, axis]
            upper[row] = bound
    for e in range(sides):
        bound = rest_offsets[e]
        for axis in range(2):
            edge = rest_normals[e, axis]
            for j in range(n):
                matrix[rest + e, axis * n + j] = edge * end.a * (P_pu[n - 1, j] + tau * P_vu[n - 1, j])
            for f in range(footsteps):
                matrix[rest + e, steps + axis * footsteps + f] = -edge * rest_shift[f]
            bound -= edge * (end.a * (free[axis, n - 1] + tau * free_velocity[axis, n - 1]) + end.offset[axis])
        upper[rest + e] = bound
    for i in range(len(slots.knots)):
        k = slots.knots[i]
        if k >= 0:
            for e in range(sides):
                matrix[k * sides + e, first + i] = normals[k, e, slots.axes[i]]
                if k == n - 1:
                    matrix[rest + e, first + i] = rest_normals[e, slots.axes[i]]
    band = rest + sides
    for axis in range(2):
        for k in range(n):
            lower[band + axis * n + k] = com_band[axis, k, 0] - free[axis, k]
            upper[band + axis * n + k] = com_band[axis, k, 1] - free[axis, k]


@kernel
def motion_of(
    x: Vector, state: Vector, matrices: Matrices, unmoved: FreeMotion, footsteps: int, slots: Slots
) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """Jerk, CoM, velocity, acceleration, ΔZ and ZMP of a solution, all (N, 2)."""
    P_pu, P_vu, P_au = matrices.P_pu, matrices.P_vu, matrices.P_au
    free, free_velocity, free_zmp, P_zu = unmoved
    n = len(free_zmp)
    jerk, com, velocity = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
    acceleration, delta_z, zmp = np.empty((n, 2)), np.zeros((n, 2)), np.empty((n, 2))
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
    return jerk, com, velocity, acceleration, delta_z, zmp


@kernel
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
