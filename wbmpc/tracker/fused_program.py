"""The tracker's program as machine code: elimination of the base, costs, rows and bounds.

The mathematics is explained in plain.py and constraints.py; tests/tracker/test_fused.py holds one against
the other. `s` is a setpoint and `g` the settings, both as records (see fused.py).
"""

from __future__ import annotations

from math import inf, sqrt, tanh

import numpy as np

from wbmpc.frame_terms import frame_terms
from wbmpc.jit import short_kernel
from wbmpc.tracker.fused_contacts import clearance_rows, contact_terms
from wbmpc.tracker.fused_tasks import body_tasks, hand_task

CLEARANCE_FIRST, TORQUE_FIRST = 36, 50  # rows, see program.py
LARGE = 2000.0  # [rad/s²] see JointLimits
FRICTION_SPEED = 0.1  # [rad/s] see plain.py


@short_kernel
def limit_bounds(q, v, limits, g, x_lower, x_upper, torque_lower, torque_upper):  # type: ignore[no-untyped-def]
    """Bounds on q̈ and τ: see JointLimits. `limits` (4, nj): lowest and highest angle, no-load speed, stall torque."""
    h = g.limit_horizon
    for j in range(limits.shape[1]):
        speed, top = v[6 + j], min(g.joint_velocity_limit, 0.95 * limits[2, j])
        ahead = q[7 + j] + h * speed
        lower = max((-top - speed) / h, 2.0 * (limits[0, j] - ahead) / h**2)
        upper = min((top - speed) / h, 2.0 * (limits[1, j] - ahead) / h**2)
        lower, upper = min(max(lower, -LARGE), LARGE), min(max(upper, -LARGE), LARGE)
        if lower > upper:
            lower = upper = 0.5 * (lower + upper)
        x_lower[j], x_upper[j] = lower, upper
        share, stall = speed / limits[2, j], g.torque_share * limits[3, j]
        torque_upper[j] = stall * min(max(1.0 - share, 0.0), 1.0)
        torque_lower[j] = stall * max(min(-1.0 - share, 0.0), -1.0)


@short_kernel
def solve_base(M, nle, scale, contact, base_map, base_offset):  # type: ignore[no-untyped-def]
    """v̇_base = base_map y + base_offset from the base rows, by a Cholesky factor of M_bb."""
    n, nj = base_map.shape[1], M.shape[0] - 6
    L = np.empty((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = scale * M[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = sqrt(total) if i == j else total / L[j, j]
    for i in range(6):
        for k in range(nj):
            base_map[i, k] = -scale * M[i, 6 + k]
        for k in range(nj, n):
            base_map[i, k] = contact[k - nj, i]
        base_offset[i] = -scale * nle[i]
    for i in range(6):
        for j in range(i):
            base_offset[i] -= L[i, j] * base_offset[j]
            for k in range(n):
                base_map[i, k] -= L[i, j] * base_map[j, k]
        base_offset[i] /= L[i, i]
        for k in range(n):
            base_map[i, k] /= L[i, i]
    for i in range(5, -1, -1):
        for j in range(i + 1, 6):
            base_offset[i] -= L[j, i] * base_offset[j]
            for k in range(n):
                base_map[i, k] -= L[j, i] * base_map[j, k]
        base_offset[i] /= L[i, i]
        for k in range(n):
            base_map[i, k] /= L[i, i]


@short_kernel
def reduce_row(row, base_map, out):  # type: ignore[no-untyped-def]
    """A row (nv,) of v̇ as a row (n,) of y: joints as they are, the base through its map."""
    nj = row.size - 6
    out[nj:] = 0.0
    for k in range(nj):
        out[k] = row[6 + k]
    for i in range(6):
        for k in range(out.size):
            out[k] += row[i] * base_map[i, k]


@short_kernel
def build(s_record, g_record, step, state, pin, model, scratch, qp, answer):  # type: ignore[no-untyped-def]
    """Write the program of one tick; see FusedAssembly for what the tuples hold."""
    s, g = s_record[0], g_record[0]
    q, v, palm_force, scale = state
    J, M, nle, Jcom, Ag, com, vcom, base_R, base_p, positions, soles_R, torso_R = pin
    chains, lengths, limits, friction, mass = model
    jacobian, twist, drift, tasks, target, weight, clearance, clear_lower = scratch[:8]
    contact, diagonal, reference, row_y, com_integral, hand_integral, sensed = scratch[8:]
    hessian, gradient, rows, lower, upper, x_lower, x_upper = qp
    base_map, base_offset, torque_offset, torque_lower, torque_upper, rotation = answer
    nj, n = torque_offset.size, gradient.size

    frame_terms(J, v, chains, lengths, positions, jacobian, twist, drift)
    frames = (positions, jacobian, twist, drift)
    body = (com, vcom, Jcom, Ag, nle, base_R, base_p, mass, soles_R, torso_R, v)
    body_tasks(s, g, step, body, frames, tasks, target, weight, com_integral)
    for side in range(2):
        hand_task(s, g, step, side, frames, tasks, target, weight, hand_integral[side])
    contact_terms(s, g, nj, soles_R, jacobian, palm_force, sensed, qp, (contact, rotation, diagonal, reference))
    clearance_rows(s, g, torso_R, frames, clearance, clear_lower)
    limit_bounds(q, v, limits, g, x_lower, x_upper, torque_lower, torque_upper)
    solve_base(M, nle, scale, contact, base_map, base_offset)

    # Costs: Σ w |J v̇ − a|² and the diagonal terms
    hessian[:] = 0.0
    gradient[:] = 0.0
    for t in range(target.size):
        w = weight[t]
        if w == 0.0:
            continue
        wanted = target[t]
        for i in range(6):
            wanted -= tasks[t, i] * base_offset[i]
        reduce_row(tasks[t], base_map, row_y)
        for i in range(n):
            c = w * row_y[i]
            gradient[i] -= c * wanted
            if c != 0.0:
                for k in range(i + 1):
                    hessian[i, k] += c * row_y[k]
    for j in range(nj):
        diagonal[j] = g.posture_weight + g.acceleration_regularization
        reference[j] = g.posture_stiffness * (s.joint_position[j] - q[7 + j])
        reference[j] += g.posture_damping * (s.joint_velocity[j] - v[6 + j])
    for i in range(n):
        for k in range(i):
            hessian[k, i] = hessian[i, k]
        hessian[i, i] += diagonal[i]
        gradient[i] -= (g.posture_weight if i < nj else diagonal[i]) * reference[i]

    # Clearances, then torques
    for r in range(clear_lower.size):
        if clear_lower[r] > -inf:
            reduce_row(clearance[r], base_map, rows[CLEARANCE_FIRST + r])
            offset = 0.0
            for i in range(6):
                offset += clearance[r, i] * base_offset[i]
            lower[CLEARANCE_FIRST + r] = clear_lower[r] - offset
        else:
            rows[CLEARANCE_FIRST + r, :] = 0.0
            lower[CLEARANCE_FIRST + r] = -inf
    for j in range(nj):
        r = TORQUE_FIRST + j
        for k in range(nj):
            rows[r, k] = scale * M[6 + j, 6 + k]
        for k in range(nj, n):
            rows[r, k] = -contact[k - nj, 6 + j]
        offset = scale * nle[6 + j] + friction[0, j] * v[6 + j]
        offset += friction[1, j] * tanh(s.joint_velocity[j] / FRICTION_SPEED)
        for i in range(6):
            m = scale * M[6 + j, i]
            offset += m * base_offset[i]
            for k in range(n):
                rows[r, k] += m * base_map[i, k]
        torque_offset[j] = offset
        lower[r], upper[r] = torque_lower[j] - offset, torque_upper[j] - offset
