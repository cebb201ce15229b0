"""Quadratic programs: one problem type, one workspace protocol, one small file per solver."""

from wbmpc.qp.problem import QuadraticProgram, load_instance, save_instance
from wbmpc.qp.workspace import (
    MIQP_BACKENDS,
    QP_BACKENDS,
    QpSolution,
    QpWorkspace,
    make_mip_workspace,
    make_workspace,
    qp_backend_names,
)

__all__ = [
    "MIQP_BACKENDS",
    "QP_BACKENDS",
    "QpSolution",
    "QpWorkspace",
    "QuadraticProgram",
    "load_instance",
    "make_mip_workspace",
    "make_workspace",
    "qp_backend_names",
    "save_instance",
]
