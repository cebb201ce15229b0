"""Sequences of QPs, as a control loop sees them: what solvers are timed on."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wbmpc.qp import QuadraticProgram, load_instance

Fill = Callable[[QuadraticProgram, int], None]  # writes the problem of one step


@dataclass
class Family:
    """A named sequence of problems of one shape."""

    name: str
    problem: QuadraticProgram
    fill: Fill


def drifting(name: str, variables: int, rows: int, *, equalities: int, soft: int) -> Family:
    """Random least-squares tasks with rows around a moving feasible point; the last `soft` rows are soft."""
    rng = np.random.default_rng(0)
    tasks, task_drift = rng.normal(size=(2, 2 * variables // 3, variables))
    matrix, matrix_drift = rng.normal(size=(2, rows, variables))
    target, target_drift, inside, inside_drift = rng.normal(size=(4, variables))
    width, reach = rng.uniform(0.05, 2.0, rows), rng.uniform(0.5, 3.0, variables)
    weight = np.concatenate([np.zeros(rows - soft), np.full(soft, 1e4)])

    def fill(problem: QuadraticProgram, step: int) -> None:
        phase = np.sin(0.01 * step)
        jacobian = tasks + 0.3 * phase * task_drift
        point = inside + phase * inside_drift
        problem.hessian[:] = jacobian.T @ jacobian + 1e-3 * np.eye(variables)
        problem.gradient[:] = 3.0 * (target + phase * target_drift)
        problem.matrix[:] = matrix + 0.3 * phase * matrix_drift
        value = problem.matrix @ point
        problem.lower[:], problem.upper[:] = value - width, value + width
        problem.lower[:equalities] = problem.upper[:equalities]
        problem.x_lower[:], problem.x_upper[:] = point - reach, point + reach

    return Family(name, QuadraticProgram(variables, rows, weight), fill)


def recorded(path: Path) -> Family:
    """One recorded instance, its gradient trembling so that a warm start has something to do."""
    instance = load_instance(path)
    tremble = 1e-3 * np.random.default_rng(0).normal(size=(97, instance.variables))

    def fill(problem: QuadraticProgram, step: int) -> None:
        problem.copy_from(instance)
        problem.gradient[:] *= 1.0 + tremble[step % 97]

    return Family(path.stem, load_instance(path), fill)


def choice(candidates: int) -> Family:
    """Stage 3 in small: forces of one knot with friction pyramids, one candidate to choose, soft ZMP equations."""
    rng = np.random.default_rng(candidates)
    forces = 3 * candidates
    rows = 3 + 5 * candidates
    weight = np.zeros(rows)
    weight[:2] = 1e5
    problem = QuadraticProgram(forces + candidates, rows, weight, binary=range(forces, forces + candidates))
    position = rng.uniform([0.1, -0.3, 0.05], [0.5, 0.3, 0.4], (candidates, 3))  # [m]

    def fill(problem: QuadraticProgram, step: int) -> None:
        shift = np.array([0.03, 0.02]) * (1.0 + 0.5 * np.sin(0.1 * step))  # [m] wanted ZMP shift
        problem.hessian[range(forces), range(forces)] = 1.0
        problem.gradient[forces:] = 10.0 * np.linalg.norm(position - position[0], axis=1)
        problem.matrix[:] = 0.0
        for index, (x, y, z) in enumerate(position):
            fx, fy, fz = 3 * index, 3 * index + 1, 3 * index + 2
            problem.matrix[0, [fx, fz]], problem.matrix[1, [fy, fz]] = (z, shift[0] - x), (z, shift[1] - y)
            cone = 3 + 5 * index
            for row, (tangent, sign) in enumerate([(fx, 1.0), (fx, -1.0), (fy, 1.0), (fy, -1.0)]):
                problem.matrix[cone + row, [tangent, fz]] = sign, -0.35
            problem.matrix[cone + 4, [fz, forces + index]] = 1.0, -20.0  # [N] force cap of a chosen candidate
        problem.matrix[2, forces:] = 1.0
        problem.lower[:2] = problem.upper[:2] = -33.0 * shift
        problem.lower[2] = problem.upper[2] = 1.0
        problem.upper[3:] = 0.0

    return Family(f"stage 3, {candidates} candidates", problem, fill)


@contextmanager
def silent() -> Iterator[None]:
    """Keep quiet what a solver's C code prints in spite of its settings (OSQP 1.1: "Polishing not needed")."""
    kept, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(null)
