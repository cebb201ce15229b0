"""Small symmetric systems inside kernels: H = Uᵀ U, in place."""

from __future__ import annotations

from math import sqrt

from wbmpc.jit import short_kernel


@short_kernel
def factor(H, n):  # type: ignore[no-untyped-def]
    """Replace the upper triangle of the leading (n, n) part of `H` by U; false when it is not positive definite."""
    for j in range(n):
        if not H[j, j] > 0.0:  # nor nan
            return False
        pivot = 1.0 / sqrt(H[j, j])
        for k in range(j, n):
            H[j, k] *= pivot
        for i in range(j + 1, n):
            s = H[j, i]
            if s != 0.0:
                for k in range(i, n):
                    H[i, k] -= s * H[j, k]
    return True


@short_kernel
def forward(U, b, n):  # type: ignore[no-untyped-def]
    """Replace the first n of `b` by the solution x of Uᵀ x = b."""
    for j in range(n):
        b[j] /= U[j, j]
        for k in range(j + 1, n):
            b[k] -= U[j, k] * b[j]


@short_kernel
def substitute(U, b, n):  # type: ignore[no-untyped-def]
    """Replace the first n of `b` by the solution x of Uᵀ U x = b."""
    forward(U, b, n)
    for j in range(n - 1, -1, -1):
        rest = b[j]
        for k in range(j + 1, n):
            rest -= U[j, k] * b[k]
        b[j] = rest / U[j, j]
