"""Stage 3's MIQP for each peer, through the peer's own Python interface. All use one thread.

A solver answers with the optimum, inf when it says infeasible, and the seconds of CPU that its own `optimize` took.
What happens around it, the hand-over of the filled arrays included, is timed by the caller.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any, Protocol

import gurobipy
import numpy as np
import pyscipopt
from scipy import sparse

from wbmpc.qp import QuadraticProgram, make_mip_workspace
from wbmpc.qp.slack_form import SlackForm
from wbmpc.signals import SolveStatus, Vector

GAP = 1e-6  # relative, asked of every solver that has a gap
TIME_LIMIT = 10.0  # [s] of the solvers that have one
_SIZE_LIMIT = 10010  # Gurobi's error: the model is too large for this licence


class Refused(Exception):
    """The solver does not take this problem."""


class Solver(Protocol):
    """A solver bound to one problem."""

    def solve(self) -> tuple[float, float]:
        """Optimum and seconds of CPU in the solver itself."""
        ...


class Own:
    """A workspace of the package: HiGHS by outer approximation, or daqp."""

    def __init__(self, problem: QuadraticProgram, backend: str) -> None:
        self._problem, self._workspace = problem, make_mip_workspace(backend, problem)

    def solve(self) -> tuple[float, float]:
        """See `Solver.solve`."""
        begin = process_time()
        solution = self._workspace.solve()
        seconds = process_time() - begin
        if solution.status is SolveStatus.SOLVED:
            return self._problem.objective(solution.x), seconds
        return (np.inf if solution.status is SolveStatus.INFEASIBLE else np.nan), seconds


class _Rows:
    """The rows of a problem in slack form, one-sided or equal, sparse: A z (=, <=) b."""

    def __init__(self, form: SlackForm) -> None:
        form.refresh()
        total = form.variables
        lower, upper = form.all_lower[total:], form.all_upper[total:]
        equal = lower == upper
        below, above = ~equal & np.isfinite(upper), ~equal & np.isfinite(lower)
        self.equal, self.target = sparse.csr_matrix(form.matrix[equal]), lower[equal]
        self.less = sparse.csr_matrix(np.vstack([form.matrix[below], -form.matrix[above]]))
        self.bound = np.concatenate([upper[below], -lower[above]])


class Gurobi:
    """The model is made once; rows, objective and bounds are replaced by those of the present problem."""

    def __init__(self, problem: QuadraticProgram) -> None:
        environment = gurobipy.Env(empty=True)
        for name, value in (("OutputFlag", 0), ("Threads", 1), ("MIPGap", GAP), ("TimeLimit", TIME_LIMIT)):
            environment.setParam(name, value)
        environment.start()
        self._form, self._model = SlackForm(problem), gurobipy.Model(env=environment)
        kinds = np.full(self._form.variables, gurobipy.GRB.CONTINUOUS)
        kinds[problem.binary] = gurobipy.GRB.BINARY
        self._z = self._model.addMVar(self._form.variables, vtype=kinds)
        self._rows: list[Any] = []

    def solve(self) -> tuple[float, float]:
        """See `Solver.solve`."""
        form, model, rows = self._form, self._model, _Rows(self._form)
        self._z.lb, self._z.ub = form.all_lower[: form.variables], form.all_upper[: form.variables]
        model.remove(self._rows)
        self._rows = [
            model.addMConstr(rows.equal, self._z, "=", rows.target),
            model.addMConstr(rows.less, self._z, "<", rows.bound),
        ]
        model.setMObjective(sparse.csr_matrix(0.5 * form.hessian), form.gradient, 0.0, sense=gurobipy.GRB.MINIMIZE)
        begin = process_time()
        try:
            model.optimize()
        except gurobipy.GurobiError as error:
            if error.errno == _SIZE_LIMIT:
                raise Refused("size") from None
            raise
        seconds = process_time() - begin
        if model.Status == gurobipy.GRB.OPTIMAL:
            return model.ObjVal, seconds
        infeasible = model.Status in (gurobipy.GRB.INFEASIBLE, gurobipy.GRB.INF_OR_UNBD)
        return (np.inf if infeasible else np.nan), seconds


class Scip:
    """A new model at every solve: SCIP takes a quadratic objective as a constraint t ≥ …, which it cannot change.

    One t for each knot of each option: of one t for all, SCIP's relaxation is much weaker.
    """

    def __init__(self, problem: QuadraticProgram) -> None:
        self._form = SlackForm(problem)

    def solve(self) -> tuple[float, float]:
        """See `Solver.solve`."""
        form, problem, rows = self._form, self._form.problem, _Rows(self._form)
        model = pyscipopt.Model()
        model.hideOutput()
        model.setParam("limits/gap", GAP)
        model.setParam("limits/time", TIME_LIMIT)
        model.setParam("parallel/maxnthreads", 1)
        binary = set(problem.binary.tolist())
        z = [
            model.addVar(vtype="B" if i in binary else "C", lb=_side(form.all_lower[i]), ub=_side(form.all_upper[i]))
            for i in range(form.variables)
        ]
        for matrix, side, equal in ((rows.equal, rows.target, True), (rows.less, rows.bound, False)):
            for row, value in enumerate(side):
                part = slice(matrix.indptr[row], matrix.indptr[row + 1])
                terms = zip(matrix.indices[part], matrix.data[part], strict=True)
                line = pyscipopt.quicksum(c * z[i] for i, c in terms)
                model.addCons(line == value if equal else line <= value)
        gradient = form.gradient.copy()
        gradient[problem.binary] += 0.5 * form.hessian.diagonal()[problem.binary]  # x² = x
        bills = []
        for block in _blocks(form.hessian, problem.binary):
            bill = model.addVar(lb=0.0)
            bills.append(bill)
            entries = [(i, j, 0.5 * form.hessian[i, j]) for i in block for j in block if form.hessian[i, j] != 0.0]
            model.addCons(pyscipopt.quicksum(c * z[i] * z[j] for i, j, c in entries) <= bill)
        linear = pyscipopt.quicksum(gradient[i] * z[i] for i in gradient.nonzero()[0])
        model.setObjective(linear + pyscipopt.quicksum(bills))
        begin = process_time()
        model.optimize()
        seconds = process_time() - begin
        status = model.getStatus()
        if status in ("optimal", "gaplimit"):
            return model.getObjVal(), seconds
        return (np.inf if status in ("infeasible", "inforunbd") else np.nan), seconds


def _side(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _blocks(hessian: Vector, binary: Vector) -> list[Vector]:
    """Groups of variables that the Hessian couples, the binaries left out."""
    count, label = sparse.csgraph.connected_components(sparse.csr_matrix(hessian != 0.0), directed=False)
    label[binary] = -1
    return [block for number in range(count) if (block := np.flatnonzero(label == number)).size]


SOLVERS: dict[str, Callable[[QuadraticProgram], Solver]] = {
    "daqp": lambda problem: Own(problem, "daqp"),
    "HiGHS": lambda problem: Own(problem, "highs"),
    "Gurobi": Gurobi,
    "SCIP": Scip,
}
