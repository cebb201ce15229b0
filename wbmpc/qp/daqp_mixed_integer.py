"""DAQP's own branch and bound over binary variables."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbmpc.qp.daqp_workspace import soft_sense, solve_cold
from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus

_BINARY, _EQUALITY = 16, 5  # daqp's constraint sense
_CONVEXITY = 1e-3  # share of the largest diagonal entry of H


class DaqpMixedInteger:
    """Exact MIQP, set up anew at each solve: stage 3 fires rarely, and so no answer depends on an earlier one.

    H may be singular in the binaries (a purely linear cost): since x² = x there, ½ d (x² - x) adds nothing to the cost
    and makes the relaxation strictly convex, which daqp needs.

    daqp bounds the iterations of each node but offers no limit on nodes; with a row Σ x_j = 1 over K binaries the tree
    has at most about 2 K nodes.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        self._convex = QuadraticProgram(problem.variables, problem.rows, problem.soft_weight)

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`; `matrices_changed` makes no difference here."""
        start = perf_counter()
        problem, convex, binary = self.problem, self._convex, self.problem.binary
        defect = problem.defect()
        if defect is not None:
            return failed(problem, defect, 0, perf_counter() - start)
        convex.copy_from(problem)
        shift = _CONVEXITY * max(problem.hessian.diagonal().max(initial=0.0), 1e-6)
        convex.hessian[binary, binary] += shift
        convex.gradient[binary] -= 0.5 * shift
        convex.x_lower[binary], convex.x_upper[binary] = lower, upper = problem.binary_range()
        if (lower > upper).any():
            return failed(problem, SolveStatus.INFEASIBLE, 0, perf_counter() - start)
        sense = soft_sense(problem)
        sense[binary] = np.where(lower < upper, _BINARY, _EQUALITY)
        _, x, status, iterations = solve_cold(convex, sense)
        if status is not SolveStatus.SOLVED:
            return failed(problem, status, iterations, perf_counter() - start)
        x[binary] = np.rint(x[binary]) + 0.0  # no -0.0
        return QpSolution(x, status, iterations, perf_counter() - start)
