"""One Gauss-Newton step of a posture, written with numpy: what wbmpc/planner/posture_kernel.py is held against."""

from __future__ import annotations

import numpy as np
from robots import at, surena

from wbmpc.planner.posture import JOINT_MARGIN, PalmTarget
from wbmpc.planner.posture_kernel import (
    DAMPING,
    ELBOW_CLEARANCE,
    ELBOW_COST,
    HEIGHT_COST,
    LONGEST_PULL,
    PALM_COST,
    POSTURE_COST,
    SOLE_COST,
    STEP_LIMIT,
)
from wbmpc.rotations import UP, cross, level_frame, rotation_error
from wbmpc.signals import Vector


def plain_step(
    q: Vector,
    *,
    nominal: Vector,
    soles: Vector,
    yaws: Vector,
    palms: list[PalmTarget | None],
    com: Vector,
    com_cost: float,
    tilt_cost: float,
) -> Vector:
    """The step (nv,) from `q` (nq,) for soles (2, 3) [m] with headings (2,) and the CoM wanted at `com` (3,) [m]."""
    robot, kinematics = surena(), at(q)
    H, g = np.zeros((robot.nv, robot.nv)), np.zeros(robot.nv)

    def add(weight: float, J: Vector, error: Vector) -> None:
        H[:] += weight * J.T @ J
        g[:] += weight * J.T @ error

    for side, frame in enumerate(robot.sole_frames):
        turn = rotation_error(desired=level_frame(yaws[side]), measured=kinematics.rotation(frame))
        away = soles[side] - kinematics.position(frame)
        add(SOLE_COST, kinematics.jacobian(frame), np.concatenate([away, turn]))
    for side, target in enumerate(palms):
        if target is None:
            continue
        palm, elbow = robot.palm_frames[side], robot.elbow_frames[side]
        J, error = kinematics.jacobian(palm)[:3], target.position - kinematics.position(palm)
        add(PALM_COST, J, error * min(1.0, LONGEST_PULL / np.linalg.norm(error)))
        if target.normal is not None:
            height = target.normal @ (kinematics.position(elbow) - kinematics.position(palm))
            row = target.normal @ (kinematics.jacobian(elbow)[:3] - J)
            if height < ELBOW_CLEARANCE:
                add(ELBOW_COST, row[None], np.array([ELBOW_CLEARANCE - height]))
    J, error = kinematics.com_jacobian, com - kinematics.com
    add(com_cost, J[:2], error[:2])
    add(HEIGHT_COST, J[2:], error[2:])
    torso = robot.torso_frame
    add(tilt_cost, kinematics.jacobian(torso)[3:5], cross(kinematics.rotation(torso)[:, 2], UP)[:2])
    joints = np.arange(6, robot.nv)
    H[joints, joints] += POSTURE_COST
    g[6:] += POSTURE_COST * (nominal[7:] - q[7:])
    H += DAMPING * np.eye(robot.nv)
    step = np.linalg.solve(H, g)
    wanted = q[7:] + step[6:]
    kept = np.clip(wanted, robot.joint_lower + JOINT_MARGIN, robot.joint_upper - JOINT_MARGIN)
    fixed = 6 + np.flatnonzero(kept != wanted)
    free = np.setdiff1d(np.arange(robot.nv), fixed)
    step[fixed] = (kept - q[7:])[fixed - 6]
    step[free] = np.linalg.solve(H[np.ix_(free, free)], g[free] - H[np.ix_(free, fixed)] @ step[fixed])
    return np.clip(step, -STEP_LIMIT, STEP_LIMIT)
