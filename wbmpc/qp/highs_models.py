"""HiGHS models of a problem: its continuous QP and the mixed-integer master of an outer approximation."""

from __future__ import annotations

import highspy
import numpy as np
from numpy.typing import NDArray

from wbmpc.qp.osqp_workspace import OsqpWorkspace
from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.signals import SolveStatus, Vector

_STATUS = {
    highspy.HighsModelStatus.kOptimal: SolveStatus.SOLVED,
    highspy.HighsModelStatus.kInfeasible: SolveStatus.INFEASIBLE,
    highspy.HighsModelStatus.kSolutionLimit: SolveStatus.ITERATION_LIMIT,
    highspy.HighsModelStatus.kIterationLimit: SolveStatus.ITERATION_LIMIT,
}
_SINGULAR = 1e-12  # eigenvalues below this share of the largest count as zero


class FixedQp:
    """The QP with the binaries relaxed or fixed, in forms that are tried in turn.

    Factored: minimise ½ |y|² + gᵀ z with y = F z, where H = Fᵀ F.  Direct: H as it stands.  HiGHS' active-set solver
    fails now and then for no reason of the problem's: in the direct form on about 1 % of small problems with a dense
    H, in the factored one on about 5 % of those with a sparse H, in both on a few of ten thousand. OSQP takes those.
    """

    def __init__(self, form: SlackForm) -> None:
        """Raises numpy.linalg.LinAlgError when H is indefinite."""
        self._form = form
        self._fixed: tuple[NDArray[np.int32], Vector] | None = None
        self._factored = _factored_qp(form)
        self._direct: highspy.Highs | None = None  # built when first needed

    def fix(self, binary: NDArray[np.int64], values: Vector) -> None:
        """Give these variables these values."""
        self._fixed = (binary.astype(np.int32), values)

    def solve(self) -> tuple[SolveStatus, Vector]:
        """Status and z, empty unless SOLVED."""
        status, z = self._run(self._factored)
        if status is SolveStatus.SOLVED:
            return status, z
        if self._direct is None:
            self._direct = _direct_qp(self._form)
        status, z = self._run(self._direct)
        return (status, z) if status in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE) else self._run_osqp()

    def _run(self, solver: highspy.Highs) -> tuple[SolveStatus, Vector]:
        if self._fixed is not None:
            indices, values = self._fixed
            solver.changeColsBounds(indices.size, indices, values, values)
        return run(solver, self._form.variables)

    def _run_osqp(self) -> tuple[SolveStatus, Vector]:
        problem = QuadraticProgram(self._form.variables, self._form.problem.rows)
        for name in ("hessian", "gradient", "matrix", "all_lower", "all_upper"):
            getattr(problem, name)[...] = getattr(self._form, name)
        if self._fixed is not None:
            indices, values = self._fixed
            problem.x_lower[indices] = problem.x_upper[indices] = values
        solution = OsqpWorkspace(problem).solve()
        return solution.status, solution.x if solution.solved else np.zeros(0)


def _factored_qp(form: SlackForm) -> highspy.Highs:
    eigenvalues, vectors = np.linalg.eigh(form.hessian)
    scale = max(abs(eigenvalues).max(), np.finfo(float).tiny)
    if eigenvalues.min() < -1e-9 * scale:
        raise np.linalg.LinAlgError("the Hessian is indefinite")
    kept = eigenvalues > _SINGULAR * scale
    factor = np.sqrt(eigenvalues[kept])[:, None] * vectors[:, kept].T  # (rank, N)
    rank, total = factor.shape
    zero, free = np.zeros(rank), np.full(rank, np.inf)
    program = _linear_program(
        np.block([[form.matrix, np.zeros((form.matrix.shape[0], rank))], [factor, -np.eye(rank)]]),
        cost=np.append(form.gradient, zero),
        column_bounds=(np.append(form.all_lower[:total], -free), np.append(form.all_upper[:total], free)),
        row_bounds=(np.append(form.all_lower[total:], zero), np.append(form.all_upper[total:], zero)),
    )
    return _quadratic_solver(program, np.diag(np.append(np.zeros(total), np.ones(rank))))


def _direct_qp(form: SlackForm) -> highspy.Highs:
    total = form.variables
    program = _linear_program(
        form.matrix,
        cost=form.gradient,
        column_bounds=(form.all_lower[:total], form.all_upper[:total]),
        row_bounds=(form.all_lower[total:], form.all_upper[total:]),
    )
    return _quadratic_solver(program, form.hessian)


def _quadratic_solver(program: highspy.HighsLp, hessian: Vector) -> highspy.Highs:
    columns, rows = np.nonzero(np.triu(hessian))  # symmetric: the upper triangle by rows is the lower one by columns
    model = highspy.HighsModel()
    model.lp_ = program
    model.hessian_.dim_ = hessian.shape[0]
    model.hessian_.format_ = highspy.HessianFormat.kTriangular
    model.hessian_.start_ = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=hessian.shape[0]))])
    model.hessian_.index_ = rows
    model.hessian_.value_ = hessian[rows, columns]
    solver = _quiet_solver()
    solver.setOptionValue("qp_iteration_limit", 2000)  # it cycles on some problems
    solver.passModel(model)
    return solver


def build_master(form: SlackForm, binary: NDArray[np.int64], *, node_limit: int, gap: float) -> highspy.Highs:
    """minimise t over (z, t) subject to the form's rows, the binaries integer; cuts on t are added as rows."""
    total = form.variables
    program = _linear_program(
        np.column_stack([form.matrix, np.zeros(form.matrix.shape[0])]),
        cost=np.append(np.zeros(total), 1.0),
        column_bounds=(np.append(form.all_lower[:total], -np.inf), np.append(form.all_upper[:total], np.inf)),
        row_bounds=(form.all_lower[total:], form.all_upper[total:]),
    )
    integrality = [highspy.HighsVarType.kContinuous] * (total + 1)
    for index in binary:
        integrality[index] = highspy.HighsVarType.kInteger
    program.integrality_ = integrality
    solver = _quiet_solver()
    solver.setOptionValue("mip_max_nodes", node_limit)
    solver.setOptionValue("mip_rel_gap", gap)
    solver.setOptionValue("mip_abs_gap", 1e-9)
    solver.setOptionValue("mip_feasibility_tolerance", 1e-9)
    solver.passModel(program)
    return solver


def run(solver: highspy.Highs, variables: int) -> tuple[SolveStatus, Vector]:
    """Status and the first variables' values, which are empty unless SOLVED."""
    solver.run()
    status = _STATUS.get(solver.getModelStatus(), SolveStatus.NUMERICAL_ERROR)
    if status is not SolveStatus.SOLVED:
        return status, np.zeros(0)
    values = np.array(solver.getSolution().col_value[:variables])
    return (status, values) if np.isfinite(values).all() else (SolveStatus.NUMERICAL_ERROR, np.zeros(0))


def _quiet_solver() -> highspy.Highs:
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("parallel", "off")  # the same steps on every machine
    solver.setOptionValue("primal_feasibility_tolerance", 1e-9)
    solver.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return solver


def _linear_program(
    matrix: Vector, *, cost: Vector, column_bounds: tuple[Vector, Vector], row_bounds: tuple[Vector, Vector]
) -> highspy.HighsLp:
    rows, columns = np.nonzero(matrix)
    program = highspy.HighsLp()
    program.num_row_, program.num_col_ = matrix.shape
    program.col_cost_ = cost
    program.col_lower_, program.col_upper_ = column_bounds
    program.row_lower_, program.row_upper_ = row_bounds
    program.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    program.a_matrix_.start_ = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=matrix.shape[0]))])
    program.a_matrix_.index_ = columns
    program.a_matrix_.value_ = matrix[rows, columns]
    return program
