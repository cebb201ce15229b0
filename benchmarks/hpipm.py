"""HPIPM's dense interior-point method through its C library, which the casadi wheel ships."""

from __future__ import annotations

import ctypes
from ctypes import byref, c_double, c_int, c_size_t, c_void_p
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from wbmpc.qp import QuadraticProgram

SPEED = 1  # enum hpipm_mode: relative formulation, focus on speed
MOST_ITERATIONS = 100


class Hpipm:
    """One problem shape: memory is made once, `solve` copies the numbers and solves.

    Hard rows and variables with one value for both bounds are equations, soft rows are HPIPM's own. It is started anew
    at every solve: its warm start took longer.
    """

    def __init__(self, problem: QuadraticProgram, *, tolerance: float) -> None:
        self.problem, self._lib = problem, _library()
        p = problem
        self._equal = np.flatnonzero((p.lower == p.upper) & (p.soft_weight == 0.0))
        self._rows = np.setdiff1d(np.arange(p.rows), self._equal)
        soft = np.flatnonzero(p.soft_weight[self._rows] > 0.0)
        n, fixed = p.variables, p.x_lower == p.x_upper
        self._fixed = np.flatnonzero(fixed)
        self._units = np.eye(n)[self._fixed]
        bounded = np.flatnonzero((np.isfinite(p.x_lower) | np.isfinite(p.x_upper)) & ~fixed)
        self._bounded = bounded.astype(np.int32)
        self._weight = np.ascontiguousarray(p.soft_weight[self._rows][soft])
        self._soft = (bounded.size + soft).astype(np.int32)
        self._reverse = np.full(bounded.size + self._rows.size, -1, dtype=np.int32)
        self._reverse[self._soft] = np.arange(soft.size)
        self._zero = np.zeros(max(soft.size, 1))
        self._kept: list[ctypes.Array] = []
        sizes = (n, self._equal.size + self._fixed.size, bounded.size, self._rows.size, soft.size)
        self._dim = self._make("d_dense_qp_dim")
        self._lib.d_dense_qp_dim_set_all(*(c_int(size) for size in sizes), self._dim)
        self._qp = self._make("d_dense_qp", self._dim)
        self._sol = self._make("d_dense_qp_sol", self._dim)
        self._arg = self._make("d_dense_qp_ipm_arg", self._dim)
        self._lib.d_dense_qp_ipm_arg_set_default(SPEED, self._arg)
        for name in ("stat", "eq", "ineq", "comp"):
            getattr(self._lib, f"d_dense_qp_ipm_arg_set_tol_{name}")(byref(c_double(tolerance)), self._arg)
        self._lib.d_dense_qp_ipm_arg_set_iter_max(byref(c_int(MOST_ITERATIONS)), self._arg)
        self._workspace = self._make("d_dense_qp_ipm_ws", self._dim, self._arg)

    def solve(self) -> np.ndarray | None:
        """x of the problem as its arrays stand; None when it has not converged."""
        p, lib = self.problem, self._lib
        lower, upper = p.x_lower[self._bounded], p.x_upper[self._bounded]
        row_lower, row_upper = p.lower[self._rows], p.upper[self._rows]
        equations = np.vstack([p.matrix[self._equal], self._units])
        values = np.concatenate([p.lower[self._equal], p.x_lower[self._fixed]])
        arrays: tuple[np.ndarray, ...] = (
            *(p.hessian, p.gradient, equations, values),
            *(self._bounded, _finite(lower), _finite(upper)),
            *(p.matrix[self._rows], _finite(row_lower), _finite(row_upper)),
            *(self._weight, self._weight, self._zero, self._zero, self._soft, self._reverse, self._zero, self._zero),
        )
        arrays = tuple(np.ascontiguousarray(a) for a in arrays)
        lib.d_dense_qp_set_all_rowmaj(*(a.ctypes.data_as(c_void_p) for a in arrays), self._qp)
        for name, bound in (("lb", lower), ("ub", upper), ("lg", row_lower), ("ug", row_upper)):
            mask = np.isfinite(bound).astype(float)
            getattr(lib, f"d_dense_qp_set_{name}_mask")(mask.ctypes.data_as(c_void_p), self._qp)
        lib.d_dense_qp_ipm_solve(self._qp, self._sol, self._arg, self._workspace)
        status = c_int()
        lib.d_dense_qp_ipm_get_status(self._workspace, byref(status))
        if status.value != 0:
            return None
        x = np.empty(p.variables)
        lib.d_dense_qp_sol_get_v(self._sol, x.ctypes.data_as(c_void_p))
        return x

    def _make(self, kind: str, *given: c_void_p) -> c_void_p:
        """A struct of HPIPM and the memory it points into, kept for as long as this object lives."""
        struct = ctypes.create_string_buffer(self._size(f"{kind}_strsize"))
        memory = ctypes.create_string_buffer(self._size(f"{kind}_memsize", *given) + 64)
        self._kept += [struct, memory]
        pointer = ctypes.cast(struct, c_void_p)
        getattr(self._lib, f"{kind}_create")(*given, pointer, ctypes.cast(memory, c_void_p))
        return pointer

    def _size(self, function: str, *given: c_void_p) -> int:
        call = getattr(self._lib, function)
        call.restype = c_size_t
        return int(call(*given))


def _finite(bound: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(bound), bound, 0.0)  # what is not finite is masked


def _library() -> ctypes.CDLL:
    spec = find_spec("casadi")
    if spec is None or spec.origin is None:
        raise ImportError("HPIPM comes with the casadi wheel of the peers' environment: `make peers`")
    folder = Path(spec.origin).parent
    ctypes.CDLL(str(folder / "libblasfeo.so"), mode=ctypes.RTLD_GLOBAL)
    return ctypes.CDLL(str(folder / "libhpipm.so"))
