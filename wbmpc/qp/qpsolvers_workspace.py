"""Any solver that qpsolvers knows: for comparison, not for the hot loop (it sets up anew at every call)."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import Any

import numpy as np
import qpsolvers
from scipy import optimize, sparse

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus, Vector

# Solvers whose default accuracy (1e-3) is too coarse to compare with the others.
_SETTINGS: dict[str, dict[str, Any]] = {
    "osqp": {"eps_abs": 1e-7, "eps_rel": 1e-7, "polishing": True, "max_iter": 20_000, "adaptive_rho": 1},
}


def installed_solvers() -> list[str]:
    """The solvers that qpsolvers finds in this environment."""
    return sorted(qpsolvers.available_solvers)


class QpsolversWorkspace:
    """A one-shot `qpsolvers.solve_problem` behind the workspace protocol, warm-started with the last x."""

    def __init__(self, problem: QuadraticProgram, solver: str) -> None:
        self.problem = problem
        self._solver = solver
        self._form = SlackForm(problem)
        self._last: Vector | None = None

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`. A linear program tells infeasible problems from failures of the solver."""
        start = perf_counter()
        defect = self.problem.defect()
        if defect is not None:
            return failed(self.problem, defect, 0, perf_counter() - start)
        self._form.refresh()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what they say arrives as a status
                solution = qpsolvers.solve_problem(
                    self._build(), solver=self._solver, initvals=self._last, **_SETTINGS.get(self._solver, {})
                )
            z = solution.x if solution.found else None
        except (qpsolvers.exceptions.QPError, ValueError, ArithmeticError):  # each wrapped solver has its own
            z = None
        if z is None or not np.isfinite(z).all():
            self._last = None
            status = SolveStatus.NUMERICAL_ERROR if self._feasible() else SolveStatus.INFEASIBLE
            return failed(self.problem, status, 0, perf_counter() - start)
        self._last = z
        return QpSolution(z[: self.problem.variables].copy(), SolveStatus.SOLVED, 0, perf_counter() - start)

    def _build(self) -> qpsolvers.Problem:
        form, total = self._form, self._form.variables
        lower, upper = form.all_lower[total:], form.all_upper[total:]
        equal = lower == upper
        above, below = ~equal & np.isfinite(upper), ~equal & np.isfinite(lower)
        inequality = np.vstack([form.matrix[above], -form.matrix[below]])
        bound = np.concatenate([upper[above], -lower[below]])
        dense = self._solver in qpsolvers.dense_solvers
        convert = np.ascontiguousarray if dense else sparse.csc_matrix
        return qpsolvers.Problem(
            convert(form.hessian),
            form.gradient,
            convert(inequality) if bound.size else None,
            bound if bound.size else None,
            convert(form.matrix[equal]) if equal.any() else None,
            lower[equal] if equal.any() else None,
            form.all_lower[:total],
            form.all_upper[:total],
        )

    def _feasible(self) -> bool:
        form, total = self._form, self._form.variables
        rows = optimize.LinearConstraint(form.matrix, form.all_lower[total:], form.all_upper[total:])
        bounds = optimize.Bounds(form.all_lower[:total], form.all_upper[:total])
        constraints = [rows] if self.problem.rows else []
        result = optimize.milp(np.zeros(total), bounds=bounds, constraints=constraints)
        return result.status != 2  # 2: infeasible
