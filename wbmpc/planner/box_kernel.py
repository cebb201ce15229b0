"""A strictly convex QP with bounds only, from a good guess of which of them hold; and what moving its target costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.qp.cholesky import factor, substitute
from wbmpc.signals import Vector

MOST_ROUNDS = 8
SLACK = 1e-10  # a bound missed by so little is kept, a multiplier so small has no sign


@kernel
def solve_box(
    hessian: Vector,
    gradient: Vector,
    lower: Vector,
    upper: Vector,
    jacobian: Vector,
    velocity: Vector,
    weight: float,
    held: NDArray[np.int64],
) -> tuple[int, Vector, Vector, Vector]:
    """Minimise ½ xᵀ H x + gᵀ x within bounds: rounds (0: not found), x (n,), slope (2,) and curvature (2, 2) of V.

    The variables `held` (n,), 1 at the upper bound and -1 at the lower, stay there, the others are free; whoever of
    these leaves its bounds is held, and whoever is held against its multiplier's sign is freed, until nobody changes:
    then all conditions of the optimum hold. `held` is overwritten: by the set of the optimum, a guess for the next
    time, or by zeros where none was found. g holds −w Jᵀ v for the target v = `velocity` (2,), J the first two rows of
    `jacobian`:   ∇V = w (v − J x),   ∇²V = w (1 − w J_f H_ff⁻¹ J_fᵀ)   over the free f.
    """
    n = len(gradient)
    x, U, free = np.empty(n), np.empty((n, n)), np.empty(n, np.int64)
    right, slope, curvature = np.empty(n), np.empty(2), np.zeros((2, 2))
    for i in range(n):
        if not lower[i] <= upper[i]:
            return 0, x, slope, curvature
    for rounds in range(1, MOST_ROUNDS + 1):
        count = 0
        for i in range(n):
            if held[i] == 0:
                free[count] = i
                count += 1
            else:
                x[i] = upper[i] if held[i] > 0 else lower[i]
        for a in range(count):
            i = free[a]
            right[a] = -gradient[i]
            for b in range(a, count):
                U[a, b] = hessian[i, free[b]]
            if count < n:
                for j in range(n):
                    if held[j] != 0:
                        right[a] -= hessian[i, j] * x[j]
        if not factor(U, count):
            break
        substitute(U, right, count)
        changed = False
        for a in range(count):
            i = free[a]
            x[i] = right[a]
            if not np.isfinite(x[i]):
                held[:] = 0
                return 0, x, slope, curvature
            if x[i] > upper[i] + SLACK:
                held[i], changed = 1, True
            elif x[i] < lower[i] - SLACK:
                held[i], changed = -1, True
        if count < n and not changed:
            for i in range(n):
                if held[i] == 0 or lower[i] == upper[i]:
                    continue
                pull = gradient[i]
                for j in range(n):
                    pull += hessian[i, j] * x[j]
                if pull * held[i] > SLACK:
                    held[i], changed = 0, True
        if not changed:
            _cost(U, free, count, x, jacobian, velocity, weight, slope, curvature)
            return rounds, x, slope, curvature
    held[:] = 0
    return 0, x, slope, curvature


@kernel
def _cost(
    U: Vector,
    free: NDArray[np.int64],
    count: int,
    x: Vector,
    jacobian: Vector,
    velocity: Vector,
    weight: float,
    slope: Vector,
    curvature: Vector,
) -> None:
    """Write slope and curvature of V at x; Uᵀ U = H_ff."""
    follows = np.empty((2, count))
    for a in range(2):
        slope[a] = velocity[a]
        for i in range(len(x)):
            slope[a] -= jacobian[a, i] * x[i]
        slope[a] *= weight
        for f in range(count):
            follows[a, f] = jacobian[a, free[f]]
        substitute(U, follows[a], count)
    for a in range(2):
        curvature[a, a] = weight
        for b in range(2):
            for f in range(count):
                curvature[a, b] -= weight * weight * jacobian[a, free[f]] * follows[b, f]
    curvature[0, 1] = curvature[1, 0] = 0.5 * (curvature[0, 1] + curvature[1, 0])
