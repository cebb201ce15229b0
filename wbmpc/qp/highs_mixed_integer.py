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

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.signals import SolveStatus, Vector

_GAP = 1e-7  # relative gap between the bounds at which the best solution is the optimum
_STATUS = {
    highspy.HighsModelStatus.kOptimal: SolveStatus.SOLVED,
    highspy.HighsModelStatus.kInfeasible: SolveStatus.INFEASIBLE,
    highspy.HighsModelStatus.kSolutionLimit: SolveStatus.ITERATION_LIMIT,
    highspy.HighsModelStatus.kIterationLimit: SolveStatus.ITERATION_LIMIT,
}


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
        qp = self._build_qp()
        status, z = _run(qp, form.variables)  # its cut bounds t from below in the first master
        if status is not SolveStatus.SOLVED or not binary.size:
            return status, z if status is SolveStatus.SOLVED else None, 0
        master = self._build_master()
        self._add_cut(master, z)
        best, best_cost = None, np.inf
        tried: set[bytes] = set()
        for rounds in range(1, self._round_limit + 1):
            status, z = _run(master, form.variables + 1)
            if status is not SolveStatus.SOLVED:
                return status, None, rounds
            assignment = np.rint(z[binary])
            key = assignment.astype(np.int8).tobytes()
            if key in tried or (best is not None and best_cost - z[-1] <= _GAP * (1.0 + abs(best_cost))):
                return SolveStatus.SOLVED, best, rounds
            tried.add(key)
            indices = binary.astype(np.int32)
            qp.changeColsBounds(binary.size, indices, assignment, assignment)
            status, z = _run(qp, form.variables)
            if status is not SolveStatus.SOLVED:
                # The master found a point with these binaries: a refusal here is HiGHS' failure, not the problem's.
                return SolveStatus.NUMERICAL_ERROR, None, rounds
            cost = self._cost(z)
            if cost < best_cost:
                best, best_cost = z, cost
            self._add_cut(master, z)
        return SolveStatus.ITERATION_LIMIT, None, self._round_limit

    def _cost(self, z: Vector) -> float:
        return float(0.5 * z @ self._form.hessian @ z + self._form.gradient @ z)

    def _add_cut(self, master: highspy.Highs, z: Vector) -> None:
        """∇f(z_k)ᵀ z - t <= ∇f(z_k)ᵀ z_k - f(z_k)."""
        slope = self._form.hessian @ z + self._form.gradient
        row = np.append(slope, -1.0)
        indices = np.arange(row.size, dtype=np.int32)
        master.addRow(-highspy.kHighsInf, float(slope @ z) - self._cost(z), row.size, indices, row)

    def _build_qp(self) -> highspy.Highs:
        """minimise f over z, the binaries relaxed."""
        form = self._form
        model = highspy.HighsModel()
        model.lp_ = _linear_program(form, extra_columns=0)
        model.lp_.col_cost_ = form.gradient
        model.hessian_.dim_ = form.variables
        model.hessian_.format_ = highspy.HessianFormat.kTriangular  # the lower triangle, by columns
        columns, rows = np.nonzero(np.triu(form.hessian))  # H is symmetric: row-wise upper is column-wise lower
        model.hessian_.start_ = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=form.variables))])
        model.hessian_.index_ = rows
        model.hessian_.value_ = form.hessian[rows, columns]
        solver = _quiet_solver()
        solver.setOptionValue("qp_iteration_limit", 20_000)
        solver.passModel(model)
        return solver

    def _build_master(self) -> highspy.Highs:
        """minimise t over (z, t), binaries integer."""
        form = self._form
        program = _linear_program(form, extra_columns=1)
        program.col_cost_ = np.append(np.zeros(form.variables), 1.0)
        integrality = [highspy.HighsVarType.kContinuous] * program.num_col_
        for index in self.problem.binary:
            integrality[index] = highspy.HighsVarType.kInteger
        program.integrality_ = integrality
        solver = _quiet_solver()
        solver.setOptionValue("mip_max_nodes", self._node_limit)
        solver.setOptionValue("mip_rel_gap", 0.1 * _GAP)
        solver.setOptionValue("mip_abs_gap", 1e-9)
        solver.setOptionValue("mip_feasibility_tolerance", 1e-9)
        solver.passModel(program)
        return solver


def _quiet_solver() -> highspy.Highs:
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("parallel", "off")  # deterministic, and a core is all there is
    solver.setOptionValue("primal_feasibility_tolerance", 1e-9)
    solver.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return solver


def _linear_program(form: SlackForm, *, extra_columns: int) -> highspy.HighsLp:
    """Rows and bounds of the slack form, with free columns appended."""
    total = form.variables
    free = np.full(extra_columns, np.inf)
    rows, columns = np.nonzero(form.matrix)
    program = highspy.HighsLp()
    program.num_col_, program.num_row_ = total + extra_columns, form.matrix.shape[0]
    program.col_cost_ = np.zeros(total + extra_columns)
    program.col_lower_ = np.concatenate([form.all_lower[:total], -free])
    program.col_upper_ = np.concatenate([form.all_upper[:total], free])
    program.row_lower_, program.row_upper_ = form.all_lower[total:], form.all_upper[total:]
    program.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    program.a_matrix_.start_ = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=program.num_row_))])
    program.a_matrix_.index_ = columns
    program.a_matrix_.value_ = form.matrix[rows, columns]
    return program


def _run(solver: highspy.Highs, variables: int) -> tuple[SolveStatus, Vector]:
    """Status and the variables' values, which mean nothing unless SOLVED."""
    solver.run()
    status = _STATUS.get(solver.getModelStatus(), SolveStatus.NUMERICAL_ERROR)
    if status is not SolveStatus.SOLVED:
        return status, np.zeros(0)
    return status, np.array(solver.getSolution().col_value[:variables])
