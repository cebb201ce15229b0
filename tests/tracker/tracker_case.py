"""States and setpoints for the tracker's tests, without a plant or a planner."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbmpc.robot import Robot
from wbmpc.signals import HandMode, RobotState, Setpoint, Vector
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tracker import Tracker

ROBOT = Robot.load(Path(__file__).parents[2] / "models" / "surena_mini.xml")
STEP = 1e-3  # [s]
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def placement(q: Vector, frame: int) -> pin.SE3:
    data = ROBOT.pin_model.createData()
    pin.framesForwardKinematics(ROBOT.pin_model, data, q)
    return data.oMf[frame].copy()


def jacobian(q: Vector, frame: int) -> Vector:
    data = ROBOT.pin_model.createData()
    return np.asarray(pin.computeFrameJacobian(ROBOT.pin_model, data, q, frame, WORLD))


def com(q: Vector) -> Vector:
    return np.array(pin.centerOfMass(ROBOT.pin_model, ROBOT.pin_model.createData(), q))


def state(q: Vector = ROBOT.home_q, v: Vector | None = None, **changes: Any) -> RobotState:
    still = RobotState(
        time=0.0,
        q=q,
        v=np.zeros(ROBOT.nv) if v is None else v,
        sole_wrench_in_world=np.zeros((2, 6)),
        palm_force_in_world=np.zeros((2, 3)),
        mass_scale=1.0,
    )
    return replace(still, **changes)


def standing(q: Vector = ROBOT.home_q, **changes: Any) -> Setpoint:
    """Stand still as at `q`, hands free."""
    stay = Setpoint(
        time=0.0,
        com_position=com(q),
        com_velocity=np.zeros(3),
        com_acceleration=np.zeros(3),
        joint_position=q[7:].copy(),
        joint_velocity=np.zeros(ROBOT.nj),
        torso_rotation=placement(q, ROBOT.torso_frame).rotation,
        torso_angular_velocity=np.zeros(3),
        foot_stance=np.ones(2, bool),
        foot_position=np.array([placement(q, f).translation for f in ROBOT.sole_frames]),
        foot_yaw=np.zeros(2),
        foot_yaw_rate=np.zeros(2),
        foot_velocity=np.zeros((2, 3)),
        foot_acceleration=np.zeros((2, 3)),
        hand_mode=np.array([HandMode.FREE, HandMode.FREE]),
        hand_position=np.array([placement(q, f).translation for f in ROBOT.palm_frames]),
        hand_velocity=np.zeros((2, 3)),
        hand_acceleration=np.zeros((2, 3)),
        hand_force=np.zeros((2, 3)),
        hand_force_cap=np.zeros(2),
        hand_normal=np.tile([0.0, 0.0, 1.0], (2, 1)),
        hand_urgency=np.zeros(2),
        hand_friction=np.full(2, 0.5),
        arm_keep_out=np.tile([0.0, 0.0, 0.0, -np.inf, 0.0], (2, 3, 1)),
    )
    return replace(stay, **changes)


def bracing(q: Vector, *, cap: float, force: float, normal: Vector | None = None) -> Setpoint:
    """The right hand on a surface, its force wanted along the normal."""
    out = np.array([0.0, 0.0, 1.0]) if normal is None else normal
    return standing(
        q,
        hand_mode=np.array([HandMode.FREE, HandMode.CONTACT]),
        hand_normal=np.tile(out, (2, 1)),
        hand_force=np.array([np.zeros(3), force * out]),
        hand_force_cap=np.array([0.0, cap]),
    )


def near_home(seed: int, *, spread: float = 0.1, speed: float = 0.3) -> tuple[Vector, Vector]:
    """A random configuration (nq,) and velocity (nv,) around the home posture; knees and elbows stay bent."""
    rng = np.random.default_rng(seed)
    q = ROBOT.integrate(ROBOT.home_q, spread * rng.uniform(-1, 1, ROBOT.nv))
    q[7:] = np.clip(q[7:], ROBOT.joint_lower + 0.02, ROBOT.joint_upper - 0.02)
    return q, speed * rng.uniform(-1, 1, ROBOT.nv)


def make_tracker(**settings: Any) -> Tracker:
    return Tracker(ROBOT, TrackerSettings(**settings), step=STEP)
