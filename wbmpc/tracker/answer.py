"""What the solution of the tracker's program means, as machine code: torques, accelerations, contact wrenches."""

from __future__ import annotations

from wbmpc.jit import short_kernel


@short_kernel
def joint_torque(y, matrix, offset, lower, upper, tolerance, torque):  # type: ignore[no-untyped-def]
    """Write the torques of y, not yet clipped; returns whether one of them is at its bound or beyond."""
    bound = False
    for j in range(torque.size):
        total = offset[j]
        for k in range(y.size):
            total += matrix[j, k] * y[k]
        torque[j] = total
        bound |= total > upper[j] - tolerance or total < lower[j] + tolerance
    return bound


@short_kernel
def motion_and_wrenches(y, base_map, base_offset, rotation, acceleration, wrench, palm):  # type: ignore[no-untyped-def]
    """Write v̇ (nv,), sole wrenches (2, 6) and palm forces (2, 3) in world."""
    nj = acceleration.size - 6
    for i in range(6):
        total = base_offset[i]
        for k in range(y.size):
            total += base_map[i, k] * y[k]
        acceleration[i] = total
    for j in range(nj):
        acceleration[6 + j] = y[j]
    for side in range(2):
        for i in range(3):
            force = moment = push = 0.0
            for k in range(3):
                force += rotation[side, i, k] * y[nj + 6 * side + k]
                moment += rotation[side, i, k] * y[nj + 6 * side + 3 + k]
                push += rotation[2 + side, i, k] * y[nj + 12 + 3 * side + k]
            wrench[side, i], wrench[side, 3 + i], palm[side, i] = force, moment, push
