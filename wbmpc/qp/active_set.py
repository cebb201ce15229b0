"""A QP solved from a guess of its active set, as machine code: right after a round or two, or not at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel, short_kernel
from wbmpc.qp.cholesky import add_product, backward, factor, forward, forward_all, products_of_columns, substitute
from wbmpc.qp.verdicts import SOUND, soundness
from wbmpc.signals import Vector

MOST_ROUNDS = 15  # of one start
TOLERANCE = 1e-9  # relative, of a bound or a multiplier's sign
DEPENDENT = 1e-10  # squared share of an active row that the others do not already say; below it is too near to them


@kernel
def solve_from_guess(
    hessian: Vector,
    gradient: Vector,
    matrix: Vector,
    all_lower: Vector,
    all_upper: Vector,
    softness: Vector,
    active: NDArray[np.int8],
    U: Vector,
    factored: bool,
    x: Vector,
) -> int:
    """Minimise ½ xᵀ H x + gᵀ x + ½ Σ s_i² / d_i within bounds and rows: rounds (0: not found); `x` (n,) becomes it.

    What `active` (n + m,) says, variables first, holds with equality: 1 at the upper bound, -1 at the lower. Whoever is
    violated joins, whoever has a multiplier of the wrong sign leaves, all at once, until nobody does: then all
    conditions of the optimum hold, and H being positive definite it is the only one. Where that would lead back to a
    set already tried, every second change is left out. Still it need not come to an end; it is given up after
    MOST_ROUNDS, and where active rows all but depend on each other. `active` is overwritten: by the optimum's set, or
    by zeros where none was found.

    Args:
        all_lower, all_upper: (n + m,) of variables, then rows; they do not cross.
        softness: (m,) d, 0 for a hard row.
        U: (n, n) becomes the factor below of the optimum's set; with `factored` it is that of this H and `active`.

    The variables at their bounds are fixed; with Uᵀ U = H over the others and Y = U⁻ᵀ Aᵀ of the active rows, their
    multipliers solve (Yᵀ Y + D) λ = Yᵀ z − b, z = −U⁻ᵀ g, and x = U⁻¹ (z − Y λ).
    """
    n, m = len(gradient), len(softness)
    start, z, free = np.empty(n), np.empty(n), np.empty(n, np.int64)
    rows, value = np.empty(m, np.int64), np.empty(m)
    tried = np.empty((MOST_ROUNDS, n + m), np.int8)
    count, refactor = 0, True
    for rounds in range(1, MOST_ROUNDS + 1):
        if refactor:
            count = 0
            for i in range(n):
                if active[i] == 0:
                    free[count] = i
                    count += 1
                else:
                    x[i] = all_upper[i] if active[i] > 0 else all_lower[i]
            for a in range(count):
                i = free[a]
                start[a] = -gradient[i]
                if not factored:
                    for b in range(a, count):
                        U[a, b] = hessian[i, free[b]]
                if count < n:
                    for j in range(n):
                        if active[j] != 0:
                            start[a] -= hessian[i, j] * x[j]
            if not (factored or factor(U, count)):
                break
            factored = False  # for the next set
            forward(U, start, count)
        z[:count] = start[:count]
        held = 0
        for r in range(m):
            if active[n + r] != 0:
                rows[held] = r
                held += 1
        if held > 2 * n:  # soft rows may be more than the variables
            break
        Y, multiplier, square = np.empty((count, held)), np.empty(held), np.empty(held)
        gram = np.empty((held, held))
        for c in range(held):
            r = rows[c]
            bound = all_upper[n + r] if active[n + r] > 0 else all_lower[n + r]
            for a in range(count):
                Y[a, c] = matrix[r, free[a]]
            if count < n:
                for j in range(n):
                    if active[j] != 0:
                        bound -= matrix[r, j] * x[j]
            multiplier[c] = -bound
        forward_all(U, Y, count)
        for a in range(count):
            for c in range(held):
                multiplier[c] += Y[a, c] * z[a]
        products_of_columns(Y, gram)
        for c in range(held):
            gram[c, c] += softness[rows[c]]
            square[c] = gram[c, c]
        if not factor(gram, held):
            break
        dependent = False
        for c in range(held):
            dependent |= gram[c, c] ** 2 < DEPENDENT * square[c]
        if dependent:
            break
        substitute(gram, multiplier, held)
        add_product(Y, -multiplier, z)
        backward(U, z, count)
        finite = True
        for a in range(count):
            x[free[a]] = z[a]
            finite &= np.isfinite(z[a])
        if not finite:
            break
        changed = refactor = False
        tried[rounds - 1] = active
        if count < n:
            for j in range(n):
                if active[j] == 0 or all_lower[j] == all_upper[j]:
                    continue
                slope, size = gradient[j], abs(gradient[j])
                for i in range(n):
                    slope += hessian[j, i] * x[i]
                for c in range(held):
                    slope += multiplier[c] * matrix[rows[c], j]
                if slope * active[j] > TOLERANCE * (1.0 + size):
                    active[j], refactor = 0, True
        for c in range(held):
            r = n + rows[c]
            if multiplier[c] * active[r] < 0.0 and all_lower[r] != all_upper[r]:
                active[r], changed = 0, True
        for a in range(count):
            i = free[a]
            if x[i] > all_upper[i] + TOLERANCE * (1.0 + abs(all_upper[i])):
                active[i], refactor = 1, True
            elif x[i] < all_lower[i] - TOLERANCE * (1.0 + abs(all_lower[i])):
                active[i], refactor = -1, True
        value[:] = 0.0
        add_product(matrix, x, value)
        c = 0
        for r in range(m):
            if c < held and rows[c] == r:  # what has just left stays out of this round
                c += 1
                continue
            low, high = all_lower[n + r], all_upper[n + r]
            if low == -np.inf and high == np.inf:
                continue
            if not value[r] <= high + TOLERANCE * (1.0 + abs(high)):  # nor nan
                active[n + r], changed = 1, True
            elif value[r] < low - TOLERANCE * (1.0 + abs(low)):
                active[n + r], changed = -1, True
        if not (changed or refactor):
            return rounds
        if _is_among(tried[:rounds], active):
            _halve_changes(active, tried[rounds - 1])
    active[:] = 0
    return 0


@short_kernel
def _is_among(tried: NDArray[np.int8], active: NDArray[np.int8]) -> bool:
    for known in tried:
        same = True
        for i in range(len(active)):
            if known[i] != active[i]:
                same = False
                break
        if same:
            return True
    return False


@short_kernel
def _halve_changes(active: NDArray[np.int8], before: NDArray[np.int8]) -> None:
    """Take back every second change since `before`."""
    keep = True
    for i in range(len(active)):
        if active[i] != before[i]:
            if not keep:
                active[i] = before[i]
            keep = not keep


@kernel
def examine_and_guess(
    hessian: Vector,
    gradient: Vector,
    matrix: Vector,
    all_lower: Vector,
    all_upper: Vector,
    softness: Vector,
    active: NDArray[np.int8],
    U: Vector,
    factored: bool,
    matrices_changed: bool,
    x: Vector,
) -> tuple[int, int]:
    """The data's `soundness`, then what `solve_from_guess` finds, or finds from the empty set; nothing if not SOUND."""
    verdict = soundness(hessian.reshape(-1), gradient, matrix.reshape(-1), all_lower, all_upper, matrices_changed)
    if verdict != SOUND:
        return verdict, 0
    guessed = active.any()
    rounds = solve_from_guess(hessian, gradient, matrix, all_lower, all_upper, softness, active, U, factored, x)
    if rounds == 0 and guessed:
        rounds = solve_from_guess(hessian, gradient, matrix, all_lower, all_upper, softness, active, U, False, x)
    return verdict, rounds
