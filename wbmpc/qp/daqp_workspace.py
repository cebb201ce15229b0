"""DAQP: dual active-set QP, and branch and bound over binaries. The default backend of every stage."""

from __future__ import annotations

import math
from time import perf_counter

import daqp
import numpy as np

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus

_SOFT, _BINARY, _EQUALITY = 8, 16, 5  # bits of daqp's constraint sense
_STATUS = {
    2: SolveStatus.SOLVED,  # optimal with a soft row violated
    1: SolveStatus.SOLVED,
    -1: SolveStatus.INFEASIBLE,
    -2: SolveStatus.NUMERICAL_ERROR,  # cycling
    -3: SolveStatus.NUMERICAL_ERROR,  # unbounded
    -4: SolveStatus.ITERATION_LIMIT,
    -5: SolveStatus.NUMERICAL_ERROR,  # Hessian not positive definite
    -6: SolveStatus.NUMERICAL_ERROR,  # initial working set overdetermined
}


class DaqpWorkspace:
    """One persistent `daqp.Model`: `update` keeps memory and active set (see benchmarks/qp_backends.py).

    A failure from a warm start is confirmed by one cold start before it is reported, so that a bad history costs time
    and never a solution.
    """

    def __init__(self, problem: QuadraticProgram, *, iteration_limit: int = 2000, tolerance: float = 1e-8) -> None:
        """`tolerance` bounds the violation of rows scaled to unit norm in the metric of H⁻¹."""
        self.problem = problem
        self._iteration_limit = iteration_limit
        self._tolerance = tolerance
        self._sense = np.zeros(problem.all_lower.size, dtype=np.intc)
        self._sense[problem.variables + problem.soft_rows] = _SOFT
        # Reciprocal weights; rows that are not soft keep daqp's default, which they never use.
        self._rho = np.zeros(problem.all_lower.size)
        self._rho[problem.variables + problem.soft_rows] = 1.0 / problem.soft_weight[problem.soft_rows]
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
            if matrices_changed:
                flag = self._model.update(
                    problem.hessian, problem.gradient, problem.matrix, problem.all_upper, problem.all_lower
                )
            else:
                flag = self._model.update(f=problem.gradient, bupper=problem.all_upper, blower=problem.all_lower)
            if flag >= 0:
                x, _, flag, info = self._model.solve()
                if flag > 0 and math.isfinite(x.dot(x)):
                    return QpSolution(x, SolveStatus.SOLVED, info["iterations"], perf_counter() - start)
        return self._solve_cold(start)

    def _solve_cold(self, start: float) -> QpSolution:
        problem = self.problem
        self._model = None
        model = daqp.Model()
        model.settings = {"iter_limit": self._iteration_limit, "primal_tol": self._tolerance}
        iterations = 0
        flag, _ = model.setup(
            problem.hessian, problem.gradient, problem.matrix, problem.all_upper, problem.all_lower, self._start_sense()
        )
        if flag >= 0:
            if problem.soft_rows.size:
                model.soft_weights(rho_l=self._rho, rho_u=self._rho)
            x, _, flag, info = model.solve()
            iterations = info["iterations"]
            if flag > 0 and math.isfinite(x.dot(x)):
                if not problem.binary.size:  # branch and bound leaves no state worth a warm start
                    self._model = model
                return QpSolution(x, SolveStatus.SOLVED, iterations, perf_counter() - start)
        status = _STATUS.get(flag, SolveStatus.NUMERICAL_ERROR) if flag < 0 else SolveStatus.NUMERICAL_ERROR
        return failed(problem, status, iterations, perf_counter() - start)

    def _start_sense(self) -> np.ndarray:
        """The sense flags of a cold start, a copy: daqp keeps the array."""
        sense = self._sense.copy()
        for index in self.problem.binary:
            fixed = self.problem.x_lower[index] == self.problem.x_upper[index]
            sense[index] = _EQUALITY if fixed else _BINARY
        return sense
