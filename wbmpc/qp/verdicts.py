"""Two questions asked of every solve, as machine code: are the data sound, and is the answer an optimum?"""

from __future__ import annotations

from math import inf, isfinite, isnan

from wbmpc.jit import short_kernel

SOUND, NOT_FINITE, CROSSING = 0, 1, 2


@short_kernel
def finite(data):  # type: ignore[no-untyped-def]
    """Whether a flat array holds neither nan nor inf: 0 · x is 0 for finite x only. Four sums, to keep the CPU busy."""
    a = b = c = d = 0.0
    whole = data.size - data.size % 4
    for i in range(0, whole, 4):
        a += 0.0 * data[i]
        b += 0.0 * data[i + 1]
        c += 0.0 * data[i + 2]
        d += 0.0 * data[i + 3]
    for i in range(whole, data.size):
        a += 0.0 * data[i]
    return a + b + c + d == 0.0


@short_kernel
def soundness(hessian, gradient, matrix, lower, upper, matrices_changed):  # type: ignore[no-untyped-def]
    """SOUND, NOT_FINITE for nan or inf where no solver takes them, CROSSING for bounds that nothing can keep.

    All arrays flat; `lower`, `upper`: of variables and rows, where ±inf is no bound.
    """
    if not finite(gradient) or (matrices_changed and not (finite(hessian) and finite(matrix))):
        return NOT_FINITE
    crossing = False
    for i in range(lower.size):
        low, up = lower[i], upper[i]
        if isnan(low) or isnan(up):
            return NOT_FINITE
        crossing |= low > up or low == inf or up == -inf
    return CROSSING if crossing else SOUND


@short_kernel
def closes_duality_gap(x, cost, multiplier, gradient, lower, upper, tolerance):  # type: ignore[no-untyped-def]
    """Whether |2 f(x) − gᵀx + λᵀb| is small, b the bound on the side of λ's sign.

    Never with an x that is not finite, nor with a multiplier of the side on which there is no bound.
    """
    dual = linear = 0.0
    for i in range(multiplier.size):
        value = multiplier[i]
        if value > 0.0:
            dual += value * upper[i]
        elif value < 0.0:
            dual += value * lower[i]
    for i in range(x.size):
        linear += gradient[i] * x[i]
    if not (isfinite(linear) and isfinite(dual)):  # inf <= inf
        return False
    return abs(2.0 * cost - linear + dual) <= tolerance * (1.0 + abs(cost) + abs(linear) + abs(dual))
