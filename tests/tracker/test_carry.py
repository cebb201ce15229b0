"""Hands that hold a thing between them: its force is known, how far they are apart is its own affair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tracker_case import ROBOT, jacobian, make_tracker, near_home, placement, standing, state

from wbmpc.signals import GRAVITY, HandMode, Setpoint, SolveStatus, TorqueCommand, Vector

seeds = st.integers(0, 2**32 - 1)
CARRY = np.array([HandMode.CARRY, HandMode.CARRY])


def carrying(q: Vector, *, squeeze: float = 6.0, weight: float = 3.0) -> Setpoint:
    """Both palms where they are, a thing of `weight` [N] squeezed between them with `squeeze` [N]."""
    palms = np.array([placement(q, frame).translation for frame in ROBOT.palm_frames])
    across = (palms[0] - palms[1]) / np.linalg.norm(palms[0] - palms[1])
    down = np.array([0.0, 0.0, -0.5 * weight])
    force = np.array([squeeze * across + down, -squeeze * across + down])
    return standing(q, hand_mode=CARRY, hand_force=force)


def palm_acceleration(q: Vector, v: Vector, command: TorqueCommand, side: int) -> Vector:
    """(3,) [m/s²] of a palm in world, by Pinocchio's own recursion."""
    data, frame = ROBOT.pin_model.createData(), ROBOT.palm_frames[side]
    pin.forwardKinematics(ROBOT.pin_model, data, q, v, command.acceleration)
    pin.updateFramePlacements(ROBOT.pin_model, data)
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.array(pin.getFrameClassicalAcceleration(ROBOT.pin_model, data, frame, aligned).linear)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, squeeze=st.floats(0.0, 8.0), weight=st.floats(0.0, 6.0))
def test_the_known_force_is_in_the_equations_of_motion(seed: int, squeeze: float, weight: float) -> None:
    q, v = near_home(seed, speed=0.1)
    setpoint = carrying(q, squeeze=squeeze, weight=weight)
    command = make_tracker().solve(state(q, v), setpoint)
    assert command.status == SolveStatus.SOLVED
    assert_allclose(command.palm_force_in_world, setpoint.hand_force, atol=1e-6)
    needed = np.array(pin.rnea(ROBOT.pin_model, ROBOT.pin_model.createData(), q, v, command.acceleration))
    for side in range(2):
        needed -= jacobian(q, ROBOT.sole_frames[side]).T @ command.sole_wrench_in_world[side]
        needed -= jacobian(q, ROBOT.palm_frames[side])[:3].T @ setpoint.hand_force[side]
    assert_allclose(needed[:6], 0.0, atol=1e-6 * ROBOT.mass * GRAVITY)


def test_the_feet_carry_the_thing_too() -> None:
    q = ROBOT.home_q
    command = make_tracker().solve(state(q), carrying(q, weight=4.0))
    vertical = command.sole_wrench_in_world[:, 2].sum()
    data = ROBOT.pin_model.createData()
    pin.centerOfMass(ROBOT.pin_model, data, q, np.zeros(ROBOT.nv), command.acceleration)
    assert vertical == pytest.approx(ROBOT.mass * (GRAVITY + data.acom[0][2]) + 4.0, abs=1e-5)


def test_palms_are_raised_together_but_never_pulled_apart() -> None:
    """References 2 cm higher and 2 cm wider than the palms: they accelerate up, and keep their distance."""
    q = ROBOT.home_q
    setpoint = carrying(q)
    moved = setpoint.hand_position + np.array([[0.0, 0.02, 0.02], [0.0, -0.02, 0.02]])
    command = make_tracker().solve(state(q), replace(setpoint, hand_position=moved))
    left, right = (palm_acceleration(q, np.zeros(ROBOT.nv), command, side) for side in range(2))
    assert left[2] > 0.5
    assert right[2] > 0.5
    apart = abs(left[1] - right[1])  # what the rest of the body asks for
    wider = make_tracker().solve(
        state(q), replace(setpoint, hand_mode=np.array([HandMode.MOVE] * 2), hand_position=moved)
    )
    left, right = (palm_acceleration(q, np.zeros(ROBOT.nv), wider, side) for side in range(2))
    assert left[1] - right[1] > max(5.0 * apart, 0.5)  # hands that hold nothing do go there


def test_both_palms_go_sideways_with_the_thing() -> None:
    q = ROBOT.home_q
    setpoint = carrying(q)
    moved = setpoint.hand_position + np.array([0.0, 0.02, 0.0])
    command = make_tracker().solve(state(q), replace(setpoint, hand_position=moved))
    for side in range(2):
        assert palm_acceleration(q, np.zeros(ROBOT.nv), command, side)[1] > 0.5
