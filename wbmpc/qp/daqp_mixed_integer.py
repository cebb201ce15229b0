"""DAQP's own branch and bound over binary variables."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbmpc.qp.daqp_workspace import solve_cold
from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus

_BINARY = 16  # bit of daqp's constraint sense
_CONVEXITY = 1e-3  # share of the largest diagonal entry of H
_INTEGRALITY = 1e-5  # distance of a solution's binaries from 0 or 1


class DaqpMixedInteger:
    """Exact MIQP, set up anew at each solve: stage 3 fires rarely, and so no answer depends on an earlier one.

    H may be singular in the binaries (a purely linear cost): since x² = x there, ½ d (x² - x) adds nothing to the cost
    and makes the relaxation strictly convex, which daqp needs.

    Soft rows become slack variables: with its own soft rows, daqp 0.11 now and then calls a fractional point of an
    infeasible problem optimal. It bounds the iterations of each node but offers no limit on nodes; with a row
    Σ x_j ≤ s over K binaries the tree has of the order of K^s nodes.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        self._form = SlackForm(problem)

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`; `matrices_changed` makes no difference here."""
        start = perf_counter()
        problem, form, binary = self.problem, self._form, self.problem.binary
        defect = problem.defect()
        if defect is not None:
            return failed(problem, defect, 0, perf_counter() - start)
        form.refresh()
        shift = _CONVEXITY * max(problem.hessian.diagonal().max(initial=0.0), 1e-6)
        form.hessian[binary, binary] += shift
        form.gradient[binary] -= 0.5 * shift
        # A binary's own bounds may fix it, or leave it no value at all.
        form.all_lower[binary], form.all_upper[binary] = lower, upper = problem.binary_range()
        if (lower > upper).any():
            return failed(problem, SolveStatus.INFEASIBLE, 0, perf_counter() - start)
        sense = np.zeros(form.all_lower.size, dtype=np.intc)
        sense[binary] = np.where(lower < upper, _BINARY, 0)
        _, z, status, iterations = solve_cold(form, sense)
        if status is SolveStatus.SOLVED and (abs(z[binary] - np.rint(z[binary])) > _INTEGRALITY).any():
            status = SolveStatus.NUMERICAL_ERROR
        if status is not SolveStatus.SOLVED:
            return failed(problem, status, iterations, perf_counter() - start)
        z[binary] = np.rint(z[binary]) + 0.0  # no -0.0
        return QpSolution(z[: problem.variables].copy(), status, iterations, perf_counter() - start)
