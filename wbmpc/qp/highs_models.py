"""HiGHS models of a problem: its continuous QP and the mixed-integer master of an outer approximation."""

from __future__ import annotations

import highspy
import numpy as np
from numpy.typing import NDArray

from wbmpc.qp.slack_form import SlackForm
from wbmpc.signals import SolveStatus, Vector

_STATUS = {
    highspy.HighsModelStatus.kOptimal: SolveStatus.SOLVED,
    highspy.HighsModelStatus.kInfeasible: SolveStatus.INFEASIBLE,
    highspy.HighsModelStatus.kSolutionLimit: SolveStatus.ITERATION_LIMIT,
    highspy.HighsModelStatus.kIterationLimit: SolveStatus.ITERATION_LIMIT,
}
_SINGULAR = 1e-12  # eigenvalues below this share of the largest count as zero


def build_qp(form: SlackForm) -> highspy.Highs | None:
    """minimise ½ |y|² + gᵀ z  subject to the form's rows and y = F z, where H = Fᵀ F. None when H is indefinite.

    HiGHS' active-set QP fails on about 1 % of small problems with a dense Hessian, and on none in this factored form.
    """
    eigenvalues, vectors = np.linalg.eigh(form.hessian)
    scale = max(abs(eigenvalues).max(), np.finfo(float).tiny)
    if eigenvalues.min() < -1e-9 * scale:
        return None
    kept = eigenvalues > _SINGULAR * scale
    factor = np.sqrt(eigenvalues[kept])[:, None] * vectors[:, kept].T  # (rank, N)
    rank, total = factor.shape
    rows = np.block([[form.matrix, np.zeros((form.matrix.shape[0], rank))], [factor, -np.eye(rank)]])
    zero, free = np.zeros(rank), np.full(rank, np.inf)
    model = highspy.HighsModel()
    model.lp_ = _linear_program(
        rows,
        cost=np.append(form.gradient, zero),
        column_bounds=(np.append(form.all_lower[:total], -free), np.append(form.all_upper[:total], free)),
        row_bounds=(np.append(form.all_lower[total:], zero), np.append(form.all_upper[total:], zero)),
    )
    model.hessian_.dim_ = total + rank
    model.hessian_.format_ = highspy.HessianFormat.kTriangular
    model.hessian_.start_ = np.concatenate([np.zeros(total), np.arange(rank + 1)]).astype(np.int32)
    model.hessian_.index_ = np.arange(total, total + rank, dtype=np.int32)
    model.hessian_.value_ = np.ones(rank)
    solver = _quiet_solver()
    solver.setOptionValue("qp_iteration_limit", 20_000)
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
