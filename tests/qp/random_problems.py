"""Random strictly convex problems with known structure, and an optimality check that shares no code with a solver."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import nnls

from wbmpc.qp import QuadraticProgram, make_workspace
from wbmpc.signals import Vector


def random_problem(
    rng: np.random.Generator, variables: int, rows: int, *, equalities: int = 0, soft: int = 0, bounded: bool = True
) -> QuadraticProgram:
    """A problem whose hard rows and bounds admit a known point; its last `soft` rows need not be satisfiable."""
    weight = np.zeros(rows)
    weight[rows - soft :] = 10.0 ** rng.uniform(0, 3, soft)
    problem = QuadraticProgram(variables, rows, weight)
    factor = rng.normal(size=(variables, variables))
    problem.hessian[:] = factor @ factor.T / variables + 0.1 * np.eye(variables)
    problem.gradient[:] = 3.0 * rng.normal(size=variables)
    problem.matrix[:] = rng.normal(size=(rows, variables))
    inside = rng.normal(size=variables)
    value = problem.matrix @ inside
    problem.lower[:] = value - rng.uniform(0.05, 1.0, rows)
    problem.upper[:] = value + rng.uniform(0.05, 1.0, rows)
    problem.lower[:equalities] = problem.upper[:equalities] = value[:equalities]
    problem.lower[rows - soft :] += 2.0  # pushes against the hard rows
    problem.upper[rows - soft :] += 2.0
    one_sided = np.arange(equalities, rows)[::3]
    problem.lower[one_sided] = -np.inf
    if bounded:
        problem.x_lower[::2] = inside[::2] - rng.uniform(0.05, 1.0, inside[::2].size)
        problem.x_upper[:] = inside + rng.uniform(0.05, 1.0, variables)
    return problem


def kkt_residual(problem: QuadraticProgram, x: Vector, active: float = 1e-5) -> float:
    """Largest violation of the optimality conditions at x, relative to the size of the gradient.

    Feasibility is read off directly. Stationarity: the cost's gradient must be a non-negative combination of the
    normals of the hard constraints that hold with equality (found by non-negative least squares); a violated soft
    row adds its penalty's gradient w s.
    """
    value = problem.matrix @ x
    hard = problem.soft_weight == 0.0
    normals, gradient = [], problem.hessian @ x + problem.gradient
    infeasibility = 0.0
    constraints = itertools.chain(
        zip(problem.matrix[hard], value[hard], problem.lower[hard], problem.upper[hard], strict=True),
        zip(np.eye(x.size), x, problem.x_lower, problem.x_upper, strict=True),
    )
    for normal, at, lower, upper in constraints:
        infeasibility = max(infeasibility, lower - at, at - upper)
        if at - lower < active:
            normals.append(normal)
        if upper - at < active:
            normals.append(-normal)
    excess = np.maximum(value - problem.upper, 0.0) - np.maximum(problem.lower - value, 0.0)
    gradient = gradient + problem.matrix.T @ (problem.soft_weight * excess)
    if normals:
        _, stationarity = nnls(np.array(normals).T, gradient)
    else:
        stationarity = float(np.linalg.norm(gradient))
    return max(infeasibility, stationarity / (1.0 + float(np.linalg.norm(problem.gradient))))


def brute_force(problem: QuadraticProgram) -> tuple[float, Vector | None]:
    """Cheapest of all assignments of the binaries: (inf, None) when every one is infeasible."""
    fixed = QuadraticProgram(problem.variables, problem.rows, problem.soft_weight)
    workspace = make_workspace("daqp", fixed)
    best: tuple[float, Vector | None] = (np.inf, None)
    for assignment in itertools.product((0.0, 1.0), repeat=problem.binary.size):
        fixed.copy_from(problem)
        values = np.array(assignment)
        if (values < problem.x_lower[problem.binary]).any() or (values > problem.x_upper[problem.binary]).any():
            continue
        fixed.x_lower[problem.binary] = fixed.x_upper[problem.binary] = values
        # The binaries are constants now: any positive curvature makes H definite and shifts every cost alike.
        fixed.hessian[problem.binary, problem.binary] += 1.0
        solution = workspace.solve()
        if solution.solved and problem.objective(solution.x) < best[0]:
            best = problem.objective(solution.x), solution.x
    return best
