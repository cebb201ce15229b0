"""The problem's arrays, its cost, and its files."""

from __future__ import annotations

import numpy as np
import pytest
from random_problems import random_problem

from wbmpc.errors import WbmpcError
from wbmpc.qp import QuadraticProgram, load_instance, save_instance
from wbmpc.qp.verdicts import closes_duality_gap


def test_arrays_cannot_be_rebound_but_can_be_written():
    problem = QuadraticProgram(3, 2)
    with pytest.raises(AttributeError, match=r"problem\.lower\[\.\.\.\]"):
        problem.lower = np.zeros(2)
    problem.gradient += 1.0
    np.testing.assert_array_equal(problem.gradient, 1.0)


def test_bounds_are_views_of_one_array():
    problem = QuadraticProgram(2, 1, binary=[1])
    problem.x_lower[0], problem.lower[0] = -3.0, 5.0
    np.testing.assert_array_equal(problem.all_lower, [-3.0, 0.0, 5.0])
    np.testing.assert_array_equal(problem.all_upper, [np.inf, 1.0, np.inf])


def test_cost_counts_the_violation_of_soft_rows_only():
    problem = QuadraticProgram(1, 3, [0.0, 4.0, 6.0])
    problem.hessian[0, 0], problem.gradient[0], problem.matrix[:] = 2.0, 1.0, 1.0
    problem.upper[:] = [0.0, 1.0, 5.0]
    # x = 3: ½·2·9 + 3, the first row is hard, the second is exceeded by 2, the third not at all
    assert problem.objective(np.array([3.0])) == pytest.approx(9.0 + 3.0 + 0.5 * 4.0 * 2.0**2)


@pytest.mark.parametrize("weight", [[1.0], [1.0, -1.0], [1.0, np.nan], [[1.0, 1.0]]])
def test_bad_weights_are_refused(weight):
    with pytest.raises(WbmpcError, match="soft_weight must be 2 finite numbers"):
        QuadraticProgram(3, 2, weight)


def test_bad_binary_index_is_refused():
    with pytest.raises(WbmpcError, match=r"0\.\.2, received \[3\]"):
        QuadraticProgram(3, 2, binary=[3])


def test_instance_round_trip(tmp_path):
    problem = random_problem(np.random.default_rng(0), 5, 4, soft=2)
    save_instance(problem, tmp_path / "instance.npz")
    again = load_instance(tmp_path / "instance.npz")
    for name in ("hessian", "gradient", "matrix", "all_lower", "all_upper", "soft_weight", "binary"):
        np.testing.assert_array_equal(getattr(again, name), getattr(problem, name))


def test_files_that_are_no_instances_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", hessian=np.eye(2))
    with pytest.raises(WbmpcError, match="not a recorded problem"):
        load_instance(tmp_path / "other.npz")
    arrays = {name: np.zeros(3) for name in ("hessian", "gradient", "all_lower", "all_upper")}
    np.savez(tmp_path / "shape.npz", matrix=np.zeros((1, 2)), soft_weight=np.zeros(1), binary=np.zeros(0), **arrays)
    with pytest.raises(WbmpcError, match="hessian has shape"):
        load_instance(tmp_path / "shape.npz")


@pytest.mark.parametrize(
    ("multiplier", "closes"),
    [
        ([0.0, 2.0], True),  # the lower bound of x₁ is at 1: f = 1, gᵀx = 0, λᵀb = −2 on the side of its sign
        ([0.0, 1.0], False),
        ([-1.0, 2.0], False),  # x₀ has no lower bound; inf is no gap that closes
        ([1.0, 2.0], False),
    ],
)
def test_a_duality_gap_closes_at_the_optimum_only(multiplier: list[float], closes: bool) -> None:
    """minimise x₀² + x₁² with x₁ >= 1, whose multiplier is −2."""
    x, cost = np.array([0.0, 1.0]), 1.0
    lower, upper = np.array([-np.inf, 1.0]), np.full(2, np.inf)
    sign = np.array(multiplier) * [1.0, -1.0]
    assert closes_duality_gap(x, cost, sign, np.zeros(2), lower, upper, 1e-6) is closes
