"""DAQP, a dual active-set solver: the default backend of every stage."""

from __future__ import annotations

import math
from time import perf_counter

import daqp
import numpy as np
from numpy.typing import NDArray

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus, Vector

ITERATION_LIMIT = 2000
PRIMAL_TOLERANCE = 1e-8  # violation of a row scaled to unit norm in the metric of H⁻¹
_SOFT = 8  # bit of daqp's constraint sense
_STATUS = {
    1: SolveStatus.SOLVED,
    2: SolveStatus.SOLVED,  # optimal with a soft row violated
    -1: SolveStatus.INFEASIBLE,
    -2: SolveStatus.NUMERICAL_ERROR,  # cycling
    -3: SolveStatus.NUMERICAL_ERROR,  # unbounded
    -4: SolveStatus.ITERATION_LIMIT,
    -5: SolveStatus.NUMERICAL_ERROR,  # Hessian not positive definite
    -6: SolveStatus.INFEASIBLE,  # equalities that contradict each other; redundant ones are dropped
}


class DaqpWorkspace:
    """One persistent `daqp.Model`: `update` keeps memory and active set (see benchmarks/qp_backends.py).

    A failure from a warm start is confirmed by one cold start before it is reported, so that a bad history costs time
    and never a solution.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        self._sense = soft_sense(problem)
        self._model: daqp.Model | None = None  # None: nothing to warm-start from

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`."""
        start = perf_counter()
        problem = self.problem
        defect = problem.defect(matrices_changed=matrices_changed or self._model is None)
        if defect is not None:
            if matrices_changed:
                self._model = None  # its factorisation no longer belongs to the matrices
            return failed(problem, defect, 0, perf_counter() - start)
        if self._model is not None:
            # Without `sense`, update keeps the last active set; with it daqp starts cold.
            if matrices_changed:
                flag = self._model.update(
                    problem.hessian, problem.gradient, problem.matrix, problem.all_upper, problem.all_lower
                )
            else:
                flag = self._model.update(f=problem.gradient, bupper=problem.all_upper, blower=problem.all_lower)
            if flag >= 0:
                x, _, flag, info = self._model.solve()
                if _status(flag, x) is SolveStatus.SOLVED:
                    return QpSolution(x, SolveStatus.SOLVED, info["iterations"], perf_counter() - start)
        model, x, status, iterations = solve_cold(problem, self._sense)
        self._model = model if status is SolveStatus.SOLVED else None
        if status is SolveStatus.SOLVED:
            return QpSolution(x, status, iterations, perf_counter() - start)
        return failed(problem, status, iterations, perf_counter() - start)


def soft_sense(problem: QuadraticProgram) -> NDArray[np.intc]:
    """daqp's constraint flags (n + m,): soft rows marked, everything else an inequality."""
    sense = np.zeros(problem.all_lower.size, dtype=np.intc)
    sense[problem.variables + problem.soft_rows] = _SOFT
    return sense


def solve_cold(problem: QuadraticProgram, sense: NDArray[np.intc]) -> tuple[daqp.Model, Vector, SolveStatus, int]:
    """Set up a fresh model and solve it: the model, x (meaningless unless SOLVED), status and iterations."""
    model = daqp.Model()
    model.settings = {"iter_limit": ITERATION_LIMIT, "primal_tol": PRIMAL_TOLERANCE}
    flag, _ = model.setup(
        problem.hessian, problem.gradient, problem.matrix, problem.all_upper, problem.all_lower, sense
    )
    if flag < 0:
        return model, problem.gradient, _STATUS.get(flag, SolveStatus.NUMERICAL_ERROR), 0
    if problem.soft_rows.size:
        # The weights of single rows are exact; the setting rho_soft would count in rows scaled to unit norm.
        rho = np.zeros(problem.all_lower.size)
        rho[problem.variables + problem.soft_rows] = 1.0 / problem.soft_weight[problem.soft_rows]
        model.soft_weights(rho_l=rho, rho_u=rho)
    x, _, flag, info = model.solve()
    return model, x, _status(flag, x), info["iterations"]


def _status(flag: int, x: Vector) -> SolveStatus:
    """daqp's exit flag as a status; daqp can report an optimum that is not finite."""
    status = _STATUS.get(flag, SolveStatus.NUMERICAL_ERROR)
    if status is SolveStatus.SOLVED and not math.isfinite(x.dot(x)):
        return SolveStatus.NUMERICAL_ERROR
    return status
