"""When the tracker's QP has no answer; that the answer does not depend on who solves it; limits of the joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tracker_case import ROBOT, bracing, make_tracker, near_home, standing, state

from wbmpc.signals import HandMode, RobotState, Setpoint, SolveStatus
from wbmpc.tracker.constraints import JointLimits

Case = Callable[[], tuple[RobotState, Setpoint]]


def impossible_force() -> tuple[RobotState, Setpoint]:
    """A hand's force at least zero and at most -1 N."""
    return state(), bracing(ROBOT.home_q, cap=-1.0, force=1.0)


def unknown_posture() -> tuple[RobotState, Setpoint]:
    q = ROBOT.home_q.copy()
    q[2] = np.nan
    q[12] = np.nan
    return state(q), standing()


def unknown_wish() -> tuple[RobotState, Setpoint]:
    return state(), standing(com_position=np.full(3, np.nan))


@pytest.mark.parametrize("case", [impossible_force, unknown_posture, unknown_wish])
def test_a_failed_solve_repeats_the_last_torque_with_damping(case: Case) -> None:
    tracker = make_tracker(fallback_damping=0.05)
    good = tracker.solve(state(), standing())
    assert good.status == SolveStatus.SOLVED
    assert not good.fallback
    broken, setpoint = case()
    velocity = np.concatenate([np.zeros(6), np.linspace(-1, 1, ROBOT.nj)])
    with np.errstate(invalid="ignore"):
        command = tracker.solve(replace(broken, v=velocity), setpoint)
    assert command.fallback
    assert command.status not in (SolveStatus.SOLVED, SolveStatus.NOT_RUN)
    assert_allclose(command.torque, good.torque - 0.05 * velocity[6:], atol=1e-12)
    assert_allclose(command.sole_wrench_in_world, 0.0)


def test_the_tick_after_an_infeasible_one_is_solved_again() -> None:
    tracker = make_tracker()
    good = tracker.solve(state(), standing())
    assert tracker.solve(*impossible_force()).status == SolveStatus.INFEASIBLE
    after = tracker.solve(state(), standing())
    assert after.status == SolveStatus.SOLVED
    assert_allclose(after.torque, good.torque, atol=2e-3)  # the integral of the CoM's height has gone on


def test_the_fallback_stays_under_the_servos_line() -> None:
    tracker = make_tracker(fallback_damping=50.0)
    tracker.solve(state(), standing())
    broken, setpoint = impossible_force()
    velocity = np.concatenate([np.zeros(6), np.full(ROBOT.nj, 2.0)])
    torque = tracker.solve(replace(broken, v=velocity), setpoint).torque
    assert (torque <= 0.0).all()
    assert (torque >= -ROBOT.torque_limit).all()


def busy(seed: int) -> tuple[RobotState, Setpoint]:
    q, v = near_home(seed, spread=0.03, speed=0.1)
    modes = np.array([HandMode.MOVE, HandMode.CONTACT])
    return state(q, v), replace(bracing(q, cap=5.0, force=3.0), hand_mode=modes, com_acceleration=np.full(3, 0.2))


@pytest.mark.parametrize("seed", range(4))
def test_an_unrelated_exact_solver_gives_the_same_torques(seed: int) -> None:
    case = busy(seed)
    reference = make_tracker().solve(*case)
    command = make_tracker(qp_backend="qpsolvers:highs").solve(*case)
    assert command.status == SolveStatus.SOLVED
    assert_allclose(command.torque, reference.torque, atol=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_osqp_moves_the_robot_alike(seed: int) -> None:
    """The share of each foot hardly costs anything, so a first-order solver leaves it open; their sum is settled."""
    case = busy(seed)
    forces = []
    for backend in ("daqp", "osqp"):
        command = make_tracker(qp_backend=backend).solve(*case)
        assert command.status == SolveStatus.SOLVED
        forces.append(command.sole_wrench_in_world[:, :3].sum(axis=0) + command.palm_force_in_world.sum(axis=0))
    assert_allclose(forces[1], forces[0], atol=0.03)  # [N], of a weight of 34


# Joint limits

LIMITS = JointLimits(ROBOT, speed_limit=5.0, horizon=0.025, torque_share=0.95)
shares = st.lists(st.floats(0, 1), min_size=ROBOT.nj, max_size=ROBOT.nj).map(np.array)


@settings(max_examples=40, deadline=None)
@given(where=shares, how_fast=shares, up=st.booleans())
def test_joint_bounds_keep_range_and_speed(where: np.ndarray, how_fast: np.ndarray, up: bool) -> None:
    """The worst the bounds allow, integrated for 0.4 s from anywhere a joint could still stop from."""
    span = ROBOT.joint_upper - ROBOT.joint_lower
    sign = 1.0 if up else -1.0
    position = ROBOT.joint_lower + where * span
    room = np.where(up, ROBOT.joint_upper - position, position - ROBOT.joint_lower)
    top = np.minimum(np.minimum(5.0, 0.95 * ROBOT.joint_speed), room / 0.025)  # the horizon's stopping distance
    velocity = sign * how_fast * top
    for _ in range(400):
        lower, upper = LIMITS.acceleration(position, velocity)
        assert (lower <= upper).all()
        velocity = velocity + 1e-3 * (upper if up else lower)
        position = position + 1e-3 * velocity
        assert (np.abs(velocity) <= np.minimum(5.0, ROBOT.joint_speed) + 1e-9).all()
        assert (position <= ROBOT.joint_upper + 0.01).all()
        assert (position >= ROBOT.joint_lower - 0.01).all()
    edge = ROBOT.joint_upper if up else ROBOT.joint_lower
    reached = np.abs(position - edge) < 0.05
    assert (reached | (np.abs(velocity) > 1.0)).all()  # the bounds let a joint come to its limit


@settings(max_examples=60, deadline=None)
@given(where=shares, speed=shares)
def test_joint_bounds_are_those_of_the_horizon(where: np.ndarray, speed: np.ndarray) -> None:
    """After one horizon at the bound, the joint is at its limit or at its top speed, and beyond neither."""
    h, top = 0.025, np.minimum(5.0, 0.95 * ROBOT.joint_speed)
    position = ROBOT.joint_lower + where * (ROBOT.joint_upper - ROBOT.joint_lower)
    velocity = (2 * speed - 1) * top
    lower, upper = LIMITS.acceleration(position, velocity)
    for sign, limit, bound in ((-1, ROBOT.joint_lower, lower), (1, ROBOT.joint_upper, upper)):
        room = sign * (limit - (position + h * velocity + h**2 / 2 * bound))
        spare = top - sign * (velocity + h * bound)
        free = (np.abs(bound) < 1999.0) & (np.abs(position + h * velocity - limit) > 0.08)  # both sides agree
        assert (np.minimum(room, spare)[free] > -1e-9).all()
        assert (np.minimum(room, spare)[free] < 1e-9).all()


@settings(max_examples=40, deadline=None)
@given(beyond=st.floats(0.0, 0.2), speed=st.floats(-5, 5))
def test_a_joint_beyond_its_range_is_led_back(beyond: float, speed: float) -> None:
    position, velocity = ROBOT.joint_upper + beyond, np.full(ROBOT.nj, speed)
    for _ in range(300):
        _, upper = LIMITS.acceleration(position, velocity)
        velocity = velocity + 1e-3 * upper
        position = position + 1e-3 * velocity
    assert (position <= ROBOT.joint_upper + 5e-3).all()
