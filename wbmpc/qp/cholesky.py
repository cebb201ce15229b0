"""Small symmetric systems inside kernels: H = Uᵀ U, in place. Four terms of a sum at a time, one after the other."""

from __future__ import annotations

from math import sqrt

from wbmpc.jit import short_kernel


@short_kernel
def factor(H, n):  # type: ignore[no-untyped-def]
    """Replace the upper triangle of the leading (n, n) part of `H` by U; false when it is not positive definite."""
    for i in range(n):
        whole = i - i % 4
        for j in range(0, whole, 4):
            a, b, c, d = H[j, i], H[j + 1, i], H[j + 2, i], H[j + 3, i]
            if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
                for k in range(i, n):
                    H[i, k] = (((H[i, k] - a * H[j, k]) - b * H[j + 1, k]) - c * H[j + 2, k]) - d * H[j + 3, k]
        for j in range(whole, i):
            a = H[j, i]
            for k in range(i, n):
                H[i, k] -= a * H[j, k]
        if not H[i, i] > 0.0:  # nor nan
            return False
        pivot = 1.0 / sqrt(H[i, i])
        for k in range(i, n):
            H[i, k] *= pivot
    return True


@short_kernel
def forward(U, b, n):  # type: ignore[no-untyped-def]
    """Replace the first n of `b` by the solution x of Uᵀ x = b."""
    for j in range(n):
        b[j] /= U[j, j]
        for k in range(j + 1, n):
            b[k] -= U[j, k] * b[j]


@short_kernel
def forward_all(U, B, n):  # type: ignore[no-untyped-def]
    """Replace `B` of n rows by the solution X of Uᵀ X = B."""
    columns = B.shape[1]
    for i in range(n):
        whole = i - i % 4
        for j in range(0, whole, 4):
            a, b, c, d = U[j, i], U[j + 1, i], U[j + 2, i], U[j + 3, i]
            for k in range(columns):
                B[i, k] = (((B[i, k] - a * B[j, k]) - b * B[j + 1, k]) - c * B[j + 2, k]) - d * B[j + 3, k]
        for j in range(whole, i):
            for k in range(columns):
                B[i, k] -= U[j, i] * B[j, k]
        for k in range(columns):
            B[i, k] /= U[i, i]


@short_kernel
def products_of_columns(B, G):  # type: ignore[no-untyped-def]
    """Write the upper triangle of G = Bᵀ B."""
    n, columns = B.shape
    whole = n - n % 4
    for i in range(columns):
        for k in range(i, columns):
            G[i, k] = 0.0
        for j in range(0, whole, 4):
            a, b, c, d = B[j, i], B[j + 1, i], B[j + 2, i], B[j + 3, i]
            for k in range(i, columns):
                G[i, k] = (((G[i, k] + a * B[j, k]) + b * B[j + 1, k]) + c * B[j + 2, k]) + d * B[j + 3, k]
        for j in range(whole, n):
            for k in range(i, columns):
                G[i, k] += B[j, i] * B[j, k]


@short_kernel
def add_product(A, x, y):  # type: ignore[no-untyped-def]
    """Add A x to the first of `y`, as many as A has rows; four sums at once, to keep the CPU busy."""
    n, columns = A.shape
    whole = n - n % 4
    for i in range(0, whole, 4):
        a, b, c, d = y[i], y[i + 1], y[i + 2], y[i + 3]
        for j in range(columns):
            a += A[i, j] * x[j]
            b += A[i + 1, j] * x[j]
            c += A[i + 2, j] * x[j]
            d += A[i + 3, j] * x[j]
        y[i], y[i + 1], y[i + 2], y[i + 3] = a, b, c, d
    for i in range(whole, n):
        for j in range(columns):
            y[i] += A[i, j] * x[j]


@short_kernel
def substitute(U, b, n):  # type: ignore[no-untyped-def]
    """Replace the first n of `b` by the solution x of Uᵀ U x = b."""
    forward(U, b, n)
    backward(U, b, n)


@short_kernel
def backward(U, b, n):  # type: ignore[no-untyped-def]
    """Replace the first n of `b` by the solution x of U x = b."""
    for j in range(n - 1, -1, -1):
        rest = b[j]
        for k in range(j + 1, n):
            rest -= U[j, k] * b[k]
        b[j] = rest / U[j, j]


@short_kernel
def add_squares(H, g, A, b, w):  # type: ignore[no-untyped-def]
    """Add Σ w (A x − b)² / 2 to ½ xᵀ H x + gᵀ x: Aᵀ W A, its lower triangle only, and −Aᵀ W b."""
    n, rows = len(g), len(A)
    whole = rows - rows % 4
    for i in range(n):
        for r in range(0, whole, 4):
            a, c, d, e = w[r] * A[r, i], w[r + 1] * A[r + 1, i], w[r + 2] * A[r + 2, i], w[r + 3] * A[r + 3, i]
            for k in range(i + 1):
                H[i, k] = (((H[i, k] + a * A[r, k]) + c * A[r + 1, k]) + d * A[r + 2, k]) + e * A[r + 3, k]
        for r in range(whole, rows):
            a = w[r] * A[r, i]
            for k in range(i + 1):
                H[i, k] += a * A[r, k]
        for r in range(rows):
            g[i] -= w[r] * A[r, i] * b[r]
