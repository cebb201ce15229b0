"""The plan's interpolation against exact integration and finite differences."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from closed_loop import make_planner, scenario, state_at
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from robots import surena

from wbmpc.planner.plan import Plan
from wbmpc.planner.preview import Preview
from wbmpc.signals import Vector

ROBOT = surena()
N, T = 16, 0.1
START = 0.4  # [s] time of the snapshot


@cache
def real_plan() -> Plan:
    planner = make_planner(scenario("stand"))
    return planner.solve(state_at(START, ROBOT.home_q, np.zeros(ROBOT.nv)))


def random_plan(seed: int) -> Plan:
    """A plan with random jerks, whose knots follow from the prediction matrices, and random rates."""
    rng, preview = np.random.default_rng(seed), Preview(steps=N, step=T)
    states = np.empty((N + 1, 3, 3))
    states[0] = rng.uniform(-0.3, 0.3, (3, 3))
    jerk = rng.uniform(-5, 5, (N, 3))
    states[1:, :, 0] = (states[0] @ preview.P_ps.T).T + preview.P_pu @ jerk
    states[1:, :, 1] = (states[0] @ preview.P_vs.T).T + preview.P_vu @ jerk
    states[1:, :, 2] = (states[0] @ preview.P_as.T).T + preview.P_au @ jerk
    return replace(
        real_plan(),
        com_states=states,
        com_jerk=jerk,
        velocity=rng.uniform(-1, 1, ROBOT.nv),
        torso_angular_velocity=rng.uniform(-0.3, 0.3, 3),
        foot_velocity=rng.uniform(-0.1, 0.1, (2, 3)),
        foot_acceleration=rng.uniform(-1, 1, (2, 3)),
        hand_velocity=rng.uniform(-0.3, 0.3, (2, 3)),
        hand_acceleration=rng.uniform(-2, 2, (2, 3)),
        hand_jerk=rng.uniform(-2, 2, (2, 3)),
        hand_force_cap=np.array([4.0, 16.0]),
        hand_force_cap_rate=np.array([66.0, -66.0]),
        hand_force_cap_top=np.array([10.0, 20.0]),
    )


def integrated(plan: Plan, elapsed: float, parts: int = 3200) -> Vector:
    """c, ċ, c̈ (3, 3) by summing the jerk in fine steps of its own cubic."""
    state, h = plan.com_states[0].copy(), N * T / parts
    for k in range(round(elapsed / h)):
        u = plan.com_jerk[min(int((k + 0.5) * h / T), N - 1)]
        p, v, a = state.T
        state = np.column_stack([p + h * v + h**2 / 2 * a + h**3 / 6 * u, v + h * a + h**2 / 2 * u, a + h * u])
    return state


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), tick=st.integers(0, 1600))
def test_com_state_is_the_integral_of_the_jerks(seed: int, tick: int) -> None:
    plan, elapsed = random_plan(seed), tick / 1000
    assert_allclose(plan.com_state(START + elapsed), integrated(plan, elapsed), atol=1e-8)


@given(seed=st.integers(0, 2**32 - 1), knot=st.integers(1, N - 1))
def test_com_state_has_no_jump_at_the_knots(seed: int, knot: int) -> None:
    plan, at = random_plan(seed), START + knot * T
    assert_allclose(plan.com_state(at - 1e-9), plan.com_state(at + 1e-9), atol=1e-6)
    assert_allclose(plan.com_state(at), plan.com_states[knot], atol=1e-9)


def test_com_state_before_the_snapshot_is_the_snapshots() -> None:
    plan = random_plan(0)
    assert_allclose(plan.com_state(START - 1.0), plan.com_states[0])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), tick=st.integers(1, 98))
def test_velocities_are_the_derivatives_of_the_positions(seed: int, tick: int) -> None:
    plan, t, h = random_plan(seed), START + tick / 1000, 1e-4
    before, now, after = (plan.sample(t + d) for d in (-h, 0.0, h))
    for part in ("com", "foot", "hand", "joint"):
        slope = (getattr(after, f"{part}_position") - getattr(before, f"{part}_position")) / (2 * h)
        assert_allclose(getattr(now, f"{part}_velocity"), slope, atol=1e-6)
        if part != "joint":
            slope = (getattr(after, f"{part}_velocity") - getattr(before, f"{part}_velocity")) / (2 * h)
            assert_allclose(getattr(now, f"{part}_acceleration"), slope, atol=1e-5)
    turn = (after.torso_rotation - before.torso_rotation) / (2 * h) @ now.torso_rotation.T
    spin = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
    assert_allclose(spin, now.torso_angular_velocity, atol=0.02)


def test_sample_at_the_snapshot_is_the_snapshot() -> None:
    plan = random_plan(3)
    setpoint = plan.sample(START)
    assert setpoint.time == START
    assert_allclose(setpoint.joint_position, plan.q[7:])
    assert_allclose(setpoint.hand_position, plan.hand_position)
    assert_allclose(setpoint.torso_rotation, plan.torso_rotation)
    assert_allclose(setpoint.hand_force_cap, plan.hand_force_cap)


def test_caps_ramp_and_stop_at_their_ends() -> None:
    plan = random_plan(3)
    assert_allclose(plan.sample(START + 0.05).hand_force_cap, [4.0 + 66 * 0.05, 16.0 - 66 * 0.05])
    long = replace(plan, hand_force_cap_rate=np.array([200.0, -200.0]))
    assert_allclose(long.sample(START + 0.09).hand_force_cap, [10.0, 0.0])


def test_a_late_plans_positions_stop_after_one_knot() -> None:
    plan = random_plan(4)
    late, later = plan.sample(START + T), plan.sample(START + 5 * T)
    assert_allclose(late.joint_position, later.joint_position)
    assert_allclose(late.hand_position, later.hand_position)


@pytest.mark.parametrize("late", [2 * T, N * T + 0.3])
def test_a_late_plans_tail_is_one_motion(late: float) -> None:
    """Where the positions hold still the velocities are zero."""
    plan, h = random_plan(4), 1e-4
    before, now, after = (plan.sample(START + late + d) for d in (-h, 0.0, h))
    for part in ("com", "foot", "hand", "joint"):
        slope = (getattr(after, f"{part}_position") - getattr(before, f"{part}_position")) / (2 * h)
        assert_allclose(getattr(now, f"{part}_velocity"), slope, atol=1e-6)
