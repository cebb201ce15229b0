"""Stage 2's velocity tasks linearised at a configuration, in one compiled call."""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.frame_terms import frame_rows, rotation_of, turn_to_level
from wbmpc.jit import kernel
from wbmpc.signals import Vector

LIMIT_TIME = 0.1  # [s] within which a joint may come to its end
BASE_SPEED = 5.0  # [m/s, rad/s] bound on the base's velocity
FASTEST_PULL = 0.4  # [m/s] of a palm that is off its reference
COM, HANDS, TORSO, FEET = slice(0, 3), slice(3, 9), slice(9, 12), slice(12, 24)  # rows of the tasks' Jacobian


class Pulls(NamedTuple):
    """How fast errors are taken out, all [1/s]."""

    tracking: float
    torso: float
    posture: float


class Wanted(NamedTuple):
    """What the tasks are at this plan."""

    com: Vector  # (3,) [m]
    soles: Vector  # (2, 3) [m]
    sole_velocities: Vector  # (2, 3) [m/s]
    sole_yaws: Vector  # (2,) [rad]
    sole_yaw_rates: Vector  # (2,) [rad/s]
    palms: Vector  # (2, 3) [m]
    palm_velocities: Vector  # (2, 3) [m/s]
    active: Vector  # (2,) 1 for a palm with a reference
    posture: Vector  # (nj,) [rad]
    torso_up: Vector  # (3,)
    torso_heading: float  # [rad]


@kernel
def linearise(
    pin: Any,
    frames: NDArray[np.int64],
    chains: NDArray[np.int64],
    lengths: NDArray[np.int64],
    pulls: Pulls,
    q: Vector,
    limits: Vector,
    wanted: Wanted,
) -> tuple[Vector, Vector, Vector, Vector]:
    """Jacobian (24, nv) and velocity (24,) of CoM, hands, torso and feet, in these rows; then (3, nv) the
    posture's velocity and the bounds on q̇; then (5, 3) where the palms are, and the torso's rotation.

    Args:
        pin: Pinocchio's views at q, see `Kinematics`.
        frames, chains, lengths: of soles, palms and torso, see `chains_of`.
        limits: (3, nj) lowest and highest angle [rad], largest speed [rad/s].
    """
    J, com_jacobian, com, poses = pin
    nj = len(wanted.posture)
    nv = nj + 6
    jacobian, velocity = np.zeros((24, nv)), np.zeros(24)
    com_J, hand_J, torso_J, foot_J = jacobian[:3], jacobian[3:9], jacobian[9:12], jacobian[12:]
    com_velocity, hand_velocity, torso_velocity, foot_velocity = (
        velocity[:3],
        velocity[3:9],
        velocity[9:12],
        velocity[12:],
    )
    joints = np.zeros((3, nv))
    posture_velocity, lower, upper = joints[0], joints[1], joints[2]
    com_J[:] = com_jacobian
    turn = np.empty(3)
    for i in range(3):
        com_velocity[i] = pulls.tracking * (wanted.com[i] - com[i])
    for side in range(2):
        first = 6 * side
        sole, palm = poses[frames[side], 3], poses[frames[2 + side], 3]
        frame_rows(J, chains[side], lengths[side], sole, foot_J[first : first + 6])
        turn_to_level(wanted.sole_yaws[side], rotation_of(poses, frames[side]), turn)
        for i in range(3):
            error = wanted.soles[side, i] - sole[i]
            foot_velocity[first + i] = wanted.sole_velocities[side, i] + pulls.tracking * error
            foot_velocity[first + 3 + i] = pulls.tracking * turn[i]
        foot_velocity[first + 5] += wanted.sole_yaw_rates[side]
        first = 3 * side
        frame_rows(J, chains[2 + side], lengths[2 + side], palm, hand_J[first : first + 3])
        if wanted.active[side] > 0.0:
            square = 0.0
            for i in range(3):
                square += (pulls.tracking * (wanted.palms[side, i] - palm[i])) ** 2
            share = pulls.tracking * min(1.0, FASTEST_PULL / max(sqrt(square), 1e-9))
            for i in range(3):
                error = wanted.palms[side, i] - palm[i]
                hand_velocity[first + i] = wanted.palm_velocities[side, i] + share * error
    torso, up = rotation_of(poses, frames[4]), wanted.torso_up
    for c in range(lengths[4]):
        for i in range(3):
            torso_J[i, chains[4, c]] = J[3 + i, chains[4, c]]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        torso_velocity[i] = pulls.torso * (torso[j, 2] * up[k] - torso[k, 2] * up[j])
    turned = wanted.torso_heading - atan2(torso[1, 0], torso[0, 0])
    torso_velocity[2] += pulls.torso * ((turned + pi) % (2.0 * pi) - pi)
    lower[:6], upper[:6] = -BASE_SPEED, BASE_SPEED
    for i in range(nj):
        angle, speed = q[7 + i], limits[2, i]
        posture_velocity[6 + i] = pulls.posture * (wanted.posture[i] - angle)
        lower[6 + i] = min(max((limits[0, i] - angle) / LIMIT_TIME, -speed), 0.0)
        upper[6 + i] = min(max((limits[1, i] - angle) / LIMIT_TIME, 0.0), speed)
    found = np.empty((5, 3))
    found[0], found[1], found[2:] = poses[frames[2], 3], poses[frames[3], 3], torso
    return jacobian, velocity, joints, found
