"""HiGHS: exact mixed-integer QP by outer approximation, the independent cross-check of DAQP's branch and bound.

HiGHS takes a Hessian or integers, not both. So alternate (Duran and Grossmann, 1986):
  master  minimise t over the rows, the binaries and the cuts  t >= f(z_k) + ∇f(z_k)ᵀ (z - z_k)   -> lower bound
  QP      minimise f with the master's binaries fixed, giving the next z_k                         -> upper bound
until the bounds meet. Each assignment of the binaries is tried at most once, since its own cut makes the master's
value there the QP's, so the method ends.
"""

from __future__ import annotations

from time import perf_counter

import highspy
import numpy as np

from wbmpc.qp.highs_models import FixedQp, build_master, run
from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus, Vector

_GAP = 1e-7  # relative gap between the bounds at which the best solution is the optimum


class HighsOuterApproximation:
    """Exact MIQP over highspy. Bounded by nodes, iterations and rounds, never by time: the same on every machine."""

    def __init__(self, problem: QuadraticProgram, *, node_limit: int = 20_000, round_limit: int = 500) -> None:
        self.problem = problem
        self._form = SlackForm(problem)
        self._node_limit = node_limit
        self._round_limit = round_limit

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`; nothing is kept between solves. `iterations` counts the masters solved."""
        start = perf_counter()
        problem, form, binary = self.problem, self._form, self.problem.binary
        defect = problem.defect()
        if defect is not None:
            return failed(problem, defect, 0, perf_counter() - start)
        form.refresh()
        form.all_lower[binary], form.all_upper[binary] = lower, upper = problem.binary_range()
        if (lower > upper).any():
            return failed(problem, SolveStatus.INFEASIBLE, 0, perf_counter() - start)
        status, best, rounds = self._approximate()
        if best is None:
            return failed(problem, status, rounds, perf_counter() - start)
        best[binary] = np.rint(best[binary]) + 0.0  # no -0.0
        return QpSolution(best[: problem.variables].copy(), status, rounds, perf_counter() - start)

    def _approximate(self) -> tuple[SolveStatus, Vector | None, int]:
        """Status, optimal z or None, and rounds."""
        form, binary = self._form, self.problem.binary
        try:
            qp = FixedQp(form)
            floor = self._floor()
        except np.linalg.LinAlgError:
            return SolveStatus.NUMERICAL_ERROR, None, 0
        status, z = qp.solve()
        if status is SolveStatus.INFEASIBLE or not binary.size:
            return status, z if status is SolveStatus.SOLVED else None, 0
        master = build_master(form, binary, node_limit=self._node_limit, gap=0.1 * _GAP)
        master.changeColBounds(form.variables, floor, np.inf)
        if status is SolveStatus.SOLVED:  # a good first cut; the floor alone would do
            self._add_cut(master, z)
        best, best_cost = None, np.inf
        tried: set[bytes] = set()
        for rounds in range(1, self._round_limit + 1):
            status, z = run(master, form.variables + 1)
            if status is not SolveStatus.SOLVED:
                return status, None, rounds
            assignment = np.rint(z[binary])
            key = assignment.astype(np.int8).tobytes()
            if key in tried or (best is not None and best_cost - z[-1] <= _GAP * (1.0 + abs(best_cost))):
                return SolveStatus.SOLVED, best, rounds
            tried.add(key)
            qp.fix(binary, assignment)
            status, z = qp.solve()
            if status is not SolveStatus.SOLVED:
                # The master found a point with these binaries: a refusal here is HiGHS' failure, not the problem's.
                return SolveStatus.NUMERICAL_ERROR, None, rounds
            cost = self._cost(z)
            if cost < best_cost:
                best, best_cost = z, cost
            self._add_cut(master, z)
        return SolveStatus.ITERATION_LIMIT, None, self._round_limit

    def _floor(self) -> float:
        """A lower bound of f: its minimum without constraints, after adding ½ (x² - x) = 0 for each binary x."""
        hessian, gradient = self._form.hessian.copy(), self._form.gradient.copy()
        hessian[self.problem.binary, self.problem.binary] += 1.0
        gradient[self.problem.binary] -= 0.5
        return -0.5 * float(gradient @ np.linalg.solve(hessian, gradient))

    def _cost(self, z: Vector) -> float:
        return float(0.5 * z @ self._form.hessian @ z + self._form.gradient @ z)

    def _add_cut(self, master: highspy.Highs, z: Vector) -> None:
        """∇f(z_k)ᵀ z - t <= ∇f(z_k)ᵀ z_k - f(z_k)."""
        slope = self._form.hessian @ z + self._form.gradient
        row = np.append(slope, -1.0)
        indices = np.arange(row.size, dtype=np.int32)
        master.addRow(-highspy.kHighsInf, float(slope @ z) - self._cost(z), row.size, indices, row)
