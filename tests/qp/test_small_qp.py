"""The small-QP kernel against daqp, and its proofs of infeasibility against their definition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.qp import QuadraticProgram, make_workspace
from wbmpc.qp.small_qp import FAILED, INFEASIBLE, SmallQp, room_for, solve_small
from wbmpc.signals import SolveStatus, Vector

VARIABLES, ROWS = 6, 18
ROOM = room_for(VARIABLES, ROWS)  # shared by all tests: a solve must forget the one before


def random_problem(seed: int) -> QuadraticProgram:
    """Rows `A x ≤ b` only, some soft, some twice, half of the problems around a feasible point."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, VARIABLES + 1)), int(rng.integers(1, ROWS + 1))
    softness = np.where(rng.random(m) < 0.3, 10.0 ** rng.uniform(-4, 0, m), 0.0)
    problem = QuadraticProgram(n, m, np.divide(1.0, softness, out=np.zeros(m), where=softness > 0.0))
    factor = rng.normal(size=(n, n))
    problem.hessian[:] = factor @ factor.T / n + 0.1 * np.eye(n)
    problem.gradient[:] = 3.0 * rng.normal(size=n)
    problem.matrix[:] = rng.normal(size=(m, n)) * 10.0 ** rng.uniform(-1, 1, (m, 1))
    room = rng.uniform(0.0, 1.0, m) if rng.random() < 0.5 else rng.normal(size=m)
    problem.upper[:] = problem.matrix @ rng.normal(size=n) + room
    problem.lower[:] = -np.inf
    if rng.random() < 0.3:
        original, copy = rng.integers(m, size=2)
        problem.matrix[copy], problem.upper[copy] = 2.0 * problem.matrix[original], 2.0 * problem.upper[original]
    return problem


def solve(problem: QuadraticProgram, qp: SmallQp = ROOM) -> tuple[int, Vector, Vector]:
    """Steps or failure, x and multipliers."""
    n, m = problem.variables, problem.rows
    weight = problem.soft_weight
    qp.hessian[:n, :n], qp.gradient[:n] = problem.hessian, problem.gradient
    qp.rows[:m, :n], qp.bound[:m] = problem.matrix, problem.upper
    qp.softness[:m] = np.divide(1.0, weight, out=np.zeros(m), where=weight > 0.0)
    return solve_small(qp, n, m), qp.x[:n].copy(), qp.multiplier[:m].copy()


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_same_optimum_as_daqp_or_a_proof_that_there_is_none(seed: int) -> None:
    problem = random_problem(seed)
    reference = make_workspace("daqp", problem).solve()
    steps, x, multiplier = solve(problem)
    assert steps != FAILED
    assert (multiplier >= 0.0).all()
    if steps == INFEASIBLE:
        scale = multiplier.sum()
        assert_allclose(multiplier @ problem.matrix / scale, 0.0, atol=1e-6)
        assert multiplier @ problem.upper < 0.0
        assert not multiplier[problem.soft_rows].any()
        assert reference.status is not SolveStatus.SOLVED
        return
    assert reference.status is SolveStatus.SOLVED
    assert problem.objective(x) == pytest.approx(problem.objective(reference.x), rel=1e-6, abs=1e-7)
    hard = problem.soft_weight == 0.0
    assert problem.row_violation(x)[hard].max(initial=0.0) < 1e-7
    slope = problem.hessian @ x + problem.gradient + multiplier @ problem.matrix
    assert_allclose(slope, 0.0, atol=1e-6 * (1.0 + abs(problem.gradient).max()))


def test_the_random_problems_are_of_both_kinds_and_take_steps() -> None:
    steps = [solve(random_problem(seed))[0] for seed in range(200)]
    assert steps.count(INFEASIBLE) >= 10
    assert sum(step >= 3 for step in steps) >= 50


def test_a_cone_with_a_cap() -> None:
    """Drawn to (3, 0, 0) with |t| ≤ n / 2 and n ≤ 2: at the edge t = 1, n = 2 by the cap."""
    problem = QuadraticProgram(3, 5)
    problem.hessian[:], problem.gradient[:] = np.eye(3), [-3.0, 0.0, 0.0]
    problem.matrix[:] = [[1, 0, -0.5], [-1, 0, -0.5], [0, 1, -0.5], [0, -1, -0.5], [0, 0, 1]]
    problem.upper[:] = [0, 0, 0, 0, 2]
    assert_allclose(solve(problem)[1], [0.6, 0.0, 1.2], atol=1e-12)  # n = 2 t: ½ t² + ½ (2 t)² − 3 t
    problem.upper[4] = 1.0
    assert_allclose(solve(problem)[1], [0.5, 0.0, 1.0], atol=1e-12)


def test_a_soft_row_yields_as_its_price_says() -> None:
    problem = QuadraticProgram(1, 1, np.array([4.0]))
    problem.hessian[:], problem.gradient[:], problem.matrix[:], problem.upper[:] = 1.0, -1.0, 1.0, 0.0
    steps, x, multiplier = solve(problem)
    assert steps == 1
    assert_allclose([x[0], multiplier[0]], [0.2, 0.8], atol=1e-12)  # x − 1 + 4 x = 0


def test_a_hessian_that_is_not_positive_definite_fails() -> None:
    problem = QuadraticProgram(2, 1)
    for bad in (0.0, -1.0, np.nan):
        problem.hessian[:] = np.diag([1.0, bad])
        assert solve(problem)[0] == FAILED


def test_rows_of_zeros_hold_or_do_not() -> None:
    problem = QuadraticProgram(1, 1)
    problem.hessian[:] = 1.0
    problem.upper[:] = 0.5
    assert solve(problem)[0] == 0
    problem.upper[:] = -0.5
    assert solve(problem)[0] == INFEASIBLE
