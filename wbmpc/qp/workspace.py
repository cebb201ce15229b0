"""Backends by name. To add one: one file with a workspace class, one line in a dict; the tests loop over the dicts."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

from wbmpc.errors import WbmpcError
from wbmpc.qp.problem import QuadraticProgram
from wbmpc.qp.solution import QpSolution, QpWorkspace

__all__ = [
    "MIQP_BACKENDS",
    "QP_BACKENDS",
    "QpSolution",
    "QpWorkspace",
    "make_mip_workspace",
    "make_workspace",
    "qp_backend_names",
]

# Each factory imports its solver on first use: osqp, highspy and qpsolvers take a second to load together.


def _daqp(problem: QuadraticProgram) -> QpWorkspace:
    from wbmpc.qp.daqp_workspace import DaqpWorkspace

    return DaqpWorkspace(problem)


def _osqp(problem: QuadraticProgram) -> QpWorkspace:
    from wbmpc.qp.osqp_workspace import OsqpWorkspace

    return OsqpWorkspace(problem)


def _daqp_mixed_integer(problem: QuadraticProgram) -> QpWorkspace:
    from wbmpc.qp.daqp_mixed_integer import DaqpMixedInteger

    return DaqpMixedInteger(problem)


def _highs_mixed_integer(problem: QuadraticProgram) -> QpWorkspace:
    from wbmpc.qp.highs_mixed_integer import HighsOuterApproximation

    return HighsOuterApproximation(problem)


Factory = Callable[[QuadraticProgram], QpWorkspace]
QP_BACKENDS: dict[str, Factory] = {"daqp": _daqp, "osqp": _osqp}
MIQP_BACKENDS: dict[str, Factory] = {"daqp": _daqp_mixed_integer, "highs": _highs_mixed_integer}
_PREFIX = "qpsolvers:"  # "qpsolvers:daqp" is daqp through the wrapper


def qp_backend_names() -> list[str]:
    """Every name that `make_workspace` takes here: QP_BACKENDS and the solvers that qpsolvers finds installed."""
    from wbmpc.qp.qpsolvers_workspace import installed_solvers

    return [*QP_BACKENDS, *(_PREFIX + name for name in installed_solvers())]


class UnknownBackendError(WbmpcError):
    """The scenario or the caller names a solver that does not exist or is not installed."""

    def __init__(self, name: str, choices: list[str]) -> None:
        near = get_close_matches(name, choices, n=1)
        hint = f", did you mean '{near[0]}'?" if near else ""
        super().__init__(f"unknown QP backend '{name}'{hint} (choices: {', '.join(choices)})")


class MisplacedBinariesError(WbmpcError):
    """A problem with binary variables was given to a QP backend."""


def make_workspace(backend: str, problem: QuadraticProgram) -> QpWorkspace:
    """A workspace bound to `problem`: one of QP_BACKENDS, or any solver of qpsolvers with or without "qpsolvers:".

    Raises:
        UnknownBackendError: no such backend, with the choices and a near miss.
        MisplacedBinariesError: the problem has binary variables.
    """
    if problem.binary.size:
        raise MisplacedBinariesError(f"{problem.binary.size} binary variables need one of {', '.join(MIQP_BACKENDS)}")
    if backend in QP_BACKENDS:
        return QP_BACKENDS[backend](problem)
    from wbmpc.qp.qpsolvers_workspace import QpsolversWorkspace, installed_solvers

    solver = backend.removeprefix(_PREFIX)
    if solver not in installed_solvers():
        raise UnknownBackendError(backend, qp_backend_names())
    return QpsolversWorkspace(problem, solver)


def make_mip_workspace(backend: str, problem: QuadraticProgram) -> QpWorkspace:
    """A workspace of one of MIQP_BACKENDS, bound to `problem`; exact.

    Raises:
        UnknownBackendError: no such backend, with the choices and a near miss.
    """
    if backend not in MIQP_BACKENDS:
        raise UnknownBackendError(backend, list(MIQP_BACKENDS))
    return MIQP_BACKENDS[backend](problem)
