"""The guess of an active set against the optimality conditions, and what it must not answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from random_problems import kkt_residual, random_problem

from wbmpc.qp import QuadraticProgram, daqp_workspace, make_workspace
from wbmpc.qp.active_set import MOST_ROUNDS, examine_and_guess, solve_from_guess
from wbmpc.signals import SolveStatus, Vector


def guess(problem: QuadraticProgram, active: Vector) -> tuple[int, Vector]:
    """Rounds (0: not found) and x; `active` is overwritten."""
    softness = np.divide(1.0, problem.soft_weight, out=np.zeros(problem.rows), where=problem.soft_weight > 0.0)
    bounds, factor = (problem.all_lower, problem.all_upper), np.zeros_like(problem.hessian)
    arguments = (problem.hessian, problem.gradient, problem.matrix, *bounds, softness, active, factor)
    x, same = np.zeros(problem.variables), np.zeros(problem.variables)
    rounds = solve_from_guess(*arguments, False, x)
    if rounds:  # the factor that is left belongs to the set that is left
        assert solve_from_guess(*arguments, True, same) == 1
        assert_array_equal(same, x)
    return rounds, x


def nothing(problem: QuadraticProgram) -> Vector:
    return np.zeros(problem.all_lower.size, dtype=np.int8)


problems = st.builds(
    lambda seed, n, m, soft, equal: random_problem(
        np.random.default_rng(seed), n, m, soft=min(soft, m), equalities=min(equal, max(m - soft, 0), n // 2)
    ),
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 12),
    m=st.integers(0, 20),
    soft=st.integers(0, 8),
    equal=st.integers(0, 3),
)


@settings(max_examples=300, deadline=None)
@given(problem=problems, seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_what_is_found_from_any_guess_is_the_optimum_and_its_set(
    problem: QuadraticProgram, seed: int, share: float
) -> None:
    rng, active = np.random.default_rng(seed), nothing(problem)
    wild = rng.random(active.size) < share
    active[wild & np.isfinite(problem.all_upper)] = 1
    rounds, x = guess(problem, active)
    assert rounds <= MOST_ROUNDS
    if not rounds:
        assert not active.any()
        return
    assert kkt_residual(problem, x) < 1e-6
    again, same = guess(problem, active)
    assert again == 1, "the set that is left is the optimum's"
    assert_allclose(same, x, atol=1e-9)


@pytest.mark.parametrize("seed", [11, 286, 377, 516])
def test_a_set_already_tried_is_left_by_changing_half(seed: int) -> None:
    """These four go round in circles from the empty set."""
    problem = random_problem(np.random.default_rng(seed), 6, 10, soft=10)
    rounds, x = guess(problem, nothing(problem))
    assert 0 < rounds <= MOST_ROUNDS
    assert kkt_residual(problem, x) < 1e-6


@settings(max_examples=100, deadline=None)
@given(problem=problems, seed=st.integers(0, 2**32 - 1))
def test_a_workspace_that_guesses_follows_changing_data(problem: QuadraticProgram, seed: int) -> None:
    """With matrices that change in some solves only: daqp, asked when a guess fails, must not see old ones."""
    rng, workspace = np.random.default_rng(seed), make_workspace("daqp", problem)
    for changed in (True, False, True, False, False):
        if changed:
            problem.hessian[:] += np.diag(rng.uniform(0.0, 1.0, problem.variables))
        problem.gradient[:] += rng.normal(size=problem.variables)
        solution = workspace.solve(matrices_changed=changed)
        assert solution.status is SolveStatus.SOLVED
        assert kkt_residual(problem, solution.x) < 1e-5


def test_a_workspace_mostly_guesses_right_while_the_data_change_slowly(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, rounds = np.random.default_rng(8), []

    def counted(*arguments: Any) -> tuple[int, int]:
        answer = examine_and_guess(*arguments)
        rounds.append(answer[1])
        return answer

    monkeypatch.setattr(daqp_workspace, "examine_and_guess", counted)
    problem = random_problem(rng, 30, 60, soft=30)
    workspace = make_workspace("daqp", problem)
    for _ in range(100):
        problem.gradient[:] += 0.01 * rng.normal(size=30)
        assert workspace.solve().solved
    assert np.count_nonzero(rounds) > 90


def opposed(problem: QuadraticProgram) -> None:
    problem.matrix[1] = problem.matrix[0]
    problem.lower[:2], problem.upper[:2] = [1.0, -5.0], [2.0, -4.0]


def redundant(problem: QuadraticProgram) -> None:
    problem.matrix[1], problem.lower[:2], problem.upper[:2] = problem.matrix[0], 1.0, 1.0


def broken(problem: QuadraticProgram) -> None:
    problem.gradient[0] = np.nan


def flat(problem: QuadraticProgram) -> None:
    problem.hessian[:] = 0.0


@pytest.mark.parametrize("spoil", [opposed, redundant, broken, flat])
def test_no_answer_where_there_is_none_or_not_one(spoil: Callable[[QuadraticProgram], None]) -> None:
    problem = QuadraticProgram(3, 4)
    problem.hessian[:], problem.gradient[:] = np.eye(3), 1.0
    problem.matrix[:] = np.random.default_rng(1).normal(size=(4, 3))
    spoil(problem)
    active = nothing(problem)
    rounds, _ = guess(problem, active)
    assert rounds == 0
    assert not active.any()


def test_more_active_rows_than_variables_are_no_guess() -> None:
    problem = QuadraticProgram(2, 5)
    problem.hessian[:], problem.upper[:] = np.eye(2), 1.0
    problem.matrix[:] = np.random.default_rng(1).normal(size=(5, 2))
    active = nothing(problem)
    active[2:] = 1
    assert guess(problem, active)[0] == 0
