"""Costs and rows of the horizontal CoM motion in compiled loops; all of its QP: horizontal_problem.py.

Written a second time, readably and as one QP with the joint velocities, in tests/planner/joint_form.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import short_kernel
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
    shift: float  # price of a ΔZ
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


@short_kernel
def slots_of(signs: Vector, size: int) -> Slots:
    """The slots that hold the ΔZ asked for, knot after knot."""
    slots, count = Slots(np.full(size, -1), np.zeros(size, dtype=np.int64)), 0
    for k in range(len(signs)):
        for axis in range(2):
            if signs[k, axis] != 0.0:
                slots.knots[count], slots.axes[count] = k, axis
                count += 1
    return slots


@short_kernel
def look_ahead(unmoved: FreeMotion, matrices: Matrices, state: Vector, a: Vector, b: Vector, offset: Vector) -> None:
    """Fill `unmoved`, from `state` (2, 3) with the ZMP's model a, b (N,), `offset` (N, 2)."""
    P_ps, P_vs, P_pu, P_au = matrices.P_ps, matrices.P_vs, matrices.P_pu, matrices.P_au
    free, free_velocity, free_zmp, P_zu = unmoved
    for k in range(len(a)):
        for axis in range(2):
            c = v = 0.0
            for i in range(3):
                c += P_ps[k, i] * state[axis, i]
                v += P_vs[k, i] * state[axis, i]
            free[axis, k], free_velocity[axis, k] = c, v
            free_zmp[k, axis] = a[k] * c - b[k] * state[axis, 2] + offset[k, axis]
        for j in range(len(a)):
            P_zu[k, j] = a[k] * P_pu[k, j] - b[k] * P_au[k, j]


@short_kernel
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


@short_kernel
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
