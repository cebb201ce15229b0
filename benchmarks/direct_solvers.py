"""QP solvers through their own Python APIs, each kept from solve to solve and warm-started as far as it can be.

daqp, osqp and those through qpsolvers are this project's workspaces. The others get the problem without its rows that
bound nothing, and, but for HPIPM, which has soft rows of its own, with slack variables. Copying the problem into that
form is not timed: a user of theirs would write there at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import clarabel
import numpy as np
import piqp
import quadprog
from proxsuite import proxqp
from scipy import sparse

from benchmarks.hpipm import Hpipm
from benchmarks.slacked import Bounding, Slacked
from wbmpc.qp import QpWorkspace, QuadraticProgram, make_workspace

ACCURACY = 1e-8  # asked of every method that iterates towards the optimum


class Solver(Protocol):
    """One solver bound to one problem."""

    def prepare(self) -> None:
        """Untimed: the problem's numbers in the solver's form."""

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """Timed: x, or None when the solver says that it has none."""


class Workspace:
    """A backend of this project; also those that go through qpsolvers."""

    def __init__(self, name: str, problem: QuadraticProgram) -> None:
        self._workspace: QpWorkspace = make_workspace(name, problem)

    def prepare(self) -> None:
        """See `Solver`."""

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        solution = self._workspace.solve(matrices_changed=matrices_changed)
        return solution.x if solution.solved else None


class HpipmSolver:
    """See `Hpipm`."""

    def __init__(self, problem: QuadraticProgram) -> None:
        self._bounding = Bounding(problem)
        self._bounding.refresh()
        self._hpipm = Hpipm(self._bounding.problem, tolerance=ACCURACY)

    def prepare(self) -> None:
        """See `Solver`."""
        self._bounding.refresh()

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        return self._hpipm.solve()


class ProxQp(Slacked):
    """ProxQP, dense; each solve starts from the last result."""

    def __init__(self, problem: QuadraticProgram) -> None:
        super().__init__(problem)
        self._qp = proxqp.dense.QP(self.form.variables, self.b.size, self.l.size, True)
        settings = self._qp.settings
        settings.eps_abs, settings.eps_rel = 1e-2 * ACCURACY, 0.0  # its residuals are the objective's: small in stage 1
        settings.eps_primal_inf = 1e-12  # with its default it calls feasible problems infeasible
        settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._made = False

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        form = self.form
        vectors = {"g": form.gradient, "b": self.b, "l": self.l, "u": self.u, "l_box": self.x_l, "u_box": self.x_u}
        if matrices_changed or not self._made:
            vectors |= {"H": form.hessian, "A": self.A, "C": self.C}
        (self._qp.update if self._made else self._qp.init)(**vectors)
        self._made = True
        self._qp.solve()
        solved = self._qp.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return self._qp.results.x[: self.variables].copy() if solved else None


class Piqp(Slacked):
    """PIQP, dense or sparse; an interior-point method, it keeps memory and scaling only."""

    def __init__(self, problem: QuadraticProgram, *, dense: bool) -> None:
        super().__init__(problem)
        self._solver = piqp.DenseSolver() if dense else piqp.SparseSolver()
        self._convert: Callable[[np.ndarray], Any] = np.asfortranarray if dense else sparse.csc_matrix
        self._solver.settings.eps_abs, self._solver.settings.eps_rel = ACCURACY, 0.0
        self._made = False

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        form, convert = self.form, self._convert
        data = {"c": form.gradient, "b": self.b, "h_l": self.l, "h_u": self.u, "x_l": self.x_l, "x_u": self.x_u}
        if matrices_changed or not self._made:
            data |= {"P": convert(form.hessian), "A": convert(self.A), "G": convert(self.C)}
        (self._solver.update if self._made else self._solver.setup)(**data)
        self._made = True
        solved = self._solver.solve() == piqp.PIQP_SOLVED
        return np.array(self._solver.result.x[: self.variables]) if solved else None


class Clarabel(Slacked):
    """Clarabel, sparse, set up anew: its updates need a pattern that never changes."""

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        form, n = self.form, self.form.variables
        above, below = np.isfinite(self.u), np.isfinite(self.l)
        x_above, x_below = np.isfinite(self.x_u), np.isfinite(self.x_l)
        unit = sparse.identity(n, format="csc")
        rows = [self.A, self.C[above], -self.C[below]]
        matrix = sparse.vstack([*map(sparse.csc_matrix, rows), unit[x_above], -unit[x_below]], format="csc")
        bound = np.concatenate([self.b, self.u[above], -self.l[below], self.x_u[x_above], -self.x_l[x_below]])
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = ACCURACY
        cones = [clarabel.ZeroConeT(self.b.size), clarabel.NonnegativeConeT(bound.size - self.b.size)]
        hessian = sparse.triu(sparse.csc_matrix(form.hessian), format="csc")
        solution = clarabel.DefaultSolver(hessian, form.gradient, matrix, bound, cones, settings).solve()
        return np.array(solution.x[: self.variables]) if solution.status == clarabel.SolverStatus.Solved else None


class Quadprog(Slacked):
    """quadprog, Goldfarb and Idnani's dual method, dense, no warm start."""

    def solve(self, matrices_changed: bool) -> np.ndarray | None:
        """See `Solver`."""
        form = self.form
        above, below = np.isfinite(self.u), np.isfinite(self.l)
        x_above, x_below = np.isfinite(self.x_u), np.isfinite(self.x_l)
        unit = np.eye(form.variables)
        matrix = np.vstack([self.A, -self.C[above], self.C[below], -unit[x_above], unit[x_below]])
        bound = np.concatenate([self.b, -self.u[above], self.l[below], -self.x_u[x_above], self.x_l[x_below]])
        try:
            x = quadprog.solve_qp(form.hessian, -form.gradient, matrix.T, bound, self.b.size)[0]
        except ValueError:  # "constraints are inconsistent", or a Hessian that is not positive definite
            return None
        return x[: self.variables]


SOLVERS: dict[str, Callable[[QuadraticProgram], Solver]] = {
    "daqp": lambda problem: Workspace("daqp", problem),
    "osqp": lambda problem: Workspace("osqp", problem),
    "proxqp": ProxQp,
    "piqp, dense": lambda problem: Piqp(problem, dense=True),
    "piqp, sparse": lambda problem: Piqp(problem, dense=False),
    "quadprog": Quadprog,
    "clarabel": Clarabel,
    "hpipm": HpipmSolver,
    **{
        f"qpsolvers: {name}": lambda problem, name=name: Workspace(f"qpsolvers:{name}", problem)
        for name in ("daqp", "osqp", "proxqp", "piqp", "quadprog", "clarabel")
    },
}
