"""Problems in the forms that solvers without soft or unbounded rows take."""

from __future__ import annotations

import numpy as np

from wbmpc.qp import QuadraticProgram
from wbmpc.qp.slack_form import SlackForm


class Bounding:
    """The problem's rows that bound something, as they are when this is made."""

    def __init__(self, problem: QuadraticProgram) -> None:
        self._whole = problem
        self._kept = np.flatnonzero(np.isfinite(problem.lower) | np.isfinite(problem.upper))
        soft_weight = problem.soft_weight[self._kept]
        self.problem = QuadraticProgram(problem.variables, self._kept.size, soft_weight)

    def refresh(self) -> None:
        """Copy the problem's present numbers."""
        whole, problem = self._whole, self.problem
        problem.hessian[:], problem.gradient[:] = whole.hessian, whole.gradient
        problem.matrix[:] = whole.matrix[self._kept]
        problem.lower[:], problem.upper[:] = whole.lower[self._kept], whole.upper[self._kept]
        problem.x_lower[:], problem.x_upper[:] = whole.x_lower, whole.x_upper


class Slacked:
    """Equations, two-sided rows and bounds of the form with slack variables."""

    def __init__(self, problem: QuadraticProgram) -> None:
        self._bounding = Bounding(problem)
        self._bounding.refresh()
        self.form, self.variables = SlackForm(self._bounding.problem), problem.variables
        self.form.refresh()
        n = self.form.variables
        lower, upper = self.form.all_lower[n:], self.form.all_upper[n:]
        self._equal, self._free = lower == upper, lower != upper
        self.prepare()

    def prepare(self) -> None:
        """Copy the problem's present numbers."""
        form, n = self.form, self.form.variables
        self._bounding.refresh()
        form.refresh()
        self.A, self.b = form.matrix[self._equal], form.all_lower[n:][self._equal]
        self.C = form.matrix[self._free]
        self.l, self.u = form.all_lower[n:][self._free], form.all_upper[n:][self._free]
        self.x_l, self.x_u = form.all_lower[:n], form.all_upper[:n]
