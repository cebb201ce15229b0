"""A tiny modelling layer over SciPy's NNLS, for problems written a second time: every quantity a variable."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, qr, solve_triangular
from scipy.optimize import lsq_linear, nnls

from wbmpc.signals import Vector

Terms = list[tuple[slice, Vector]]


class InfeasibleReference(Exception):
    """The constraints of a reference problem contradict each other."""


class ReferenceQp:
    """minimise ½ Σ w |Σ A x − b|² subject to lower ≤ Σ A x ≤ upper, with variables handed out in blocks of columns.

    Equalities are eliminated with an orthogonal basis; the rest is a least-distance problem, which Lawson and Hanson
    (1974, ch. 23) reduce to non-negative least squares: an exact active-set method that shares no code with the
    project's solvers.
    """

    def __init__(self) -> None:
        self._size = 0
        self._costs: list[tuple[Terms, Vector, float]] = []
        self._equalities: list[tuple[Terms, Vector]] = []
        self._rows: list[tuple[Terms, Vector]] = []  # Σ A x ≤ b

    def variables(self, count: int) -> slice:
        """Columns of `count` new variables."""
        self._size += count
        return slice(self._size - count, self._size)

    def cost(self, terms: Terms, target: Vector | float, weight: float) -> None:
        """½ weight |Σ A_i x_i − target|²."""
        self._costs.append((terms, np.atleast_1d(target), weight))

    def equal(self, terms: Terms, target: Vector | float) -> None:
        """Σ A_i x_i = target."""
        self._equalities.append((terms, np.atleast_1d(target)))

    def bound(self, terms: Terms, lower: Vector, upper: Vector) -> None:
        """lower ≤ Σ A_i x_i ≤ upper, ±inf where there is no bound."""
        self._rows.append((terms, np.asarray(upper)))
        self._rows.append(([(block, -A) for block, A in terms], -np.asarray(lower)))

    def soft_bound(self, terms: Terms, lower: Vector, upper: Vector, weight: float) -> None:
        """The same with a slack of price ½ weight s² per row."""
        rows = len(terms[0][1])
        slack = self.variables(rows)
        self.bound([*terms, (slack, np.eye(rows))], lower, upper)
        self.cost([(slack, np.eye(rows))], np.zeros(rows), weight)

    def axis(self, state: Vector, *, steps: int, step: float) -> tuple[slice, slice, slice, slice]:
        """One CoM axis: jerks, positions, velocities, accelerations, tied by [M] eq. state-eq step by step."""
        A = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
        B = np.array([step**3 / 6, step**2 / 2, step])
        jerk, *motion = (self.variables(steps) for _ in range(4))
        now, before = np.eye(steps), np.eye(steps, k=-1)
        for row, block in enumerate(motion):
            terms = [(block, now), (jerk, -B[row] * now)]
            terms += [(other, -A[row, j] * before) for j, other in enumerate(motion)]
            self.equal(terms, np.concatenate([[A[row] @ state], np.zeros(steps - 1)]))
        return jerk, *motion

    def solve(self) -> tuple[Vector, float]:
        """Minimiser and ½ Σ w |…|² at it.

        Raises:
            InfeasibleReference: no point satisfies the constraints.
        """
        F = np.vstack([np.sqrt(w) * self._dense(terms) for terms, _, w in self._costs])
        f = np.concatenate([np.sqrt(w) * target for _, target, w in self._costs])
        start, basis = np.zeros(self._size), np.eye(self._size)
        if self._equalities:
            E = np.vstack([self._dense(terms) for terms, _ in self._equalities])
            start = np.linalg.lstsq(E, np.concatenate([target for _, target in self._equalities]), rcond=None)[0]
            rank = np.linalg.matrix_rank(E)
            basis = qr(E.T)[0][:, rank:]
        FZ = F @ basis
        R = cholesky(FZ.T @ FZ)  # upper
        shift = solve_triangular(R, FZ.T @ (f - F @ start), trans="T")  # z = R y − shift
        y = solve_triangular(R, shift)
        if self._rows:
            G = np.vstack([self._dense(terms) for terms, _ in self._rows])
            h = np.concatenate([bound for _, bound in self._rows])
            kept = np.isfinite(h)
            G, h = G[kept], h[kept]
            slope = -solve_triangular(R, (G @ basis).T, trans="T").T  # rows of  slope z ≥ height
            height = G @ (start + basis @ y) - h
            scale = np.linalg.norm(slope, axis=1)
            if (height > 1e-12).any():
                y = y + solve_triangular(R, _least_distance(slope / scale[:, None], height / scale))
        x = start + basis @ y
        return x, 0.5 * float(np.sum((F @ x - f) ** 2))

    def _dense(self, terms: Terms) -> Vector:
        out = np.zeros((len(terms[0][1]), self._size))
        for block, A in terms:
            out[:, block] += A
        return out


def _least_distance(G: Vector, h: Vector) -> Vector:
    """The shortest z with G z ≥ h."""
    E = np.vstack([G.T, h])
    target = np.zeros(len(E))
    target[-1] = 1.0
    u, _ = nnls(E, target, maxiter=20 * len(h))
    if (E.T @ (target - E @ u)).max() > 1e-9:  # SciPy's nnls stops early at times, where constraints are degenerate
        u = lsq_linear(E, target, bounds=(0.0, np.inf), method="bvls", tol=1e-14, max_iter=20 * len(h)).x
    assert (E.T @ (target - E @ u)).max() < 1e-9, "the reference has no optimum to compare with"
    residual = E @ u - target
    if -residual[-1] < 1e-10:
        raise InfeasibleReference("no point satisfies the constraints")
    active = u > 0.0
    # the optimum with this active set, once more from its own equations: rounding of the division is gone
    return np.linalg.lstsq(G[active], h[active], rcond=None)[0]
