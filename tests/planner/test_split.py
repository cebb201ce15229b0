"""The split of stage 2 into CoM and joints: nothing of the one QP's optimum is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_form import JointForm
from numpy.testing import assert_allclose
from whole_body_case import PREVIEW, ROBOT, SETTINGS, arguments, random_problem, solve, stage, velocity_tasks

from wbmpc.planner.joint_velocities import JointVelocities
from wbmpc.qp import make_workspace
from wbmpc.signals import Vector

ASKING, MOVING = stage(ask_shift=True), stage(ask_shift=False)
ONE = {ask: JointForm(PREVIEW, ROBOT.nv, SETTINGS, backend="daqp", ask_shift=ask) for ask in (False, True)}
speeds = st.floats(-0.5, 0.5)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), ask_shift=st.booleans(), walking=st.booleans(), slow=st.booleans())
def test_the_optimum_is_that_of_one_qp(seed: int, ask_shift: bool, walking: bool, slow: bool) -> None:
    """With stages that have solved other problems before; `slow`: joints that can hardly follow the CoM."""
    problem = random_problem(seed, walking=walking)
    if slow:
        tasks = problem.tasks
        problem = replace(problem, tasks=replace(tasks, lower=0.05 * tasks.lower, upper=0.05 * tasks.upper))
    plan = solve(problem, using=ASKING if ask_shift else MOVING)
    one, solution = ONE[ask_shift].solve(problem.state, **arguments(problem))
    assert one is not None, solution.status.name
    assert_allclose(plan.delta_z, one.delta_z, atol=1e-6)
    assert_allclose(plan.com, one.com, atol=1e-7)
    assert_allclose(plan.zmp, one.zmp, atol=1e-6)
    assert_allclose(plan.footstep_shift, one.footstep_shift, atol=1e-6)
    assert_allclose(plan.joint_velocity, one.joint_velocity, atol=1e-5)


def cost_at(joints: JointVelocities, velocity: Vector) -> float:
    """V(v) up to a constant, from the QP's own objective; the part in v alone is ½ w |v|²."""
    solution, _ = joints.solve(velocity)
    assert solution.solved
    return joints.problem.objective(solution.x) + 0.5 * SETTINGS.com_velocity_cost * float(velocity @ velocity)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), x=speeds, y=speeds)
def test_what_a_com_velocity_costs_has_this_slope(seed: int, x: float, y: float) -> None:
    joints = JointVelocities(ROBOT.nv, SETTINGS, backend="daqp")
    joints.take(velocity_tasks(np.random.default_rng(seed)))
    velocity, step = np.array([x, y]), 1e-4
    _, cost = joints.solve(velocity)
    assert cost is not None
    for axis in range(2):
        d = step * np.eye(2)[axis]
        difference = (cost_at(joints, velocity + d) - cost_at(joints, velocity - d)) / (2 * step)
        assert cost.gradient[axis] == pytest.approx(difference, abs=2e-2, rel=1e-3)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), x=speeds, y=speeds)
def test_the_slope_changes_by_the_curvature_while_no_joint_meets_a_bound(seed: int, x: float, y: float) -> None:
    joints = JointVelocities(ROBOT.nv, SETTINGS, backend="daqp")
    tasks = velocity_tasks(np.random.default_rng(seed))
    wide = np.full(ROBOT.nv, 1e3)
    joints.take(replace(tasks, lower=-wide, upper=wide))
    before, after = joints.solve(np.zeros(2))[1], joints.solve(np.array([x, y]))[1]
    assert before is not None
    assert after is not None
    gradient, curvature = before.of_first_jerk(np.array([x, y]), 0.3)
    assert_allclose(0.3 * after.gradient, gradient, atol=1e-5)
    assert_allclose(0.09 * after.curvature, curvature, atol=1e-5)
    assert (np.linalg.eigvalsh(before.curvature) > -1e-6).all()


def test_a_velocity_that_no_joint_can_follow_is_paid_in_full() -> None:
    """Every coordinate held: V = ½ w |v − J q̇|² with a constant q̇."""
    joints = JointVelocities(ROBOT.nv, SETTINGS, backend="daqp")
    held = np.zeros(ROBOT.nv)
    joints.take(replace(velocity_tasks(), lower=held, upper=held))
    _, cost = joints.solve(np.array([0.1, -0.2]))
    assert cost is not None
    assert_allclose(cost.gradient, SETTINGS.com_velocity_cost * np.array([0.1, -0.2]))
    assert_allclose(cost.curvature, SETTINGS.com_velocity_cost * np.eye(2))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), x=speeds, y=speeds, tight=st.floats(0.01, 2.0))
def test_the_guess_of_held_joints_ends_where_the_backend_does(seed: int, x: float, y: float, tight: float) -> None:
    joints = JointVelocities(ROBOT.nv, SETTINGS, backend="daqp")
    joints.take(replace(velocity_tasks(np.random.default_rng(seed)), lower=-np.full(ROBOT.nv, tight)))
    for velocity in (np.array([x, y]), np.array([y, -x])):
        solution, _ = joints.solve(velocity)
        assert_allclose(solution.x, make_workspace("daqp", joints.problem).solve().x, atol=1e-6)
