"""One tick of the estimator as machine code. tests/plain_estimator.py is the same in numpy; a test compares the two."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbmpc.frame_terms import frame_twists
from wbmpc.jit import short_kernel

VELOCITY_GAIN = 0.06  # share of the odometry's velocity per tick
POSITION_GAIN = 0.1  # share of the odometry's position per tick
JOINT_VELOCITY_GAIN = 0.4  # first-order filter of the joint speeds, per tick
LOADED = 3.0  # [N] vertical force from which a foot counts as standing
MASS_TIME = 0.8  # [s] time constant of the mass estimate
GRAVITY = 9.81  # [m/s²]


@short_kernel
def rotation_of(quaternion, R):  # type: ignore[no-untyped-def]
    """Write the rotation (3, 3) of a quaternion wxyz, which need not have unit length."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)


@short_kernel
def quaternion_of(R, out):  # type: ignore[no-untyped-def]
    """Write the unit quaternion xyzw of a rotation (3, 3), by its largest component."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        t = sqrt(trace + 1.0)
        out[3] = 0.5 * t
        t = 0.5 / t
        out[0], out[1], out[2] = (R[2, 1] - R[1, 2]) * t, (R[0, 2] - R[2, 0]) * t, (R[1, 0] - R[0, 1]) * t
        return
    i = 0
    for j in range(1, 3):
        if R[j, j] > R[i, i]:
            i = j
    j, k = (i + 1) % 3, (i + 2) % 3
    t = sqrt(R[i, i] - R[j, j] - R[k, k] + 1.0)
    out[i] = 0.5 * t
    t = 0.5 / t
    out[3] = (R[k, j] - R[j, k]) * t
    out[j], out[k] = (R[j, i] + R[i, j]) * t, (R[k, i] + R[i, k]) * t


@short_kernel
def turned(R, a, out):  # type: ignore[no-untyped-def]
    """Write R a."""
    for i in range(3):
        out[i] = R[i, 0] * a[0] + R[i, 1] * a[1] + R[i, 2] * a[2]


@short_kernel
def add_cross(a, b, scale, out):  # type: ignore[no-untyped-def]
    """Add scale · a × b to `out`."""
    out[0] += scale * (a[1] * b[2] - a[2] * b[1])
    out[1] += scale * (a[2] * b[0] - a[0] * b[2])
    out[2] += scale * (a[0] * b[1] - a[1] * b[0])


@short_kernel
def advance(seen, frames, memory, twist, mass, step, q, v):  # type: ignore[no-untyped-def]
    """Write q (nq,), v (nv,) and move the memory one tick on; returns the mass's scale.

    `seen` is a Measurement's content, `frames` the soles and the IMU relative to the base, see Estimator.
    """
    joint_position, joint_velocity, quaternion, gyro, accelerometer, wrench, palm_force = seen
    J, chains, lengths, poses, imu_rotation = frames
    position, imu_velocity, filtered, anchor, standing, mass_scale = memory
    nj = joint_position.size
    for j in range(nj):
        filtered[6 + j] += JOINT_VELOCITY_GAIN * (joint_velocity[j] - filtered[6 + j])
    frame_twists(J, filtered, chains, lengths, poses, twist)  # relative to the base: its own part is zero

    world_imu, R, omega = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)  # R: base to world, ω of the base in base
    rotation_of(quaternion, world_imu)
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
            for k in range(3):
                R[i, j] += world_imu[i, k] * imu_rotation[j, k]
    turned(imu_rotation, gyro, omega)
    for i in range(3):
        omega[i] -= twist[2, 3 + i]

    load_sum = vertical = 0.0
    velocity, away = np.zeros(3), np.zeros(3)  # of the base by odometry: in base; in world, from where it is believed
    pressure, moment, moving, point, turn = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for side in range(2):
        load, sole = wrench[side, 2], poses[side]
        vertical += load + palm_force[side, 2]
        if not load >= LOADED:
            standing[side] = False
            continue
        turned(R, sole, turn)
        if not standing[side]:
            standing[side] = True
            for i in range(3):
                anchor[side, i] = position[i] + turn[i]
        # the point that stands still is the centre of pressure, not the sole's centre: a foot rolls over its edge
        moment[0], moment[1], moment[2] = -wrench[side, 4] / load, wrench[side, 3] / load, 0.0
        turned(R.T, moment, pressure)
        for i in range(3):
            point[i] = sole[i] + pressure[i]
            moving[i] = twist[side, i]
            away[i] += load * (anchor[side, i] - turn[i])
        add_cross(twist[side, 3:], pressure, 1.0, moving)
        add_cross(omega, point, 1.0, moving)
        for i in range(3):
            velocity[i] -= load * moving[i]
        load_sum += load

    lever, local = np.empty(3), np.zeros(3)  # the IMU's velocity relative to the base's origin, in world and in base
    for i in range(3):
        local[i] = twist[2, i]
    add_cross(omega, poses[2], 1.0, local)
    turned(R, local, lever)
    turned(world_imu, accelerometer, turn)
    turned(R, velocity, moving)
    for i in range(3):
        imu_velocity[i] += step * (turn[i] - (GRAVITY if i == 2 else 0.0))
        if load_sum > 0.0:
            imu_velocity[i] += VELOCITY_GAIN * (moving[i] / load_sum + lever[i] - imu_velocity[i])
        turn[i] = imu_velocity[i] - lever[i]  # the base's velocity, in world
        position[i] += step * turn[i]
        if load_sum > 0.0:
            position[i] += POSITION_GAIN * (away[i] / load_sum - position[i])
        q[i], v[3 + i] = position[i], omega[i]
    if load_sum > 0.0:
        scale = min(max(vertical / (mass * GRAVITY), 0.5), 1.5)
        mass_scale[0] += step / MASS_TIME * (scale - mass_scale[0])

    quaternion_of(R, q[3:7])
    turned(R.T, turn, v[:3])
    for j in range(nj):
        q[7 + j], v[6 + j] = joint_position[j], filtered[6 + j]
    return mass_scale[0]
