"""The plant's servos, and what MuJoCo's contacts do to soles and palms, as machine code."""

from __future__ import annotations

from math import nan

import numpy as np

from wbmpc.jit import short_kernel


@short_kernel
def servo_torque(wanted, qvel, no_load_speed, stall_torque, applied, limit):  # type: ignore[no-untyped-def]
    """Write what the servos give of the `wanted` torques (nj,), and what they could give in that direction.

    Each servo's torque falls on a straight line from stall to zero at its no-load speed. `qvel` holds the base's six
    coordinates first.
    """
    for j in range(applied.size):
        speed = qvel[6 + j] / no_load_speed[j]
        upper = stall_torque[j] * min(max(1.0 - speed, 0.0), 1.0)
        lower = stall_torque[j] * max(min(-1.0 - speed, 0.0), -1.0)
        applied[j] = min(max(wanted[j], lower), upper)
        limit[j] = upper if applied[j] >= 0.0 else -lower


@short_kernel
def contact_sums(count, seen, efc_force, is_robot, part, sole, truth, sole_wrench, palm_force, zmp):  # type: ignore[no-untyped-def]
    """Write the contacts that carry force, forces on the robot, and their sums; returns how many there are.

    Args:
        count: number of MuJoCo's contacts in `seen`.
        seen: per contact: geoms (2,), first row in `efc_force` (-1: none), frame (9,), position (3,), distance, dim.
        is_robot: per geom; `part`: per geom 0, 1 for the soles, 2, 3 for the palms, else -1.
        sole: (2, 3) [m] the soles' sites.
        truth: columns of CONTACT, filled, at most as many contacts as there are rows.
        sole_wrench: (2, 6) filled: force and moment about the sole's site; palm_force: (2, 3) filled.
        zmp: (2,) filled: centre of pressure of both soles on the plane of their mean height; nan without foot force.
    """
    pairs, address, frame, where, gap, dim = seen
    geoms, position, force, distance = truth
    sole_wrench[:], palm_force[:] = 0.0, 0.0
    on_robot, moment = np.empty(3), np.empty(3)
    n = 0
    for c in range(count):
        row = address[c]
        if row < 0 or n == distance.size:
            continue
        # elliptic cone: normal, two tangents; the normal points from the first geom to the second
        first, second = pairs[c, 0], pairs[c, 1]
        sign = 1.0 if is_robot[second] else -1.0
        spin = sign * efc_force[row + 3] if dim[c] >= 4 else 0.0  # condim 4: moment about the normal
        for i in range(3):
            on_robot[i] = sign * (
                efc_force[row] * frame[c, i]
                + efc_force[row + 1] * frame[c, 3 + i]
                + efc_force[row + 2] * frame[c, 6 + i]
            )
            position[n, i], force[n, i] = where[c, i], on_robot[i]
        geoms[n, 0], geoms[n, 1], distance[n] = first, second, gap[c]
        n += 1
        which = max(part[first], part[second])
        if which >= 2:
            for i in range(3):
                palm_force[which - 2, i] += on_robot[i]
        elif which >= 0:
            x, y, z = where[c, 0] - sole[which, 0], where[c, 1] - sole[which, 1], where[c, 2] - sole[which, 2]
            moment[0] = y * on_robot[2] - z * on_robot[1]
            moment[1] = z * on_robot[0] - x * on_robot[2]
            moment[2] = x * on_robot[1] - y * on_robot[0]
            for i in range(3):
                sole_wrench[which, i] += on_robot[i]
                sole_wrench[which, 3 + i] += moment[i] + spin * frame[c, i]

    total = sole_wrench[0, 2] + sole_wrench[1, 2]
    zmp[:] = nan
    if total >= 1e-6:
        zmp[:] = 0.0
        for side in range(2):
            zmp[0] += (sole[side, 0] * sole_wrench[side, 2] - sole_wrench[side, 4]) / total
            zmp[1] += (sole[side, 1] * sole_wrench[side, 2] + sole_wrench[side, 3]) / total
    return n
