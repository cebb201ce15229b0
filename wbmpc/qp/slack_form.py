"""The same problem without soft rows, for solvers that know none: one signed slack per soft row."""

from __future__ import annotations

import numpy as np

from wbmpc.qp.problem import QuadraticProgram


class SlackForm:
    """z = (x, s): minimise ½ xᵀ H x + gᵀ x + ½ Σ w s²  subject to  lower <= A x + s <= upper.

    A quadratic penalty makes one signed slack per row as good as one for each side. Preallocated;
    `hessian` (N, N), `gradient` (N,), `matrix` (m, N), `all_lower` and `all_upper` (N + m,), variable bounds first,
    with N = n + number of soft rows.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        n, m, soft = problem.variables, problem.rows, problem.soft_rows
        self.variables = n + soft.size
        self.hessian = np.zeros((self.variables, self.variables))
        self.gradient = np.zeros(self.variables)
        self.matrix = np.zeros((m, self.variables))
        self.all_lower = np.full(self.variables + m, -np.inf)
        self.all_upper = np.full(self.variables + m, np.inf)
        slack = np.arange(n, self.variables)
        self.hessian[slack, slack] = problem.soft_weight[soft]
        self.matrix[soft, slack] = 1.0

    def refresh(self) -> None:
        """Copy the problem's present numbers."""
        problem, n, total = self.problem, self.problem.variables, self.variables
        self.hessian[:n, :n] = problem.hessian
        self.gradient[:n] = problem.gradient
        self.matrix[:, :n] = problem.matrix
        self.all_lower[:n], self.all_upper[:n] = problem.x_lower, problem.x_upper
        self.all_lower[total:], self.all_upper[total:] = problem.lower, problem.upper
