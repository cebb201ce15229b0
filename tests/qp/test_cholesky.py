"""The small systems inside kernels against numpy, of every size around their blocks of four."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wbmpc.qp.cholesky import (
    add_product,
    add_squares,
    backward,
    factor,
    forward,
    forward_all,
    products_of_columns,
    substitute,
)
from wbmpc.signals import Vector


def positive(n: int) -> Vector:
    A = np.random.default_rng(n).normal(size=(n, n))
    H: Vector = A @ A.T + np.eye(n)
    return H


@pytest.mark.parametrize("n", range(10))
def test_the_factor_and_its_systems(n: int) -> None:
    H, rng = positive(n), np.random.default_rng(1)
    U, b, B = np.pad(H, (0, 1)), rng.normal(size=n), rng.normal(size=(n, 3))
    assert factor(U, n)
    U = np.triu(U)[:n, :n].copy()
    assert_allclose(U.T @ U, H, atol=1e-12)
    for solve, matrix in ((forward, U.T), (backward, U), (substitute, H)):
        x = b.copy()
        solve(U, x, n)
        assert_allclose(matrix @ x, b, atol=1e-9)
    X = B.copy()
    forward_all(U, X, n)
    assert_allclose(U.T @ X, B, atol=1e-9)


@pytest.mark.parametrize("n", range(1, 10))
def test_no_factor_of_what_is_not_positive_definite(n: int) -> None:
    for spoilt in (0.0, -1.0, np.nan):
        H = positive(n)
        H[n - 1] = H[:, n - 1] = 0.0
        H[n - 1, n - 1] = spoilt
        assert not factor(H, n)


@pytest.mark.parametrize("n", range(10))
@pytest.mark.parametrize("columns", [0, 1, 5])
def test_products(n: int, columns: int) -> None:
    rng = np.random.default_rng(n)
    A, x, start = rng.normal(size=(n, columns)), rng.normal(size=columns), rng.normal(size=n + 1)
    G, y = np.full((columns, columns), np.nan), start.copy()
    products_of_columns(A, G)
    upper = np.triu_indices(columns)
    assert_allclose(G[upper], (A.T @ A)[upper], atol=1e-12)
    add_product(A, x, y)
    assert_allclose(y[:n], start[:n] + A @ x, atol=1e-12)
    assert y[n] == start[n]
    H, g, b, w = np.zeros((columns, columns)), np.zeros(columns), rng.normal(size=n), rng.random(n)
    add_squares(H, g, A, b, w)
    assert_allclose(H, np.tril(A.T @ (w[:, None] * A)), atol=1e-12)
    assert_allclose(g, -A.T @ (w * b), atol=1e-12)
