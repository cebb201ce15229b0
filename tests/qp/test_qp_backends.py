"""Every QP backend against the optimality conditions and against the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from random_problems import kkt_residual, random_problem

from wbmpc.errors import WbmpcError
from wbmpc.qp import QP_BACKENDS, QuadraticProgram, load_instance, make_workspace
from wbmpc.qp import daqp_workspace as daqp_module
from wbmpc.qp.workspace import qp_backend_names
from wbmpc.signals import SolveStatus

NATIVE = list(QP_BACKENDS)
ALL = qp_backend_names()
# HiGHS' QP fails on about 1 % of dense problems (wbmpc/qp/highs_models.py): judged apart, by honest statuses.
RELIABLE = [name for name in ALL if name != "qpsolvers:highs"]
INSTANCES = sorted(Path(__file__).parent.glob("instances/*.npz"))
CONTINUOUS = [path for path in INSTANCES if not load_instance(path).binary.size]
shapes = st.tuples(st.integers(1, 24), st.integers(0, 24), st.integers(0, 8), st.integers(0, 8)).map(
    lambda s: (s[0], s[1], min(s[2], s[1] // 3, s[0] // 3), min(s[3], s[1] // 2))
)


@pytest.mark.parametrize("backend", RELIABLE)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), shape=shapes, bounded=st.booleans())
def test_solution_meets_the_optimality_conditions(backend, seed, shape, bounded):
    variables, rows, equalities, soft = shape
    problem = random_problem(
        np.random.default_rng(seed), variables, rows, equalities=equalities, soft=soft, bounded=bounded
    )
    solution = make_workspace(backend, problem).solve()
    assert solution.status is SolveStatus.SOLVED
    assert kkt_residual(problem, solution.x) < 2e-5


def test_refusal_of_a_feasible_problem_is_not_called_infeasible(monkeypatch):
    """qpsolvers tells only "not found"; here the wrapped solver never finds anything."""
    monkeypatch.setattr(qpsolvers, "solve_problem", lambda problem, **_: qpsolvers.Solution(problem, found=False))
    problem = random_problem(np.random.default_rng(0), 20, 18, equalities=1, soft=2)
    workspace = make_workspace("qpsolvers:daqp", problem)
    assert workspace.solve().status is SolveStatus.NUMERICAL_ERROR
    problem.matrix[3], problem.lower[3], problem.upper[3] = problem.matrix[0], 9.0, 9.5  # row 0 is an equality near 0
    assert abs(problem.lower[0]) < 9.0
    assert workspace.solve().status is SolveStatus.INFEASIBLE


def test_backends_agree_on_a_medium_problem():
    problem = random_problem(np.random.default_rng(7), 40, 60, equalities=8, soft=12)
    solutions = {name: make_workspace(name, problem).solve() for name in ALL}
    for name, solution in solutions.items():
        np.testing.assert_allclose(solution.x, solutions["daqp"].x, atol=2e-5, err_msg=name)
        assert problem.objective(solution.x) == pytest.approx(problem.objective(solutions["daqp"].x), rel=1e-6)


def test_soft_penalty_is_the_stated_one():
    """½ x² with the soft row x >= 1 of weight w: the optimum is x = w / (1 + w), whatever the row's scale."""
    for name in ALL:
        for weight, scale in ((1.0, 1.0), (40.0, 1.0), (40.0, 1e2)):
            problem = QuadraticProgram(1, 1, [weight])
            problem.hessian[0, 0], problem.matrix[0, 0], problem.lower[0] = 1.0, scale, scale
            expected = weight * scale**2 / (1.0 + weight * scale**2)
            assert make_workspace(name, problem).solve().x[0] == pytest.approx(expected, abs=1e-6), name


@pytest.mark.parametrize("backend", NATIVE)
def test_warm_start_follows_a_changing_problem(backend):
    """Rows that vanish, turn into equalities and back, and jumps: each answer is the optimum of the problem now."""
    rng = np.random.default_rng(11)
    problem = random_problem(rng, 14, 18, soft=4)
    start, other = random_problem(rng, 14, 18, soft=4), random_problem(rng, 14, 18, soft=4)
    workspace = make_workspace(backend, problem)
    for step in range(60):
        share = 0.5 - 0.5 * np.cos(0.2 * step) if step != 40 else 1.0
        for name in ("hessian", "gradient", "matrix"):
            getattr(problem, name)[:] = (1.0 - share) * getattr(start, name) + share * getattr(other, name)
        inside = np.sin(0.1 * step + np.arange(14))
        problem.matrix[1] *= step % 10 < 5  # a contact that comes and goes
        problem.lower[:] = problem.matrix @ inside - 0.3
        problem.upper[:] = problem.matrix @ inside + 0.2
        problem.lower[14:] += 1.0
        problem.upper[14:] += 1.0
        if step % 7 < 3:
            problem.lower[2:5] = problem.upper[2:5]
        problem.x_lower[:], problem.x_upper[:] = inside - 1.0, inside + 1.0
        solution = workspace.solve()
        assert solution.status is SolveStatus.SOLVED, step
        assert kkt_residual(problem, solution.x) < 2e-5, step
        if step % 7 == 0:
            fresh = make_workspace(backend, problem).solve()
            np.testing.assert_allclose(solution.x, fresh.x, atol=2e-6)


@pytest.mark.parametrize("backend", ALL)
def test_new_gradient_and_bounds_without_new_matrices(backend):
    rng = np.random.default_rng(5)
    problem = random_problem(rng, 12, 10, equalities=2, soft=3)
    workspace = make_workspace(backend, problem)
    assert workspace.solve().solved
    for _ in range(10):
        problem.gradient[:] += rng.normal(size=12)
        problem.upper[:2] += 0.01
        problem.lower[:2] += 0.01
        problem.x_upper[:] += 0.02
        solution = workspace.solve(matrices_changed=False)
        assert solution.solved
        assert kkt_residual(problem, solution.x) < 2e-5


def test_warm_start_saves_iterations():
    problem = random_problem(np.random.default_rng(3), 40, 60, equalities=6)
    workspace = make_workspace("daqp", problem)
    cold = workspace.solve()
    problem.gradient *= 1.0001
    warm = workspace.solve()
    assert cold.iterations > 20
    assert warm.iterations < 5


@pytest.mark.parametrize("backend", ALL)
def test_infeasible_is_a_status_and_is_forgotten(backend):
    problem = random_problem(np.random.default_rng(2), 8, 6)
    workspace = make_workspace(backend, problem)
    before = workspace.solve()
    matrix, lower, upper = problem.matrix.copy(), problem.lower.copy(), problem.upper.copy()

    problem.matrix[1] = problem.matrix[0]
    problem.lower[:2], problem.upper[:2] = (1.0, 3.0), (2.0, 4.0)  # a·x <= 2 and a·x >= 3
    for _ in range(2):
        solution = workspace.solve()
        assert solution.status is SolveStatus.INFEASIBLE
        assert np.isnan(solution.x).all()
    problem.matrix[:] = 0.0  # 0·x >= 1
    assert workspace.solve().status is SolveStatus.INFEASIBLE

    problem.matrix[:], problem.lower[:], problem.upper[:] = matrix, lower, upper
    np.testing.assert_allclose(workspace.solve().x, before.x, atol=1e-5)


@pytest.mark.parametrize("backend", ALL)
@pytest.mark.parametrize(
    ("array", "value", "status"),
    [
        ("hessian", np.nan, SolveStatus.NUMERICAL_ERROR),
        ("gradient", np.inf, SolveStatus.NUMERICAL_ERROR),
        ("matrix", np.nan, SolveStatus.NUMERICAL_ERROR),
        ("lower", np.nan, SolveStatus.NUMERICAL_ERROR),
        ("x_upper", np.nan, SolveStatus.NUMERICAL_ERROR),
        ("lower", np.inf, SolveStatus.INFEASIBLE),
        ("lower", 1e3, SolveStatus.INFEASIBLE),  # crosses the upper bound
        ("x_upper", -np.inf, SolveStatus.INFEASIBLE),
    ],
)
def test_bad_numbers_are_a_status_and_leave_no_trace(backend, array, value, status):
    problem = random_problem(np.random.default_rng(4), 6, 5, soft=2)
    workspace = make_workspace(backend, problem)
    before = workspace.solve()
    entry = getattr(problem, array).reshape(-1)
    kept, entry[-1] = entry[-1], value
    assert workspace.solve().status is status
    entry[-1] = kept
    after = workspace.solve(matrices_changed=False)
    np.testing.assert_allclose(after.x, before.x, atol=1e-5)


@pytest.mark.parametrize("backend", NATIVE)
def test_indefinite_hessian_is_a_numerical_error(backend):
    problem = random_problem(np.random.default_rng(4), 6, 5, bounded=False)
    problem.hessian[:] = -np.eye(6)
    assert make_workspace(backend, problem).solve().status is SolveStatus.NUMERICAL_ERROR


def test_iteration_limit_is_a_status(monkeypatch):
    monkeypatch.setattr(daqp_module, "ITERATION_LIMIT", 3)
    problem = random_problem(np.random.default_rng(3), 40, 60)
    assert make_workspace("daqp", problem).solve().status is SolveStatus.ITERATION_LIMIT


@pytest.mark.parametrize("backend", NATIVE)
def test_same_history_same_bits_whatever_else_is_solved(backend):
    def run(disturb: bool) -> bytes:
        rng = np.random.default_rng(9)
        problem, other = random_problem(rng, 20, 25, soft=5), random_problem(rng, 20, 25)
        workspace, disturber = make_workspace(backend, problem), make_workspace(backend, other)
        answers = []
        for _ in range(8):
            problem.gradient[:] += 0.3 * rng.normal(size=20)
            if disturb:
                disturber.solve()
            answers.append(workspace.solve().x.tobytes())
        return b"".join(answers)

    assert run(disturb=False) == run(disturb=True) == run(disturb=False)


def test_solution_outlives_the_next_solve():
    problem = random_problem(np.random.default_rng(1), 6, 4)
    workspace = make_workspace("daqp", problem)
    first = workspace.solve().x
    kept = first.copy()
    problem.gradient[:] = -problem.gradient
    assert not np.array_equal(workspace.solve().x, kept)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("path", CONTINUOUS, ids=lambda path: path.stem)
def test_default_solves_recorded_instances(path):
    problem = load_instance(path)
    solution = make_workspace("daqp", problem).solve()
    assert solution.status is SolveStatus.SOLVED
    assert kkt_residual(problem, solution.x) < 1e-8


@pytest.mark.parametrize("backend", [name for name in RELIABLE if name != "daqp"])
def test_backends_never_differ_on_recorded_instances(backend):
    """Weights from 1e-5 to 1e5 in one problem are hard for ADMM: OSQP may say so, but not answer something else."""
    solved = 0
    for path in CONTINUOUS:
        problem = load_instance(path)
        solution = make_workspace(backend, problem).solve()
        if not solution.solved:
            assert solution.status in (SolveStatus.ITERATION_LIMIT, SolveStatus.NUMERICAL_ERROR), path.stem
            continue
        solved += 1
        cost = problem.objective(make_workspace("daqp", problem).solve().x)
        assert problem.objective(solution.x) == pytest.approx(cost, rel=1e-5), path.stem
        assert kkt_residual(problem, solution.x) < 1e-4, path.stem
    assert solved >= 0.7 * len(CONTINUOUS) > 0


def test_unknown_backend_lists_the_choices():
    problem = QuadraticProgram(1, 0)
    with pytest.raises(WbmpcError, match=r"'dapq', did you mean 'daqp'\? \(choices: daqp, osqp, qpsolvers:"):
        make_workspace("dapq", problem)
    with pytest.raises(WbmpcError, match="binary variables need one of daqp, highs"):
        make_workspace("daqp", QuadraticProgram(2, 0, binary=[0]))


@pytest.mark.parametrize("backend", NATIVE)
@pytest.mark.parametrize("rounding", [0.0, 1e-12])
def test_redundant_equalities_are_no_contradiction(backend, rounding):
    """Two feet of one closed chain constrain some directions twice."""
    problem = random_problem(np.random.default_rng(8), 10, 9, equalities=3, bounded=False)
    problem.matrix[3] = problem.matrix[0] - 2.0 * problem.matrix[1]
    problem.lower[3] = problem.upper[3] = problem.lower[0] - 2.0 * problem.lower[1] + rounding
    workspace = make_workspace(backend, problem)
    for _ in range(3):
        solution = workspace.solve()
        assert solution.status is SolveStatus.SOLVED
        assert kkt_residual(problem, solution.x) < 2e-5
        problem.gradient *= 1.01
    problem.lower[3] = problem.upper[3] = problem.lower[3] + 0.5
    assert workspace.solve().status is SolveStatus.INFEASIBLE
    assert make_workspace(backend, problem).solve().status is SolveStatus.INFEASIBLE


@pytest.mark.parametrize("number", [2542, 14039, 67924])
def test_warm_start_from_an_unrelated_problem(number):
    """Pairs on which daqp 0.11 itself, warm-started, calls a far from optimal point optimal."""
    soft = number % 4
    problem = QuadraticProgram(10, 9, np.concatenate([np.zeros(9 - soft), np.full(soft, 50.0)]))
    workspace = make_workspace("daqp", problem)
    for seed in (number - 4, number):
        rng = np.random.default_rng(5_000_000 + seed)
        problem.copy_from(random_problem(rng, 10, 9, equalities=seed % 3, soft=soft))
        if seed % 5 == 0:
            problem.lower[3] += 3.0
            problem.upper[3] += 3.0
        solution = workspace.solve()
    assert solution.solved
    assert kkt_residual(problem, solution.x) < 1e-8
