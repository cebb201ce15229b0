"""The QP of the horizontal CoM motion, written in one call; what its solution says: horizontal_answer.py."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wbmpc.jit import kernel, short_kernel
from wbmpc.planner.horizontal_kernel import (
    Costs,
    End,
    FreeMotion,
    HalfPlanes,
    Matrices,
    look_ahead,
    slots_of,
    write_costs,
    write_rows,
)
from wbmpc.signals import Vector

LARGEST_SHIFT = 1.0  # [m] bound on |ΔZ|


class Placement(NamedTuple):
    """Where the coming footsteps may be, as in `SupportPreview`."""

    axes: Vector
    axes_lower: Vector
    axes_upper: Vector
    lower: Vector
    upper: Vector


@kernel
def size_of_problem(
    lower: Vector, upper: Vector, offsets: Vector, rest_offsets: Vector, signs: Vector
) -> tuple[bool, int, int]:
    """Whether a footstep may be moved, how many ΔZ are asked for, and the sides of the polygon with the most of them.

    The rest of a polygon's rows are padding.
    """
    most = len(rest_offsets)
    while most > 0 and np.isinf(rest_offsets[most - 1]) and np.isinf(offsets[:, most - 1]).all():
        most -= 1
    return bool(lower.any() or upper.any()), int(np.count_nonzero(signs)), most


@kernel
def write_problem(
    hessian: Vector,
    gradient: Vector,
    matrix: Vector,
    all_lower: Vector,
    all_upper: Vector,
    unmoved: tuple[Vector, ...],
    matrices: tuple[Vector, ...],
    costs: tuple[Any, ...],
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
    com_velocity: Vector,
    com_reference: Vector,
    centres: Vector,
    centring: Vector,
    axes: Vector,
    axes_lower: Vector,
    axes_upper: Vector,
    lower: Vector,
    upper: Vector,
    com_band: Vector,
    urgency: float,
    first_curvature: Vector,
    first_gradient: Vector,
    signs: Vector,
    footsteps: int,
    size: int,
    sides: int,
) -> None:
    """All numbers of a problem (a `QuadraticProgram`) that may differ from the last time's; fills `unmoved`.

    The arguments are those of the functions below, in the order of `HorizontalMotion.solve`; named tuples are plain
    here, because numba takes twice as long to unpack them.
    """
    free_motion, preview, prices = FreeMotion(*unmoved), Matrices(*matrices), Costs(*costs)
    n, variables = len(a), len(gradient)
    first = 2 * n + 2 * footsteps
    edges = HalfPlanes(normals, offsets, shift, rest_normals, rest_offsets, rest_shift)
    end = End(a[n - 1], b[n - 1], offset[n - 1])
    slots = slots_of(signs, size)
    look_ahead(free_motion, preview, state, a, b, offset)
    write_costs(
        *(hessian, gradient, prices, preview, free_motion, com_velocity, com_reference, centres, centring, shift),
        *(footsteps, urgency, first_curvature, first_gradient),
    )
    write_rows(
        *(matrix, all_lower[variables:], all_upper[variables:], preview, free_motion, end, edges, com_band),
        *(footsteps, slots, sides),
    )
    if footsteps:
        place = Placement(axes, axes_lower, axes_upper, lower, upper)
        write_footsteps(matrix, all_lower, all_upper, 2 * n, place)
    for i in range(size):
        sign = 0.0
        if slots.knots[i] >= 0:
            sign = signs[slots.knots[i], slots.axes[i]]
        gradient[first + i] = prices.shift * sign
        all_lower[first + i] = 0.0 if sign > 0.0 else -LARGEST_SHIFT
        all_upper[first + i] = 0.0 if sign < 0.0 else LARGEST_SHIFT


@short_kernel
def write_footsteps(matrix: Vector, all_lower: Vector, all_upper: Vector, first: int, place: Placement) -> None:
    """Where the coming footsteps may be: beside the one before, and within the swing foot's reach in time."""
    m, variables = len(place.axes), matrix.shape[1]
    last = len(matrix) - 2 * m
    for f in range(m):
        for side in range(2):
            row = last + 2 * f + side
            for axis in range(2):
                column = first + axis * m + f
                matrix[row, column] = place.axes[f, side, axis]
                if f > 0:
                    matrix[row, column - 1] = -place.axes[f, side, axis]
            all_lower[variables + row] = place.axes_lower[f, side]
            all_upper[variables + row] = place.axes_upper[f, side]
        for axis in range(2):
            all_lower[first + axis * m + f] = place.lower[f, axis]
            all_upper[first + axis * m + f] = place.upper[f, axis]
