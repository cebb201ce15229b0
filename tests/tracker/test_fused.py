"""Compiled assembly against the plain one: the same program for any state, setpoint and history."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tracker_case import ROBOT, STEP, make_tracker, near_home, standing, state

from wbmpc.signals import HandMode, RobotState, Setpoint, Vector
from wbmpc.tracker.fused import FusedAssembly
from wbmpc.tracker.plain import PlainAssembly
from wbmpc.tracker.program import TrackerProgram
from wbmpc.tracker.settings import TrackerSettings

seeds = st.integers(0, 2**32 - 1)


def unit(rng: np.random.Generator, *shape: int) -> Vector:
    vector = rng.normal(size=(*shape, 3))
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


def anything(seed: int) -> tuple[RobotState, Setpoint]:
    """A state with arms near the trunk or not, and a setpoint with every mode, limit and half-space in some draw."""
    rng = np.random.default_rng(seed)
    q, v = near_home(seed, spread=rng.choice([0.05, 0.5]), speed=rng.choice([0.1, 3.0]))
    here = standing(q)
    keep_out = np.concatenate([unit(rng, 2, 3), rng.normal(scale=0.2, size=(2, 3, 1)), np.zeros((2, 3, 1))], axis=2)
    keep_out[..., 4] = [0.0, 0.5, 1.0]
    keep_out[rng.random((2, 3)) < 0.4, 3] = -np.inf
    setpoint = replace(
        here,
        **{
            name: getattr(here, name) + rng.normal(scale=0.05, size=np.shape(getattr(here, name)))
            for name in ("com_position", "com_velocity", "com_acceleration", "joint_position", "joint_velocity")
        },
        torso_rotation=here.torso_rotation @ _rotation(unit(rng), rng.choice([0.1, 3.0])),
        torso_angular_velocity=rng.normal(size=3),
        foot_stance=rng.random(2) < 0.5,
        foot_position=here.foot_position + rng.normal(scale=0.02, size=(2, 3)),
        foot_yaw=rng.normal(size=2),
        foot_yaw_rate=rng.normal(size=2),
        foot_velocity=rng.normal(size=(2, 3)),
        foot_acceleration=rng.normal(size=(2, 3)),
        hand_mode=np.array([HandMode.CARRY] * 2) if rng.random() < 0.2 else rng.integers(0, 3, size=2),
        hand_position=here.hand_position + rng.normal(scale=0.05, size=(2, 3)),
        hand_velocity=rng.normal(scale=rng.choice([1e-3, 0.3]), size=(2, 3)),
        hand_acceleration=rng.normal(size=(2, 3)),
        hand_urgency=rng.choice([0.0, 0.3, 1.0], size=2),
        hand_force=rng.normal(scale=3.0, size=(2, 3)),
        hand_force_cap=rng.uniform(0.0, 9.0, size=2),
        hand_normal=unit(rng, 2),
        hand_friction=rng.uniform(0.2, 0.9, size=2),
        arm_keep_out=keep_out,
    )
    palm_force = rng.normal(scale=4.0, size=(2, 3))
    return state(q, v, palm_force_in_world=palm_force, mass_scale=rng.uniform(0.8, 1.2)), setpoint


def _rotation(axis: Vector, angle: float) -> Vector:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def assert_same_program(one: TrackerProgram, other: TrackerProgram) -> None:
    bounded = np.isfinite(one.qp.lower) | np.isfinite(
        one.qp.upper
    )  # what a row without bounds holds is nobody's affair
    assert_allclose(other.qp.matrix[bounded], one.qp.matrix[bounded], rtol=1e-9, atol=1e-9)
    for name in ("hessian", "gradient", "all_lower", "all_upper"):
        expected = getattr(one.qp, name)
        scale = np.abs(expected[np.isfinite(expected)]).max()
        assert_allclose(getattr(other.qp, name), expected, rtol=1e-9, atol=1e-11 * scale, err_msg=name)
    for name in ("base_map", "base_offset", "torque_offset", "torque_lower", "torque_upper"):
        assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=1e-9, err_msg=name)


@settings(max_examples=150, deadline=None)
@given(seed=seeds, ticks=st.integers(1, 3))
def test_both_write_the_same_program(seed: int, ticks: int) -> None:
    options = TrackerSettings()
    programs = [TrackerProgram(ROBOT, options) for _ in range(2)]
    assemblies = [
        make(ROBOT, options, program, step=STEP)
        for make, program in zip((PlainAssembly, FusedAssembly), programs, strict=True)
    ]
    for tick in range(ticks):  # integrals and filtered forces go on from tick to tick
        now, setpoint = anything(seed + tick)
        for assembly in assemblies:
            assembly.build(now, setpoint)
        assert_same_program(*programs)
    for side, mode in enumerate(setpoint.hand_mode):
        if mode in (HandMode.CONTACT, HandMode.CARRY):
            assert_allclose(programs[1].contact_rotation[2 + side], programs[0].contact_rotation[2 + side], atol=1e-12)
    assert_allclose(programs[1].contact_rotation[:2], programs[0].contact_rotation[:2], atol=1e-12)


@pytest.mark.parametrize("half_turn", [np.array(axis) for axis in np.eye(3)])
def test_half_a_turn_of_the_torso(half_turn: Vector) -> None:
    now, setpoint = anything(3)
    rotation = standing(now.q).torso_rotation
    setpoint = replace(setpoint, torso_rotation=_rotation(half_turn, np.pi) @ rotation)
    programs = [TrackerProgram(ROBOT, TrackerSettings()) for _ in range(2)]
    PlainAssembly(ROBOT, TrackerSettings(), programs[0], step=STEP).build(now, setpoint)
    FusedAssembly(ROBOT, TrackerSettings(), programs[1], step=STEP).build(now, setpoint)
    one, other = programs[0].qp.gradient, programs[1].qp.gradient
    assert_allclose(other, one, atol=1e-6 * np.abs(one).max())


@pytest.mark.parametrize("seed", range(6))
def test_the_torques_are_the_same(seed: int) -> None:
    now, setpoint = anything(seed)
    one, other = (make_tracker(assembly=name).solve(now, setpoint) for name in ("plain", "fused"))
    assert other.status == one.status
    assert_allclose(other.torque, one.torque, atol=1e-6)
    assert_allclose(other.palm_force_in_world, one.palm_force_in_world, atol=1e-5)
