"""Stage 2's velocity tasks at a random configuration: the compiled form against Kinematics and the rotations."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from robots import at, surena

from wbmpc.planner.footstep import SoleReferences
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.joint_reference_kernel import FASTEST_PULL
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.rotations import angle_difference, cross, heading_of, level_frame, rotation_error
from wbmpc.signals import HandMode

ROBOT = surena()
SETTINGS = WholeBodySettings()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_tasks_are_those_of_the_kinematics(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = ROBOT.integrate(ROBOT.home_q, rng.uniform(-0.3, 0.3, ROBOT.nv))
    soles = SoleReferences(*(rng.uniform(-0.3, 0.3, shape) for shape in ((2, 3), 2, (2, 3), 2, (2, 3))))
    modes = rng.choice([HandMode.FREE, HandMode.MOVE], 2)
    hands = [(rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.5, 0.5, 3), mode) for mode in modes]
    com, up, heading = rng.uniform(-0.5, 0.5, 3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0)
    reference = JointReference(ROBOT, SETTINGS, q=q)
    tasks = reference.tasks(
        com=com,
        vertical_velocity=0.1,
        soles=soles,
        hands=hands,
        posture=ROBOT.home_q[7:],
        torso_up=up,
        torso_heading=heading,
    )
    kinematics, rate = at(q), SETTINGS.tracking_rate
    assert_allclose(tasks.com_jacobian, kinematics.com_jacobian, atol=1e-12)
    assert_allclose(tasks.com_correction, rate * (com - kinematics.com), atol=1e-12)
    for side, (frame, palm) in enumerate(zip(ROBOT.sole_frames, ROBOT.palm_frames, strict=True)):
        rows = slice(6 * side, 6 * side + 6)
        assert_allclose(tasks.foot_jacobian[rows], kinematics.jacobian(frame), atol=1e-12)
        turn = rotation_error(desired=level_frame(soles.yaws[side]), measured=kinematics.rotation(frame))
        pull = rate * np.concatenate([soles.positions[side] - kinematics.position(frame), turn])
        expected = pull + np.array([*soles.velocities[side], 0.0, 0.0, soles.yaw_rates[side]])
        assert_allclose(tasks.foot_velocity[rows], expected, atol=1e-9)
        rows = slice(3 * side, 3 * side + 3)
        assert_allclose(tasks.hand_jacobian[rows], kinematics.jacobian(palm)[:3], atol=1e-12)
        position, velocity, mode = hands[side]
        pull = rate * (position - kinematics.position(palm))
        pull *= min(1.0, FASTEST_PULL / np.linalg.norm(pull))
        assert_allclose(tasks.hand_velocity[rows], 0.0 if mode == HandMode.FREE else velocity + pull, atol=1e-12)
    torso = kinematics.rotation(ROBOT.torso_frame)
    error = cross(torso[:, 2], up)
    error[2] += angle_difference(heading, heading_of(torso))
    assert_allclose(tasks.torso_jacobian, kinematics.jacobian(ROBOT.torso_frame)[3:], atol=1e-12)
    assert_allclose(tasks.torso_velocity, SETTINGS.torso_rate * error, atol=1e-12)
    assert_allclose(tasks.posture_velocity[6:], SETTINGS.posture_rate * (ROBOT.home_q - q)[7:], atol=1e-12)
    assert (tasks.lower[6:] <= 0.0).all()
    assert (tasks.upper[6:] >= 0.0).all()
    velocity = rng.uniform(-1.0, 1.0, ROBOT.nv)
    places, velocities = reference.palms(velocity)
    for side, palm in enumerate(ROBOT.palm_frames):
        assert_allclose(places[side], kinematics.position(palm), atol=1e-12)
        assert_allclose(velocities[side], kinematics.jacobian(palm)[:3] @ velocity, atol=1e-12)
