"""What the tracker returns obeys the equations of motion and the contacts' limits, by Pinocchio and by MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tracker_case import ROBOT, STEP, bracing, com, jacobian, make_tracker, near_home, placement, standing, state

from wbmpc.rotations import contact_frame
from wbmpc.signals import GRAVITY, Setpoint, SolveStatus, TorqueCommand, Vector
from wbmpc.tracker.settings import TrackerSettings

SETTINGS = TrackerSettings()
seeds = st.integers(0, 2**32 - 1)


def free_joint_torque(q: Vector, v: Vector, command: TorqueCommand) -> Vector:
    """M v̇ + h − Jᵀ f (nv,): what the joints have to give; nothing at the base. Recursive Newton-Euler, no matrices."""
    data = ROBOT.pin_model.createData()
    needed = np.array(pin.rnea(ROBOT.pin_model, data, q, v, command.acceleration))  # rotor inertia included
    for side in range(2):
        needed -= jacobian(q, ROBOT.sole_frames[side]).T @ command.sole_wrench_in_world[side]
        needed -= jacobian(q, ROBOT.palm_frames[side])[:3].T @ command.palm_force_in_world[side]
    return needed


def servo_torque(v: Vector, setpoint: Setpoint, needed: Vector) -> Vector:
    """Torques (nj,) that leave `needed` at the joints after viscous and dry friction, within the servo's line."""
    dry = ROBOT.frictionloss * np.tanh(setpoint.joint_velocity / 0.1)
    torque = needed[6:] + ROBOT.damping * v[6:] + dry
    ratio = v[6:] / ROBOT.joint_speed
    stall = SETTINGS.torque_share * ROBOT.torque_limit
    return np.clip(torque, -stall * np.clip(1 + ratio, 0, 1), stall * np.clip(1 - ratio, 0, 1))


@settings(max_examples=30, deadline=None)
@given(seed=seeds, brace=st.booleans())
def test_equations_of_motion(seed: int, brace: bool) -> None:
    q, v = near_home(seed)
    setpoint = bracing(q, cap=8.0, force=5.0) if brace else standing(q)
    setpoint = replace(setpoint, joint_velocity=np.random.default_rng(seed).uniform(-0.3, 0.3, ROBOT.nj))
    command = make_tracker().solve(state(q, v), setpoint)
    assert command.status == SolveStatus.SOLVED
    needed = free_joint_torque(q, v, command)
    assert_allclose(needed[:6], 0.0, atol=1e-6 * ROBOT.mass * GRAVITY)
    assert_allclose(command.torque, servo_torque(v, setpoint, needed), atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(seed=seeds, scale=st.floats(0.7, 1.4))
def test_a_heavier_robot_is_carried(seed: int, scale: float) -> None:
    """The estimated mass scales what the feet carry: Σ f_z = scale · m (c̈_z + g)."""
    q, v = near_home(seed)
    command = make_tracker().solve(state(q, v, mass_scale=scale), standing(q))
    data = ROBOT.pin_model.createData()
    pin.centerOfMass(ROBOT.pin_model, data, q, v, command.acceleration)
    force = command.sole_wrench_in_world[:, :3].sum(axis=0)
    assert_allclose(force, scale * ROBOT.mass * (data.acom[0] + [0.0, 0.0, GRAVITY]), atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, push=st.floats(0, 6), sideways=st.booleans())
def test_contacts_transmit_only_what_they_can(seed: int, push: float, sideways: bool) -> None:
    """Wanted accelerations up to 6 m/s² ask for far more than the soles can give: the cones hold all the same."""
    q, v = near_home(seed, speed=0.5)
    normal = np.array([0.0, 1.0, 0.0]) if sideways else np.array([0.0, 0.0, 1.0])
    direction = np.random.default_rng(seed).normal(size=3)
    setpoint = replace(
        bracing(q, cap=4.0, force=9.0, normal=normal), com_acceleration=push * direction / np.linalg.norm(direction)
    )
    command = make_tracker().solve(state(q, v), setpoint)
    assert command.status == SolveStatus.SOLVED
    half_length, half_width = ROBOT.sole_half_extents - SETTINGS.foot_inset
    for side in range(2):
        R = placement(q, ROBOT.sole_frames[side]).rotation
        force, moment = R.T @ command.sole_wrench_in_world[side, :3], R.T @ command.sole_wrench_in_world[side, 3:]
        assert force[2] >= -1e-6
        assert np.hypot(force[0], force[1]) <= SETTINGS.foot_friction * force[2] + 1e-5
        assert abs(moment[1]) <= half_length * force[2] + 1e-5  # centre of pressure: x = -m_y / f_z, y = m_x / f_z
        assert abs(moment[0]) <= half_width * force[2] + 1e-5
        assert abs(moment[2]) <= SETTINGS.foot_friction * SETTINGS.foot_yaw_radius * force[2] + 1e-5
    hand = contact_frame(normal).T @ command.palm_force_in_world[1]
    assert -1e-6 <= hand[2] <= 4.0 + 1e-6
    assert np.hypot(hand[0], hand[1]) <= 0.5 * hand[2] + 1e-5
    assert_allclose(command.palm_force_in_world[0], 0.0, atol=1e-12)
    ratio = v[6:] / ROBOT.joint_speed
    assert (command.torque <= ROBOT.torque_limit * (1 - ratio) + 1e-9).all()
    assert (command.torque >= -ROBOT.torque_limit * (1 + ratio) - 1e-9).all()


def test_cone_is_used_to_its_edge() -> None:
    """The test above could pass with a cone that is much too narrow: a strong wish must come close to the edge."""
    setpoint = standing(com_acceleration=np.array([6.0, 0.0, 0.0]))
    command = make_tracker().solve(state(), setpoint)
    force = command.sole_wrench_in_world[:, :3].sum(axis=0)
    moment = command.sole_wrench_in_world[:, 4].sum()
    friction = force[0] / (SETTINGS.foot_friction / np.sqrt(2) * force[2])
    pressure = abs(moment) / ((ROBOT.sole_half_extents[0] - SETTINGS.foot_inset) * force[2])
    assert max(friction, pressure) > 0.95


def test_a_swinging_foot_bears_nothing() -> None:
    setpoint = standing(foot_stance=np.array([True, False]))
    command = make_tracker().solve(state(), setpoint)
    assert command.status == SolveStatus.SOLVED
    assert_allclose(command.sole_wrench_in_world[1], 0.0, atol=1e-6)
    assert command.sole_wrench_in_world[0, 2] > 0.5 * ROBOT.mass * GRAVITY


def test_static_stand_against_mujocos_inverse_dynamics() -> None:
    """At rest: torques and foot wrenches carry the weight in MuJoCo's own `mj_inverse`, without a floor."""
    command = make_tracker().solve(state(), standing())
    assert_allclose(command.acceleration, 0.0, atol=0.05)
    model = mujoco.MjModel.from_xml_path(str(ROBOT.path))
    data = mujoco.MjData(model)
    data.qpos[:] = ROBOT.qpos_from_q(ROBOT.home_q)
    mujoco.mj_inverse(model, data)
    needed = data.qfrc_inverse.copy()
    for side, name in enumerate(("left", "right")):
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, model.site(f"{name}_sole").id)
        wrench = command.sole_wrench_in_world[side]
        needed -= linear.T @ wrench[:3] + angular.T @ wrench[3:]
    assert_allclose(needed[:6], 0.0, atol=0.05)
    assert_allclose(needed[6:], command.torque, atol=0.01)
    assert np.abs(command.torque).max() > 0.1  # there is something to compare


def test_com_converges_in_a_world_that_obeys() -> None:
    """Integrate the accelerations: 15 mm forward, 10 mm sideways and 10 mm down settle to a millimetre.

    The posture keeps asking for home, which costs height; it hardly weighs here.
    """
    q, v, tracker = ROBOT.home_q.copy(), np.zeros(ROBOT.nv), make_tracker(posture_weight=1e-3)
    goal = com(q) + np.array([0.015, 0.010, -0.010])
    soles = [placement(q, frame).homogeneous for frame in ROBOT.sole_frames]
    setpoint = standing(com_position=goal)
    for _ in range(1500):
        v = v + STEP * tracker.solve(state(q, v), setpoint).acceleration
        q = ROBOT.integrate(q, STEP * v)
    assert_allclose(com(q), goal, atol=1e-3)
    assert_allclose(v, 0.0, atol=0.03)
    for sole, frame in zip(soles, ROBOT.sole_frames, strict=True):
        assert_allclose(placement(q, frame).homogeneous, sole, atol=1e-3)


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-0.6, 0.8, 0.0]])
@pytest.mark.parametrize("cap", [0.0, 1.0, 3.0])
def test_hand_force_follows_its_cap(cap: float, normal: list[float]) -> None:
    command = make_tracker().solve(state(), bracing(ROBOT.home_q, cap=cap, force=6.0, normal=np.array(normal)))
    assert command.status == SolveStatus.SOLVED
    assert command.palm_force_in_world[1] @ normal == pytest.approx(cap, abs=1e-6)
    if cap == 0.0:
        assert_allclose(command.palm_force_in_world, 0.0, atol=1e-6)


def test_a_ramped_cap_gives_a_ramped_force_without_jumps() -> None:
    tracker, forces, torques = make_tracker(), [], []
    for cap in np.linspace(0.0, 4.0, 81):
        command = tracker.solve(state(), bracing(ROBOT.home_q, cap=cap, force=6.0))
        forces.append(command.palm_force_in_world[1, 2])
        torques.append(command.torque)
    assert_allclose(forces, np.linspace(0.0, 4.0, 81), atol=1e-6)
    assert np.abs(np.diff(torques, axis=0)).max() < 0.02  # [N·m] a tick, of a limit of 2.5
