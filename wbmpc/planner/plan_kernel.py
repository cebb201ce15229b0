"""Interpolation of a plan as machine code; `Plan` says what the arrays are."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel, short_kernel
from wbmpc.signals import Vector


@kernel
def join_courses(
    now: Vector,
    jerk: Vector,
    com: Vector,
    velocity: Vector,
    acceleration: Vector,
    vertical_jerk: Vector,
    height: Vector,
    vertical_velocity: Vector,
    vertical_acceleration: Vector,
) -> tuple[Vector, Vector]:
    """States (N + 1, 3 axes, 3) = c, ċ, c̈, from `now` (3, 3) on, and jerks (N, 3), of horizontal (N, 2) and vertical
    (N,) courses.
    """
    n = len(height)
    states, jerks = np.empty((n + 1, 3, 3)), np.empty((n, 3))
    states[0] = now
    for k in range(n):
        for axis in range(2):
            jerks[k, axis] = jerk[k, axis]
            states[k + 1, axis, 0] = com[k, axis]
            states[k + 1, axis, 1] = velocity[k, axis]
            states[k + 1, axis, 2] = acceleration[k, axis]
        jerks[k, 2] = vertical_jerk[k]
        states[k + 1, 2, 0] = height[k]
        states[k + 1, 2, 1] = vertical_velocity[k]
        states[k + 1, 2, 2] = vertical_acceleration[k]
    return states, jerks


@short_kernel
def com_at(elapsed, step, states, jerk, out):  # type: ignore[no-untyped-def]
    """Write c, ċ, c̈, rows of out (3, 3), `elapsed` [s] after the snapshot: constant jerks, standstill after them."""
    knots = jerk.shape[0]
    if elapsed > step * knots + 1e-9:
        out[:] = 0.0
        out[0] = states[knots, :, 0]
        return
    knot = min(int(elapsed / step + 1e-9), knots - 1)
    t = min(elapsed - knot * step, step)
    for i in range(3):
        c, v, a, j = states[knot, i, 0], states[knot, i, 1], states[knot, i, 2], jerk[knot, i]
        out[0, i] = c + t * v + t**2 / 2 * a + t**3 / 6 * j
        out[1, i] = v + t * a + t**2 / 2 * j
        out[2, i] = a + t * j


@short_kernel
def continue_plan(dt, going, joints, torso, feet, hands, out):  # type: ignore[no-untyped-def]
    """Continue joints, torso, feet and hands for `dt` [s]; velocities are those × `going`, 0 for a plan too late."""
    q, velocity = joints
    R, omega = torso
    foot_position, foot_velocity, foot_acceleration, foot_yaw, foot_yaw_rate = feet
    hand_position, hand_velocity, hand_acceleration, hand_jerk, cap, cap_rate, cap_top = hands
    joint_position, joint_velocity, rotation, spin = out[:4]
    foot_p, foot_v, foot_a, yaw, yaw_rate = out[4:9]
    hand_p, hand_v, hand_a, hand_cap = out[9:]
    for j in range(joint_position.size):
        joint_position[j] = q[7 + j] + dt * velocity[6 + j]
        joint_velocity[j] = going * velocity[6 + j]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for c in range(3):
            rotation[i, c] = R[i, c] + dt * (omega[j] * R[k, c] - omega[k] * R[j, c])
        spin[i] = going * omega[i]
    for side in range(2):
        for i in range(3):
            p, v, a = foot_position[side, i], foot_velocity[side, i], foot_acceleration[side, i]
            foot_p[side, i] = p + dt * v + dt**2 / 2 * a
            foot_v[side, i] = going * (v + dt * a)
            foot_a[side, i] = going * a
            p, v, a = hand_position[side, i], hand_velocity[side, i], hand_acceleration[side, i]
            jerk = hand_jerk[side, i]
            hand_p[side, i] = p + dt * v + dt**2 / 2 * a + dt**3 / 6 * jerk
            hand_v[side, i] = going * (v + dt * a + dt**2 / 2 * jerk)
            hand_a[side, i] = going * (a + dt * jerk)
        yaw[side] = foot_yaw[side] + dt * foot_yaw_rate[side]
        yaw_rate[side] = going * foot_yaw_rate[side]
        hand_cap[side] = min(max(cap[side] + dt * cap_rate[side], 0.0), cap_top[side])
