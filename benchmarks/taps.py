"""Listening to every QP of a run without touching the code that solves it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from wbmpc.qp import MIQP_BACKENDS, QP_BACKENDS, QpSolution, QpWorkspace, QuadraticProgram

OnSolve = Callable[["Tap", QpSolution], None]


@dataclass
class Tap:
    """A workspace that passes everything on to another and remembers how long each solve took."""

    label: str  # class that made the workspace, and how many it had made by then: "ContactChoice 1"
    inner: QpWorkspace
    on_solve: OnSolve | None
    seconds: list[float] = field(default_factory=list)

    @property
    def maker(self) -> str:
        """The class that made the workspace."""
        return self.label.split()[0]

    @property
    def problem(self) -> QuadraticProgram:
        """See `QpWorkspace.problem`."""
        return self.inner.problem

    def solve(self, *, matrices_changed: bool = True) -> QpSolution:
        """See `QpWorkspace.solve`."""
        solution = self.inner.solve(matrices_changed=matrices_changed)
        self.seconds.append(solution.solve_time)
        if self.on_solve is not None:
            self.on_solve(self, solution)
        return solution


@contextmanager
def tapped(on_solve: OnSolve | None = None) -> Iterator[dict[str, Tap]]:
    """Tap every workspace of the native backends made inside; the answer fills up as they are made, by label.

    `on_solve` is called after every solve, when the problem still holds its numbers.
    """
    taps: dict[str, Tap] = {}

    def wrapped(factory: Callable[[QuadraticProgram], QpWorkspace]) -> Callable[[QuadraticProgram], Any]:
        def make(problem: QuadraticProgram) -> Tap:
            maker = type(sys._getframe(2).f_locals.get("self")).__name__  # make_workspace's caller
            label = f"{maker} {sum(tap.label.startswith(maker + ' ') for tap in taps.values()) + 1}"
            taps[label] = Tap(label, factory(problem), on_solve)
            return taps[label]

        return make

    originals = [(backends, dict(backends)) for backends in (QP_BACKENDS, MIQP_BACKENDS)]
    try:
        for backends, factories in originals:
            backends.update({name: wrapped(factory) for name, factory in factories.items()})
        yield taps
    finally:
        for backends, factories in originals:
            backends.update(factories)
