"""OSQP: operator splitting (ADMM), the independent cross-check of the default backend."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
import osqp
from scipy import sparse

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus, Vector

_STATUS = {
    osqp.SolverStatus.OSQP_SOLVED: SolveStatus.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: SolveStatus.ITERATION_LIMIT,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE: SolveStatus.INFEASIBLE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE: SolveStatus.ITERATION_LIMIT,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: SolveStatus.ITERATION_LIMIT,
}
_SETTINGS: dict[str, Any] = {
    "verbose": False,
    "eps_abs": 1e-7,
    "eps_rel": 1e-7,
    "eps_prim_inf": 1e-7,  # the default 1e-4 calls badly scaled feasible problems infeasible
    "max_iter": 20_000,
    "polishing": True,
    "adaptive_rho": 1,  # by iterations: adapting by time would make the answer depend on the machine's load
    "adaptive_rho_interval": 50,
}


class OsqpWorkspace:
    """One persistent OSQP solver: set up once with a dense sparsity pattern, so that any change of numbers fits."""

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        self._form = SlackForm(problem)
        n, total = problem.variables, self._form.variables
        hessian_pattern = np.eye(total)
        hessian_pattern[:n, :n] = 1.0
        rows_pattern = (self._form.matrix != 0.0).astype(float)
        rows_pattern[:, :n] = 1.0
        self._hessian = sparse.csc_matrix(np.triu(hessian_pattern))  # OSQP reads the upper triangle
        self._constraints = sparse.csc_matrix(np.vstack([np.eye(total), rows_pattern]))
        self._hessian_index = _dense_index(self._hessian)
        self._constraint_index = _dense_index(self._constraints)
        self._dense_constraints = np.vstack([np.eye(total), self._form.matrix])
        self._solver: Any = None

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`. After a failure the next solve starts cold."""
        start = perf_counter()
        problem, form = self.problem, self._form
        matrices_changed = matrices_changed or self._solver is None
        defect = problem.defect(matrices_changed=matrices_changed)
        if defect is not None:
            self._solver = None
            return failed(problem, defect, 0, perf_counter() - start)
        form.refresh()
        try:
            self._hand_over(matrices_changed)
            result = self._solver.solve(raise_error=False)
        except osqp.OSQPException:  # set-up refused, for example an indefinite Hessian
            self._solver = None
            return failed(problem, SolveStatus.NUMERICAL_ERROR, 0, perf_counter() - start)
        status = _STATUS.get(result.info.status_val, SolveStatus.NUMERICAL_ERROR)
        if status is not SolveStatus.SOLVED:
            self._solver = None
            return failed(problem, status, result.info.iter, perf_counter() - start)
        x: Vector = np.array(result.x[: problem.variables])
        return QpSolution(x, status, result.info.iter, perf_counter() - start)

    def _hand_over(self, matrices_changed: bool) -> None:
        form = self._form
        if matrices_changed:
            self._dense_constraints[form.variables :] = form.matrix
            self._hessian.data[:] = form.hessian[self._hessian_index]
            self._constraints.data[:] = self._dense_constraints[self._constraint_index]
        if self._solver is None:
            self._solver = osqp.OSQP()
            self._solver.setup(
                self._hessian, form.gradient, self._constraints, form.all_lower, form.all_upper, **_SETTINGS
            )
            return
        if matrices_changed:
            self._solver.update(Px=self._hessian.data, Ax=self._constraints.data)
        self._solver.update(q=form.gradient, l=form.all_lower, u=form.all_upper)


def _dense_index(matrix: sparse.csc_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of every stored entry, in storage order."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    return matrix.indices.copy(), columns
