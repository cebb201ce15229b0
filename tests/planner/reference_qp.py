"""A tiny modelling layer over OSQP, for problems written a second time: every quantity a variable, nothing condensed."""

from __future__ import annotations

import numpy as np
import osqp
import scipy.sparse as sp

from wbmpc.signals import Vector


class ReferenceQp:
    """minimise ½ Σ w |A x − b|² subject to lower ≤ A x ≤ upper, with variables handed out in blocks of columns."""

    def __init__(self) -> None:
        self._size = 0
        self._terms: list[tuple[dict[int, Vector], Vector, float]] = []
        self._rows: list[tuple[dict[int, Vector], Vector, Vector]] = []

    def variables(self, count: int) -> slice:
        block = slice(self._size, self._size + count)
        self._size += count
        return block

    def cost(self, terms: list[tuple[slice, Vector]], target: Vector | float, weight: float) -> None:
        """½ weight |Σ A_i x_i − target|²."""
        self._terms.append((self._columns(terms), np.atleast_1d(target), weight))

    def bound(self, terms: list[tuple[slice, Vector]], lower: Vector | float, upper: Vector | float) -> None:
        """lower ≤ Σ A_i x_i ≤ upper."""
        rows = np.atleast_2d(terms[0][1]).shape[0]
        self._rows.append((self._columns(terms), np.broadcast_to(lower, rows), np.broadcast_to(upper, rows)))

    def soft_bound(self, terms: list[tuple[slice, Vector]], lower: Vector, upper: Vector, weight: float) -> None:
        """The same with a slack of price ½ weight s² per row."""
        rows = np.atleast_2d(terms[0][1]).shape[0]
        slack = self.variables(rows)
        self.bound([*terms, (slack, np.eye(rows))], lower, upper)
        self.cost([(slack, np.eye(rows))], np.zeros(rows), weight)

    def axis(self, state: Vector, *, steps: int, step: float) -> tuple[slice, slice, slice, slice]:
        """One CoM axis: jerks, positions, velocities, accelerations, tied by [M] eq. state-eq step by step."""
        A = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
        B = np.array([step**3 / 6, step**2 / 2, step])
        jerk, c, dc, ddc = (self.variables(steps) for _ in range(4))
        for k in range(steps):
            for row, block in enumerate((c, dc, ddc)):
                terms = [(_one(block, k), np.eye(1)), (_one(jerk, k), np.array([[-B[row]]]))]
                known = float(A[row] @ state) if k == 0 else 0.0
                if k > 0:
                    terms += [(_one(b, k - 1), np.array([[-A[row, j]]])) for j, b in enumerate((c, dc, ddc))]
                self.bound(terms, known, known)
        return jerk, c, dc, ddc

    def solve(self) -> tuple[Vector, float]:
        """Minimiser and ½ Σ w |…|² at it.

        Raises:
            AssertionError: OSQP did not solve it to 1e-9.
        """
        n = self._size
        H, g, constant = sp.csc_matrix((n, n)), np.zeros(n), 0.0
        for columns, target, weight in self._terms:
            A = _assemble(columns, n)
            H, g = H + weight * A.T @ A, g - weight * (A.T @ target)
            constant += 0.5 * weight * float(target @ target)
        A = sp.vstack([_assemble(columns, n) for columns, _, _ in self._rows]).tocsc()
        lower = np.concatenate([low for _, low, _ in self._rows])
        upper = np.concatenate([high for _, _, high in self._rows])
        solver = osqp.OSQP()
        scale = 1.0 / max(abs(H).max(), 1.0)
        solver.setup(
            P=sp.triu(H * scale).tocsc(), q=g * scale, A=A, l=lower, u=upper, verbose=False, eps_abs=1e-9, eps_rel=1e-9,
            max_iter=200_000, polishing=True, adaptive_rho_interval=50, scaling=20, check_termination=50,
        )  # fmt: skip
        result = solver.solve(raise_error=False)
        self.status = result.info.status
        if result.info.status != "solved":
            raise AssertionError(f"the reference itself failed: {result.info.status}")
        x = result.x
        return x, float(0.5 * x @ (H @ x) + g @ x + constant)

    @staticmethod
    def _columns(terms: list[tuple[slice, Vector]]) -> dict[int, Vector]:
        return {block.start: np.atleast_2d(A) for block, A in terms}


def _one(block: slice, k: int) -> slice:
    return slice(block.start + k, block.start + k + 1)


def _assemble(columns: dict[int, Vector], n: int) -> sp.csc_matrix:
    rows = next(iter(columns.values())).shape[0]
    out = sp.lil_matrix((rows, n))
    for start, A in columns.items():
        out[:, start : start + A.shape[1]] = A
    return out.tocsc()
