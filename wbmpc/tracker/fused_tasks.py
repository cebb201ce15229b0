"""The tracker's tasks as machine code: what TaskStack does, in loops over preallocated arrays.

The mathematics is explained in tasks.py; tests/tracker/test_fused.py holds one against the other. `s` is a setpoint and
`g` the settings, both as records (see fused.py).
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt

import numpy as np

from wbmpc.jit import short_kernel

SOLE, PALM, ELBOW, TORSO = 0, 2, 4, 6  # first row of each kind in the frames' arrays
COM_ROW, MOMENTUM_ROW, TORSO_ROW, FOOT_ROW, HAND_ROW = 0, 3, 6, 9, 21
MOVE, CONTACT, CARRY = 1, 2, 3  # HandMode
GRAVITY = 9.81  # [m/s²]


@short_kernel
def add_rotation_error(desired, measured, gain, out):  # type: ignore[no-untyped-def]
    """Add `gain` times `rotation_error` of two (3, 3) rotations to `out` (3,)."""
    r = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            r[i, j] = desired[i, 0] * measured[j, 0] + desired[i, 1] * measured[j, 1] + desired[i, 2] * measured[j, 2]
    x, y, z = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    sine, cosine = 0.5 * sqrt(x * x + y * y + z * z), 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    scale = 0.5
    if sine >= 1e-9:
        scale = 0.5 * atan2(sine, cosine) / sine
    elif cosine <= 0.0:  # half a turn about a: r + 1 = 2 a aᵀ
        most = 0
        for i in range(1, 3):
            if r[i, i] > r[most, most]:
                most = i
        x, y, z = r[0, most], r[1, most], r[2, most]
        x, y, z = x + (most == 0), y + (most == 1), z + (most == 2)
        scale = pi / sqrt(x * x + y * y + z * z)
    out[0] += gain * scale * x
    out[1] += gain * scale * y
    out[2] += gain * scale * z


@short_kernel
def body_tasks(s, g, step, pin, frames, matrix, target, weight, com_integral):  # type: ignore[no-untyped-def]
    """CoM, angular momentum, torso and feet: see TaskStack."""
    com, vcom, Jcom, Ag, nle, base_R, base_p, mass, soles_R, torso_R, v = pin
    positions, jacobian, twist, drift = frames
    nv = v.size
    error = s.com_position[2] - com[2]
    bound = g.com_integral_limit / max(g.com_integral, 1e-9)
    com_integral[2] = min(max(com_integral[2] + step * error, -bound), bound)
    for i in range(3):
        matrix[COM_ROW + i, :] = Jcom[i, :]
        lift = base_R[i, 0] * nle[0] + base_R[i, 1] * nle[1] + base_R[i, 2] * nle[2]  # [N] of the base, in world
        target[COM_ROW + i] = (
            s.com_acceleration[i]
            + g.com_stiffness * (s.com_position[i] - com[i])
            + g.com_damping * (s.com_velocity[i] - vcom[i])
            + g.com_integral * com_integral[i]
            - lift / mass
            + (GRAVITY if i == 2 else 0.0)
        )
        momentum = 0.0
        for k in range(nv):
            matrix[MOMENTUM_ROW + i, k] = Ag[3 + i, k]
            momentum += Ag[3 + i, k] * v[k]
        j, m = (i + 1) % 3, (i + 2) % 3
        force_j = base_R[j, 0] * nle[0] + base_R[j, 1] * nle[1] + base_R[j, 2] * nle[2]
        force_m = base_R[m, 0] * nle[0] + base_R[m, 1] * nle[1] + base_R[m, 2] * nle[2]
        moment = base_R[i, 0] * nle[3] + base_R[i, 1] * nle[4] + base_R[i, 2] * nle[5]
        moment += (base_p[j] - com[j]) * force_m - (base_p[m] - com[m]) * force_j
        target[MOMENTUM_ROW + i] = -g.momentum_damping * momentum - moment
        matrix[TORSO_ROW + i, :] = jacobian[TORSO, 3 + i, :]
        rate = s.torso_angular_velocity[i] - twist[TORSO, 3 + i]
        target[TORSO_ROW + i] = g.torso_damping * rate - drift[TORSO, 3 + i]
    add_rotation_error(s.torso_rotation, torso_R, g.torso_stiffness, target[TORSO_ROW : TORSO_ROW + 3])

    for side in range(2):
        f, first = SOLE + side, FOOT_ROW + 6 * side
        stance = s.foot_stance[side]
        for i in range(6):
            matrix[first + i, :] = jacobian[f, i, :]
            weight[first + i] = g.stance_weight if stance else g.swing_weight
            damping = g.stance_damping if stance else g.swing_damping
            target[first + i] = -damping * twist[f, i] - drift[f, i]
        for i in range(3):
            away = s.foot_position[side, i] - positions[f][i]
            if not stance:
                target[first + i] += s.foot_acceleration[side, i] + g.swing_stiffness * away
                target[first + i] += g.swing_damping * s.foot_velocity[side, i]
            elif i < 2:
                target[first + i] += g.stance_stiffness * away
        if not stance:
            target[first + 5] += g.swing_damping * s.foot_yaw_rate[side]
            level = np.zeros((3, 3))
            level[0, 0] = level[1, 1] = cos(s.foot_yaw[side])
            level[1, 0] = sin(s.foot_yaw[side])
            level[0, 1] = -level[1, 0]
            level[2, 2] = 1.0
            add_rotation_error(level, soles_R[side], g.swing_stiffness, target[first + 3 : first + 6])


@short_kernel
def hand_task(s, g, step, side, frames, matrix, target, weight, integral):  # type: ignore[no-untyped-def]
    """One palm: see TaskStack. `integral` (3,) is its own."""
    positions, jacobian, twist, drift = frames
    f, first, mode = PALM + side, HAND_ROW + 3 * side, s.hand_mode[side]
    if mode != MOVE:
        integral[:] = 0.0
    if mode != MOVE and mode != CONTACT and mode != CARRY:
        weight[first : first + 3] = 0.0
        return
    for i in range(3):
        matrix[first + i, :] = jacobian[f, i, :]
    if mode == CONTACT:
        for i in range(3):
            weight[first + i] = g.braced_weight
            target[first + i] = -g.stance_damping * twist[f, i] - drift[f, i]
        return
    if mode == CARRY:
        own, other = positions[f], positions[PALM + 1 - side]
        along = square = 0.0
        for i in range(3):
            across = own[i] - other[i]
            apart = s.hand_position[side, i] - own[i] - s.hand_position[1 - side, i] + other[i]
            along += apart * across
            square += across * across
        for i in range(3):
            error = s.hand_position[side, i] - own[i] - 0.5 * along / square * (own[i] - other[i])
            weight[first + i] = g.carry_weight
            target[first + i] = (
                g.hand_stiffness * error
                + g.hand_damping * (s.hand_velocity[side, i] - twist[f, i])
                + s.hand_acceleration[side, i]
                - drift[f, i]
            )
        return
    urgency = s.hand_urgency[side]
    limit = g.hand_acceleration_limit
    limit += urgency * (g.urgent_hand_acceleration_limit - limit)
    bound = g.hand_integral_limit / max(g.hand_integral, 1e-9)
    fastest = 0.0
    for i in range(3):
        fastest = max(fastest, abs(s.hand_velocity[side, i]))
    wanted = np.empty(3)
    norm = 0.0
    for i in range(3):
        error = s.hand_position[side, i] - positions[f][i]
        if fastest < 0.02:  # [m/s] a moving hand's lag is not a steady error
            integral[i] = min(max(integral[i] + step * error, -bound), bound)
        wanted[i] = g.hand_stiffness * error + g.hand_damping * (s.hand_velocity[side, i] - twist[f, i])
        wanted[i] += g.hand_integral * integral[i]
        norm += wanted[i] * wanted[i]
    norm = sqrt(norm)
    share = limit / norm if norm > limit else 1.0
    for i in range(3):
        weight[first + i] = g.hand_weight + urgency * (g.urgent_hand_weight - g.hand_weight)
        target[first + i] = s.hand_acceleration[side, i] + share * wanted[i] - drift[f, i]
