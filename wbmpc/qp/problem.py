"""The quadratic program that every workspace reads, and its recorded instances."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbmpc.errors import WbmpcError
from wbmpc.qp.verdicts import CROSSING, NOT_FINITE, SOUND, soundness
from wbmpc.signals import SolveStatus, Vector

DEFECTS: dict[int, SolveStatus | None] = {
    SOUND: None,
    NOT_FINITE: SolveStatus.NUMERICAL_ERROR,
    CROSSING: SolveStatus.INFEASIBLE,
}


class QuadraticProgram:
    """A quadratic program, preallocated once and written in place by its owner before each solve.

    minimise   ½ xᵀ H x + gᵀ x + ½ Σ_i w_i s_i²
    subject to lower - s <= A x <= upper + s,   x_lower <= x <= x_upper,   x_j ∈ {0, 1} for j in binary

    A row with w_i = 0 is hard (s_i = 0). ±inf bounds are allowed; equal bounds make an equality. H must be symmetric
    and positive definite: solvers differ in which triangle they read. Bounds that cross are infeasible, soft or not.

    The arrays are C-contiguous float64 and never change identity (solvers keep pointers into them):
      hessian (n, n), gradient (n,), matrix (m, n), lower (m,), upper (m,), x_lower (n,), x_upper (n,),
      all_lower (n + m,) and all_upper (n + m,): the same memory, variable bounds first.
    """

    hessian: Vector
    gradient: Vector
    matrix: Vector
    all_lower: Vector
    all_upper: Vector
    lower: Vector
    upper: Vector
    x_lower: Vector
    x_upper: Vector
    soft_weight: Vector  # (m,) [cost / (row's unit)²], fixed
    soft_rows: NDArray[np.int64]  # indices of the rows with soft_weight > 0
    binary: NDArray[np.int64]  # indices of the binary variables, ascending

    def __init__(
        self, variables: int, rows: int, soft_weight: ArrayLike | None = None, binary: Iterable[int] = ()
    ) -> None:
        """Everything zero, every bound infinite, binary variables within [0, 1].

        Raises:
            QpShapeError: soft_weight is not (rows,), finite and >= 0, or a binary index is out of range.
        """
        n, m = variables, rows
        self.hessian = np.zeros((n, n))
        self.gradient = np.zeros(n)
        self.matrix = np.zeros((m, n))
        self.all_lower = np.full(n + m, -np.inf)
        self.all_upper = np.full(n + m, np.inf)
        self.lower, self.upper = self.all_lower[n:], self.all_upper[n:]
        self.x_lower, self.x_upper = self.all_lower[:n], self.all_upper[:n]
        weight = np.zeros(m) if soft_weight is None else np.array(soft_weight, dtype=np.float64)
        if weight.shape != (m,) or not (np.isfinite(weight) & (weight >= 0.0)).all():
            raise QpShapeError(f"soft_weight must be {m} finite numbers >= 0, received {weight!r}")
        weight.setflags(write=False)
        self.soft_weight = weight
        self.soft_rows = np.flatnonzero(weight)
        self.binary = np.unique(np.fromiter(binary, dtype=np.int64))
        if self.binary.size and not (self.binary[0] >= 0 and self.binary[-1] < n):
            raise QpShapeError(f"binary indices must lie in 0..{n - 1}, received {self.binary.tolist()}")
        self.x_lower[self.binary], self.x_upper[self.binary] = 0.0, 1.0
        self._matrix_data = (self.hessian.reshape(-1), self.matrix.reshape(-1))

    def head(self, rows: int) -> QuadraticProgram:
        """The problem with its first `rows` rows only, in the same memory: what is written to one is in the other."""
        part, n = object.__new__(QuadraticProgram), self.variables
        part.hessian, part.gradient, part.matrix = self.hessian, self.gradient, self.matrix[:rows]
        part.all_lower, part.all_upper = self.all_lower[: n + rows], self.all_upper[: n + rows]
        part.lower, part.upper = part.all_lower[n:], part.all_upper[n:]
        part.x_lower, part.x_upper = part.all_lower[:n], part.all_upper[:n]
        part.soft_weight, part.soft_rows = self.soft_weight[:rows], self.soft_rows[self.soft_rows < rows]
        part.binary = self.binary
        part._matrix_data = (part.hessian.reshape(-1), part.matrix.reshape(-1))
        return part

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse to rebind an array: `problem.lower = b` would leave the solvers looking at the old one."""
        if getattr(self, name, value) is not value:
            raise AttributeError(f"write into the array: problem.{name}[...] = value")
        object.__setattr__(self, name, value)

    @property
    def variables(self) -> int:
        """Number n of variables."""
        return self.gradient.size

    @property
    def rows(self) -> int:
        """Number m of general rows."""
        return self.lower.size

    def defect(self, *, matrices_changed: bool = True) -> SolveStatus | None:
        """What no solver should be asked: NUMERICAL_ERROR for non-finite data, INFEASIBLE for crossing bounds.

        None when the data are sound.
        """
        H, A = self._matrix_data
        return DEFECTS[soundness(H, self.gradient, A, self.all_lower, self.all_upper, matrices_changed)]

    def binary_range(self) -> tuple[Vector, Vector]:
        """Smallest and largest value, 0 or 1, that each binary's own bounds admit; (1, 0) when they admit neither."""
        lower, upper = self.x_lower[self.binary], self.x_upper[self.binary]
        zero, one = (lower <= 0.0) & (upper >= 0.0), (lower <= 1.0) & (upper >= 1.0)
        return np.where(zero, 0.0, 1.0), np.where(one, 1.0, 0.0)

    def row_violation(self, x: Vector) -> Vector:
        """How far each row of A x lies outside its bounds, (m,), >= 0, in the rows' units."""
        value = self.matrix @ x
        return np.maximum(np.maximum(self.lower - value, value - self.upper), 0.0)

    def objective(self, x: Vector) -> float:
        """½ xᵀ H x + gᵀ x + ½ Σ w s², s being the violation of the soft rows."""
        slack = self.row_violation(x)
        return float(0.5 * x @ self.hessian @ x + self.gradient @ x + 0.5 * self.soft_weight @ slack**2)

    def copy_from(self, other: QuadraticProgram) -> None:
        """Take over the numbers of a problem of the same shape, in place."""
        for name in ("hessian", "gradient", "matrix", "all_lower", "all_upper"):
            getattr(self, name)[...] = getattr(other, name)


def save_instance(problem: QuadraticProgram, path: Path | str) -> None:
    """Write one problem to an .npz file, for tests and benchmarks on real instances."""
    np.savez_compressed(
        path,
        hessian=problem.hessian,
        gradient=problem.gradient,
        matrix=problem.matrix,
        all_lower=problem.all_lower,
        all_upper=problem.all_upper,
        soft_weight=problem.soft_weight,
        binary=problem.binary,
    )


def load_instance(path: Path | str) -> QuadraticProgram:
    """Read a problem written by `save_instance`.

    Raises:
        QpShapeError: the file lacks an array or its shapes disagree.
    """
    with np.load(path, allow_pickle=False) as data:
        try:
            rows, variables = data["matrix"].shape
            problem = QuadraticProgram(variables, rows, data["soft_weight"], data["binary"].tolist())
            for name in ("hessian", "gradient", "matrix", "all_lower", "all_upper"):
                if data[name].shape != getattr(problem, name).shape:
                    raise QpShapeError(f"{path}: {name} has shape {data[name].shape}, matrix {data['matrix'].shape}")
                getattr(problem, name)[...] = data[name]
        except KeyError as error:
            raise QpShapeError(f"{path}: not a recorded problem: {error.args[0]}") from None
    return problem


class QpShapeError(WbmpcError):
    """The arrays given for a quadratic program do not fit together."""
