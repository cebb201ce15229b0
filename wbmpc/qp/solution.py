"""What a workspace is and what it answers."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wbmpc.qp.problem import QuadraticProgram
from wbmpc.record import record
from wbmpc.signals import SolveStatus, Vector


@record
class QpSolution:
    """One solve. `x` is nan unless the status is SOLVED, so that a forgotten status cannot pass for a solution."""

    x: Vector  # (n,)
    status: SolveStatus
    iterations: int
    solve_time: float  # [s] wall time, hand-over of the data included

    @property
    def solved(self) -> bool:
        """Whether x is the optimum."""
        return self.status is SolveStatus.SOLVED


class QpWorkspace(Protocol):
    """A solver bound to one problem. Not shared between threads; two workspaces never influence each other."""

    @property
    def problem(self) -> QuadraticProgram:
        """The arrays that `solve` reads."""
        ...

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """Solve the problem as its arrays stand now, warm-started from the workspace's own last solve.

        Pass matrices_changed=False when only the gradient and the bounds differ from the last solve: the
        factorisation is then kept (daqp: two to seven times faster). Never raises for bad numbers:
        infeasible data and data that are not finite are statuses.
        """
        ...


def failed(problem: QuadraticProgram, status: SolveStatus, iterations: int, solve_time: float) -> QpSolution:
    """The answer of a solve that found no optimum."""
    return QpSolution(np.full(problem.variables, np.nan), status, iterations, solve_time)
