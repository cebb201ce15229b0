"""DAQP, a dual active-set solver: the default backend of every stage."""

from __future__ import annotations

import math
from time import perf_counter

import daqp
import numpy as np
from numpy.typing import NDArray

from wbmpc.qp.active_set import examine_and_guess
from wbmpc.qp.problem import DEFECTS, QuadraticProgram
from wbmpc.qp.slack_form import SlackForm
from wbmpc.qp.solution import QpSolution, failed
from wbmpc.qp.verdicts import closes_duality_gap
from wbmpc.signals import SolveStatus, Vector

ITERATION_LIMIT = 2000
# Pivots below sing_tol mark dependent active rows; primal_tol is the violation of a row scaled to unit norm in the
# metric of H⁻¹. The other sets are for ill-conditioned problems, on which the first makes daqp cycle or call a feasible
# problem infeasible.
TOLERANCES = (
    {"sing_tol": 1e-9, "primal_tol": 1e-8},
    {"sing_tol": 1e-11, "primal_tol": 1e-6},
    {"sing_tol": 1e-7, "primal_tol": 1e-6},
)
DUALITY_GAP = 1e-6  # relative; an honest optimum has about 1e-9
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

    The active set of the last solve is tried first, in one compiled call: mostly it, or one near it, is the optimum's
    again, and the 20 to 40 µs that handing the data to daqp takes are saved. A failure from a warm start is confirmed
    by one cold start before it is reported, so that a bad history costs time and never a solution.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self.problem = problem
        self._sense = soft_sense(problem)
        self._reciprocal = soft_reciprocal(problem)
        self._softness = np.zeros(problem.rows)
        self._softness[problem.soft_rows] = 1.0 / problem.soft_weight[problem.soft_rows]
        self._active = np.zeros(problem.all_lower.size, dtype=np.int8)
        self._factor, self._factored = np.zeros_like(problem.hessian), False  # of the last solve's active set
        self._model: daqp.Model | None = None  # None: nothing to warm-start from
        self._stale = False  # the model has not seen the matrices of the last solve

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`."""
        start = perf_counter()
        problem, x = self.problem, np.empty_like(self.problem.gradient)
        verdict, rounds = examine_and_guess(
            *(problem.hessian, problem.gradient, problem.matrix, problem.all_lower, problem.all_upper),
            *(self._softness, self._active, self._factor, self._factored and not matrices_changed),
            *(matrices_changed or self._model is None, x),
        )
        self._factored = rounds > 0
        defect = DEFECTS[verdict]
        if defect is not None:
            if matrices_changed:
                self._model = None  # its factorisation no longer belongs to the matrices
            return failed(problem, defect, 0, perf_counter() - start)
        self._stale |= matrices_changed
        if rounds:
            return QpSolution(x, SolveStatus.SOLVED, rounds, perf_counter() - start)
        if self._model is not None:
            # Without `sense`, update keeps the last active set; with it daqp starts cold.
            if self._stale:
                self._stale = False
                matrix = problem.matrix if problem.rows else None  # the wrapper cannot update an empty matrix
                flag = self._model.update(
                    problem.hessian, problem.gradient, matrix, problem.all_upper, problem.all_lower
                )
            else:
                flag = self._model.update(f=problem.gradient, bupper=problem.all_upper, blower=problem.all_lower)
            if flag >= 0:
                x, cost, flag, info = self._model.solve()
                if _status(flag, x) is SolveStatus.SOLVED and self._is_optimal(x, cost, info["lam"]):
                    np.sign(info["lam"], out=self._active, casting="unsafe")
                    return QpSolution(x, SolveStatus.SOLVED, info["iterations"], perf_counter() - start)
        model, x, status, iterations = solve_cold(problem, self._sense, self._reciprocal)
        self._model, self._stale = model if status is SolveStatus.SOLVED else None, False
        if status is SolveStatus.SOLVED:
            return QpSolution(x, status, iterations, perf_counter() - start)
        return failed(problem, status, iterations, perf_counter() - start)

    def _is_optimal(self, x: Vector, cost: float, multiplier: Vector) -> bool:
        """Whether the duality gap closes: 2 f(x) - gᵀ x + λᵀ b = 0, b the bound on the side of λ's sign.

        (For x = the minimiser of the Lagrangian, xᵀ H x + gᵀ x + λᵀ C x = 0; the soft rows' terms cancel.) After a
        large change of the data, a warm-started daqp 0.11 now and then stops at once with multipliers of the wrong
        sign: feasible, far from optimal, and reported as optimal.
        """
        problem = self.problem
        return closes_duality_gap(
            *(x, cost, multiplier, problem.gradient, problem.all_lower, problem.all_upper, DUALITY_GAP)
        )


def soft_sense(problem: QuadraticProgram) -> NDArray[np.intc]:
    """daqp's constraint flags (n + m,): soft rows marked, everything else an inequality."""
    sense = np.zeros(problem.all_lower.size, dtype=np.intc)
    sense[problem.variables + problem.soft_rows] = _SOFT
    return sense


def soft_reciprocal(problem: QuadraticProgram) -> Vector | None:
    """1 / w of the soft rows (n + m,), None without any. Weights of single rows are exact; the setting rho_soft would
    count in rows scaled to unit norm."""
    if not problem.soft_rows.size:
        return None
    reciprocal = np.zeros(problem.all_lower.size)
    reciprocal[problem.variables + problem.soft_rows] = 1.0 / problem.soft_weight[problem.soft_rows]
    return reciprocal


def solve_cold(
    data: QuadraticProgram | SlackForm, sense: NDArray[np.intc], reciprocal: Vector | None = None
) -> tuple[daqp.Model, Vector, SolveStatus, int]:
    """Solve with a fresh model: the model, x (meaningless unless SOLVED), status and iterations.

    daqp 0.11 allocates its working set for n + 1 constraints and one more for each soft row, but on nearly infeasible
    problems it activates more and writes past the end. So the model is set up on a trivial problem whose rows are all
    soft, which leaves room for every constraint, and the real data and flags follow as an update.
    """
    for tolerances in TOLERANCES:
        model, x, status, iterations = _solve_fresh(data, sense, reciprocal, tolerances)
        if status is SolveStatus.SOLVED:
            break
    return model, x, status, iterations


def _solve_fresh(
    data: QuadraticProgram | SlackForm, sense: NDArray[np.intc], reciprocal: Vector | None, tolerances: dict[str, float]
) -> tuple[daqp.Model, Vector, SolveStatus, int]:
    variables, rows = data.gradient.size, data.matrix.shape[0]
    model = daqp.Model()
    model.settings = {"iter_limit": ITERATION_LIMIT, **tolerances}
    roomy = sense.copy()
    roomy[variables:] |= _SOFT
    unit = np.ones(variables + rows)
    model.setup(np.eye(variables), np.zeros(variables), np.zeros((rows, variables)), unit, np.zeros_like(unit), roomy)
    matrix = data.matrix if rows else None  # the wrapper cannot update an empty matrix
    flag = model.update(data.hessian, data.gradient, matrix, data.all_upper, data.all_lower, sense)
    if flag < 0:
        return model, data.gradient, _STATUS.get(flag, SolveStatus.NUMERICAL_ERROR), 0
    if reciprocal is not None:
        model.soft_weights(rho_l=reciprocal, rho_u=reciprocal)
    x, _, flag, info = model.solve()
    return model, x, _status(flag, x), info["iterations"]


def _status(flag: int, x: Vector) -> SolveStatus:
    """daqp's exit flag as a status; daqp can report an optimum that is not finite."""
    status = _STATUS.get(flag, SolveStatus.NUMERICAL_ERROR)
    if status is SolveStatus.SOLVED and not math.isfinite(x.dot(x)):
        return SolveStatus.NUMERICAL_ERROR
    return status
