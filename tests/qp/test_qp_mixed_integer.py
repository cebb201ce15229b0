"""Every MIQP backend against the enumeration of all assignments."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_problems import brute_force, random_problem

from wbmpc.errors import WbmpcError
from wbmpc.qp import MIQP_BACKENDS, QuadraticProgram, load_instance, make_mip_workspace, make_workspace
from wbmpc.qp.highs_mixed_integer import HighsOuterApproximation
from wbmpc.signals import SolveStatus

BACKENDS = list(MIQP_BACKENDS)
MIXED = [p for p in sorted(Path(__file__).parent.glob("instances/*.npz")) if load_instance(p).binary.size]


def with_binaries(continuous: QuadraticProgram, binaries: int) -> QuadraticProgram:
    """The same numbers, the last variables binary."""
    chosen = range(continuous.variables - binaries, continuous.variables)
    problem = QuadraticProgram(continuous.variables, continuous.rows, continuous.soft_weight, chosen)
    problem.copy_from(continuous)
    problem.x_lower[problem.binary], problem.x_upper[problem.binary] = 0.0, 1.0
    return problem


def choice_problem(rng: np.random.Generator, candidates: int) -> QuadraticProgram:
    """Stage 3 in small: a force for each candidate, zero unless it is chosen; exactly one is; the choice costs w_i."""
    problem = QuadraticProgram(2 * candidates + 1, candidates + 2, binary=range(candidates + 1, 2 * candidates + 1))
    force, slack, choice = slice(0, candidates), candidates, slice(candidates + 1, None)
    problem.hessian[range(candidates), range(candidates)] = 1.0
    problem.hessian[slack, slack] = 1e4
    problem.gradient[choice] = rng.uniform(0.0, 10.0, candidates)  # purely linear: H is singular in the binaries
    problem.x_lower[force] = 0.0
    problem.matrix[0, force], problem.matrix[0, slack] = rng.uniform(-0.2, 0.4, candidates), 1.0
    problem.lower[0] = problem.upper[0] = 1.0
    problem.matrix[1, choice] = 1.0
    problem.lower[1] = problem.upper[1] = 1.0
    problem.matrix[2:, force] = np.eye(candidates)
    problem.matrix[2:, choice] = -rng.uniform(5.0, 20.0) * np.eye(candidates)
    problem.upper[2:] = 0.0
    return problem


@pytest.mark.parametrize("backend", BACKENDS)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), binaries=st.integers(0, 5), soft=st.integers(0, 3))
def test_optimum_is_the_best_assignment(backend, seed, binaries, soft):
    continuous = random_problem(np.random.default_rng(seed), 8, 7, equalities=1, soft=soft)
    problem = with_binaries(continuous, binaries)
    cost, _ = brute_force(problem)
    solution = make_mip_workspace(backend, problem).solve()
    if not np.isfinite(cost):
        assert solution.status is SolveStatus.INFEASIBLE
        return
    assert solution.status is SolveStatus.SOLVED
    assert set(solution.x[problem.binary]) <= {0.0, 1.0}
    assert problem.row_violation(solution.x)[problem.soft_weight == 0.0].max() < 1e-6
    assert problem.objective(solution.x) == pytest.approx(cost, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("seed", range(6))
def test_choice_among_candidates(backend, seed):
    problem = choice_problem(np.random.default_rng(seed), 5)
    cost, best = brute_force(problem)
    solution = make_mip_workspace(backend, problem).solve()
    assert solution.status is SolveStatus.SOLVED
    np.testing.assert_array_equal(solution.x[problem.binary], np.rint(best[problem.binary]))
    assert problem.objective(solution.x) == pytest.approx(cost, rel=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounds_of_a_binary_are_kept(backend):
    problem = choice_problem(np.random.default_rng(0), 5)
    workspace = make_mip_workspace(backend, problem)
    first = int(workspace.solve().x[problem.binary].argmax())
    problem.x_upper[problem.binary[first]] = 0.0  # ruled out: unreachable
    second = int(workspace.solve().x[problem.binary].argmax())
    assert second != first
    problem.x_upper[problem.binary] = 0.0  # all of them: ΣH = 1 cannot hold
    assert workspace.solve().status is SolveStatus.INFEASIBLE
    problem.x_upper[problem.binary] = 1.0
    problem.x_lower[problem.binary[0]], problem.x_upper[problem.binary[0]] = 0.3, 0.7  # neither 0 nor 1
    assert workspace.solve().status is SolveStatus.INFEASIBLE
    problem.x_lower[problem.binary[0]], problem.x_upper[problem.binary[0]] = 0.0, 1.0
    assert int(workspace.solve().x[problem.binary].argmax()) == first


@pytest.mark.parametrize("backend", BACKENDS)
def test_nan_is_a_status(backend):
    problem = choice_problem(np.random.default_rng(0), 3)
    problem.gradient[0] = np.nan
    assert make_mip_workspace(backend, problem).solve().status is SolveStatus.NUMERICAL_ERROR


@pytest.mark.parametrize("backend", BACKENDS)
def test_same_bits_every_time(backend):
    problem = choice_problem(np.random.default_rng(1), 6)
    used = make_mip_workspace(backend, problem)
    assert used.solve().x.tobytes() == used.solve().x.tobytes()
    assert used.solve().x.tobytes() == make_mip_workspace(backend, problem).solve().x.tobytes()


@pytest.mark.parametrize("backend", BACKENDS)
def test_indefinite_hessian_is_a_numerical_error(backend):
    problem = choice_problem(np.random.default_rng(1), 3)
    problem.hessian[0, 0] = -1.0
    assert make_mip_workspace(backend, problem).solve().status is SolveStatus.NUMERICAL_ERROR


def test_limit_of_rounds_is_a_status():
    problem = choice_problem(np.random.default_rng(1), 6)
    assert HighsOuterApproximation(problem).solve().iterations > 1
    assert HighsOuterApproximation(problem, round_limit=1).solve().status is SolveStatus.ITERATION_LIMIT


@pytest.mark.parametrize("path", MIXED, ids=lambda path: path.stem)
def test_recorded_instances(path):
    problem = load_instance(path)
    solutions = [make_mip_workspace(name, problem).solve() for name in BACKENDS]
    assert solutions[0].status is solutions[1].status
    if solutions[0].solved:
        np.testing.assert_array_equal(solutions[0].x[problem.binary], solutions[1].x[problem.binary])
        assert problem.objective(solutions[0].x) == pytest.approx(problem.objective(solutions[1].x), rel=1e-6)


@pytest.mark.parametrize("path", MIXED, ids=lambda path: path.stem)
def test_recorded_choice_is_the_cheapest_set(path):
    """Of at most two contacts: fixing each set and solving the QP that is left is an independent way to the optimum."""
    problem = load_instance(path)
    binary, cost = problem.binary, {}
    for taken in (*itertools.combinations(range(binary.size), 1), *itertools.combinations(range(binary.size), 2)):
        chosen = np.isin(np.arange(binary.size), taken).astype(float)
        if (chosen < problem.x_lower[binary]).any() or (chosen > problem.x_upper[binary]).any():
            continue  # leaves out a contact that is held, or takes an empty slot
        fixed = QuadraticProgram(problem.variables, problem.rows, problem.soft_weight)
        fixed.copy_from(problem)
        fixed.x_lower[binary] = fixed.x_upper[binary] = chosen
        solution = make_workspace("daqp", fixed).solve()
        if solution.solved:
            cost[taken] = problem.objective(solution.x)
    solution = make_mip_workspace("daqp", problem).solve()
    assert bool(cost) == solution.solved
    if solution.solved:
        best = min(cost, key=cost.get)
        assert tuple(np.flatnonzero(solution.x[binary] > 0.5)) == best
        assert problem.objective(solution.x) == pytest.approx(cost[best], rel=1e-6)


def test_unknown_backend_lists_the_choices():
    with pytest.raises(WbmpcError, match=r"'higs', did you mean 'highs'\? \(choices: daqp, highs\)"):
        make_mip_workspace("higs", QuadraticProgram(1, 0))
