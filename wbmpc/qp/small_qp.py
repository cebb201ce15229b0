"""A dual active-set method for strictly convex QPs of a few variables, as one kernel.

minimise ½ xᵀ H x + gᵀ x + ½ Σ_i s_i² / d_i   subject to  A x ≤ b + s,   s_i = 0 for a hard row (d_i = 0)

Goldfarb and Idnani (1983): start at the minimum without rows, add the most violated row, drop rows whose multiplier
would turn negative. It ends after finitely many steps, proves infeasibility, and needs no feasible start. In the
variables y = Lᵀ x with H = L Lᵀ every row is scaled to unit norm, so that tolerances mean the same for all. For the
handful of active rows that few variables can have, a Cholesky factor of their Gram matrix is made anew when one leaves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.signals import Vector

INFEASIBLE = -1
FAILED = -2  # more steps than any such problem takes, or H is not positive definite
VIOLATION = 1e-10  # of a row of unit norm, counted as none
DEPENDENT = 1e-11  # squared distance of a unit row from the span of the active ones, counted as none
WELL_APART = 1e-4  # a squared distance that rounding does not harm
STEP_LIMIT = 500


class SmallQp(NamedTuple):
    """Room for one problem of at most n variables and m rows, its answer and the kernel's intermediate results."""

    hessian: Vector  # (n, n)
    gradient: Vector  # (n,)
    rows: Vector  # (m, n) A
    bound: Vector  # (m,) b
    softness: Vector  # (m,) d, 0 for a hard row
    x: Vector  # (n,) the minimiser
    multiplier: Vector  # (m,) λ ≥ 0 of the rows; when infeasible, λ ≥ 0 with λᵀ A = 0 and λᵀ b < 0
    factor: Vector  # (n, n) L
    y: Vector  # (n,) Lᵀ x
    unit: Vector  # (m, n) A L⁻ᵀ, every row of unit norm
    scale: Vector  # (m,) norms of the rows before
    limit: Vector  # (m,) b and
    yielding: Vector  # (m,) d in that scale
    weight: Vector  # (m,) multipliers of the active rows, in their order, then the entering row's
    gram: Vector  # (m, m) Cholesky factor of the active rows' Gram matrix
    ratio: Vector  # (m,) the entering row in terms of the active ones, and
    rest: Vector  # (n,) what of it is orthogonal to them
    change: Vector  # (m,) of the active rows' multipliers
    lower: Vector  # (m,) on the way there
    active: NDArray[np.int64]  # (m,) the active rows, in the order in which they came


@kernel
def room_for(variables: int, rows: int) -> SmallQp:
    """Arrays for up to so many variables and rows, all zero. Made in a kernel: cheaper than to hand 20 of them over."""
    n, m = variables, rows
    return SmallQp(
        np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m), np.zeros(m), np.zeros(n), np.zeros(m),
        np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m),
        np.zeros((m, m)), np.zeros(m), np.zeros(n), np.zeros(m), np.zeros(m), np.zeros(m, dtype=np.int64),
    )  # fmt: skip


@kernel
def solve_small(qp: SmallQp, variables: int, rows: int) -> int:
    """Solve the leading `variables` and `rows` of `qp`: number of steps, or INFEASIBLE or FAILED.

    Writes `x` and `multiplier`; `x` means nothing unless the answer is a number of steps.
    """
    n, m, y = variables, rows, qp.y
    if not _scale_rows(qp, n, m):
        return FAILED
    count = steps = 0
    polished = False
    for i in range(m):
        qp.multiplier[i] = 0.0
    while True:
        entering, violation = -1, VIOLATION
        for i in range(m):
            excess = -qp.limit[i]
            for j in range(n):
                excess += qp.unit[i, j] * y[j]
            if excess > violation and not _is_active(qp, i, count):
                entering, violation = i, excess
        if entering < 0:
            if polished:
                break
            polished = True
            _polish(qp, n, count)
            continue
        polished = False
        qp.weight[count] = 0.0
        while True:
            steps += 1
            if steps > STEP_LIMIT:
                return FAILED
            pivot = _express(qp, n, count, entering)
            leaving, length = -1, np.inf  # of the step, in the entering row's multiplier
            for a in range(count):
                if qp.ratio[a] > 0.0 and qp.weight[a] < length * qp.ratio[a]:
                    leaving, length = a, qp.weight[a] / qp.ratio[a]
            if pivot > DEPENDENT:
                full = violation / pivot
                if full <= length:
                    leaving, length = -1, full
            elif leaving < 0:  # the entering row contradicts the active ones
                for a in range(count):
                    row = qp.active[a]
                    if qp.softness[row] == 0.0:  # a soft row contradicts nothing: its ratio is rounding
                        qp.multiplier[row] = max(-qp.ratio[a], 0.0) / qp.scale[row]
                qp.multiplier[entering] = 1.0 / qp.scale[entering]
                return INFEASIBLE
            for a in range(count):
                qp.weight[a] -= length * qp.ratio[a]
            qp.weight[count] += length
            if pivot > DEPENDENT:
                violation -= length * pivot
                for j in range(n):
                    y[j] -= length * qp.rest[j]
            if leaving < 0:
                qp.active[count] = entering  # `_express` has left its row of the Cholesky factor behind
                qp.gram[count, count] = np.sqrt(pivot)
                count += 1
                break
            count = _remove(qp, n, count, leaving)
    for a in range(count):
        row = qp.active[a]
        qp.multiplier[row] = max(qp.weight[a], 0.0) / qp.scale[row]
    for j in range(n - 1, -1, -1):
        value = y[j]
        for i in range(j + 1, n):
            value -= qp.factor[i, j] * qp.x[i]
        qp.x[j] = value / qp.factor[j, j]
    return steps


@kernel
def _scale_rows(qp: SmallQp, n: int, m: int) -> bool:
    """H = L Lᵀ, y = −L⁻¹ g, and the rows in y; False when H is not positive definite (or not finite)."""
    L = qp.factor
    for j in range(n):
        for i in range(j, n):
            value = qp.hessian[i, j]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            if i == j:
                if not 0.0 < value < np.inf:
                    return False
                L[j, j] = np.sqrt(value)
            else:
                L[i, j] = value / L[j, j]
    for i in range(n):
        value = -qp.gradient[i]
        for k in range(i):
            value -= L[i, k] * qp.y[k]
        qp.y[i] = value / L[i, i]
    for r in range(m):
        square = 0.0
        for i in range(n):
            value = qp.rows[r, i]
            for k in range(i):
                value -= L[i, k] * qp.unit[r, k]
            value /= L[i, i]
            qp.unit[r, i] = value
            square += value * value
        scale = np.sqrt(square)
        if scale < 1e-12:  # 0 ≤ b
            scale = 1.0
        qp.scale[r] = scale
        qp.limit[r] = qp.bound[r] / scale
        qp.yielding[r] = qp.softness[r] / (scale * scale)
        for i in range(n):
            qp.unit[r, i] /= scale
    return True


@kernel
def _is_active(qp: SmallQp, row: int, count: int) -> bool:
    for a in range(count):  # noqa: SIM110 kernels know no generators
        if qp.active[a] == row:
            return True
    return False


@kernel
def _express(qp: SmallQp, n: int, count: int, row: int) -> float:
    """Write `row` as Σ ratio × active rows plus a rest orthogonal to them: the rest's square, softness included.

    Row `count` of the Cholesky factor becomes that of `row`, its diagonal excepted. The square is that of the rest
    itself: the factor's own pivot is a difference, which says nothing where rows are nearly dependent.
    """
    gram, unit, rest, active = qp.gram, qp.unit, qp.rest, qp.active
    for j in range(n):
        rest[j] = unit[row, j]
    for a in range(count):
        qp.ratio[a] = 0.0
    for refinement in range(2):
        for a in range(count):
            value = -qp.yielding[active[a]] * qp.ratio[a]
            for j in range(n):
                value += unit[active[a], j] * rest[j]
            qp.change[a] = value
        _substitute(qp, count)
        if refinement == 0:
            for a in range(count):
                gram[count, a] = qp.lower[a]
        square = qp.yielding[row]
        for a in range(count):
            qp.ratio[a] += qp.change[a]
            square += qp.yielding[active[a]] * qp.ratio[a] * qp.ratio[a]
            for j in range(n):
                rest[j] -= qp.change[a] * unit[active[a], j]
        for j in range(n):
            square += rest[j] * rest[j]
        if square > WELL_APART:
            break
    return square


@kernel
def _substitute(qp: SmallQp, count: int) -> None:
    """Replace `change` by the solution of Gram matrix × solution = change; `lower` is the solution half way."""
    gram, lower, change = qp.gram, qp.lower, qp.change
    for a in range(count):
        value = change[a]
        for k in range(a):
            value -= gram[a, k] * lower[k]
        lower[a] = value / gram[a, a]
    for a in range(count - 1, -1, -1):
        value = lower[a]
        for k in range(a + 1, count):
            value -= gram[k, a] * change[k]
        change[a] = value / gram[a, a]


@kernel
def _polish(qp: SmallQp, n: int, count: int) -> None:
    """One Newton step on the active rows: takes out what rounding has left in them."""
    for a in range(count):
        row = qp.active[a]
        value = -qp.limit[row] - qp.yielding[row] * qp.weight[a]
        for j in range(n):
            value += qp.unit[row, j] * qp.y[j]
        qp.change[a] = value
    _substitute(qp, count)
    for a in range(count):
        qp.weight[a] += qp.change[a]
        for j in range(n):
            qp.y[j] -= qp.change[a] * qp.unit[qp.active[a], j]


@kernel
def _remove(qp: SmallQp, n: int, count: int, place: int) -> int:
    """Take the active row at `place` out, the entering row's weight moving up with the others: the new count."""
    for a in range(place, count):
        qp.active[a] = qp.active[a + 1]
        qp.weight[a] = qp.weight[a + 1]
    for a in range(place, count - 1):  # the factor's rows before `place` stay
        pivot = _express(qp, n, a, qp.active[a])
        qp.gram[a, a] = np.sqrt(max(pivot, DEPENDENT))
    return count - 1
