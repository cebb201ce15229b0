"""Contact forces and clearances of the tracker's program as machine code.

The mathematics is explained in plain.py, constraints.py and clearance.py; tests/tracker/test_fused.py holds one against
the other. `s` is a setpoint and `g` the settings, both as records (see fused.py).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from wbmpc.jit import short_kernel
from wbmpc.tracker.fused_tasks import CARRY, CONTACT, ELBOW, PALM, SOLE, TORSO

PALM_FIRST, PALM_ROWS = 20, 4  # see program.py
POINTS, ARM_ROWS, NEAR = 3, 7, 0.10  # see Clearance
SENSED_SHARE = 0.2  # see plain.py


@short_kernel
def contact_axes(normal, R):  # type: ignore[no-untyped-def]
    """See `rotations.contact_frame`; written to `R` (3, 3)."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    hx, hy = (1.0, 0.0) if abs(nx) < 0.7 else (0.0, 1.0)
    sx, sy, sz = -nz * hy, nz * hx, nx * hy - ny * hx
    length = sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    R[0, 0], R[1, 0], R[2, 0] = sy * nz - sz * ny, sz * nx - sx * nz, sx * ny - sy * nx
    R[0, 1], R[1, 1], R[2, 1] = sx, sy, sz
    R[0, 2], R[1, 2], R[2, 2] = nx, ny, nz


@short_kernel
def contact_terms(s, g, nj, soles_R, jacobian, palm_force, sensed, qp, terms):  # type: ignore[no-untyped-def]
    """Jacobians, bounds, cones, prices and references of the contact forces: see `PlainAssembly`."""
    rows, x_lower, x_upper = qp[2], qp[5], qp[6]
    contact, rotation, diagonal, reference = terms
    diagonal[nj:] = g.force_regularization
    reference[nj:] = 0.0
    for i in range(nj, x_lower.size):
        x_lower[i] = x_upper[i] = 0.0
    for side in range(2):
        f, first = SOLE + side, 6 * side
        R = soles_R[side]
        for i in range(3):
            for j in range(3):
                rotation[side, i, j] = R[i, j]
        for half in range(0, 6, 3):
            for i in range(3):
                for k in range(jacobian.shape[2]):
                    contact[first + half + i, k] = (
                        R[0, i] * jacobian[f, half, k]
                        + R[1, i] * jacobian[f, half + 1, k]
                        + R[2, i] * jacobian[f, half + 2, k]
                    )
        if s.foot_stance[side]:
            for i in range(nj + first, nj + first + 6):
                x_lower[i], x_upper[i] = -inf, inf
            x_lower[nj + first + 2] = 0.0

        f, first, mode = PALM + side, 12 + 3 * side, s.hand_mode[side]
        y, row = nj + first, PALM_FIRST + PALM_ROWS * side
        if mode != CONTACT:
            sensed[side] = 0.0
            contact[first : first + 3, :] = 0.0
            if mode == CARRY:  # the held thing's force is known
                for i in range(3):
                    for j in range(3):
                        rotation[2 + side, i, j] = 1.0 if i == j else 0.0
                    contact[first + i, :] = jacobian[f, i, :]
                    x_lower[y + i] = x_upper[y + i] = s.hand_force[side, i]
                rows[row : row + PALM_ROWS, y : y + 3] = 0.0
            continue
        R = rotation[2 + side]
        contact_axes(s.hand_normal[side], R)
        normal_force = 0.0
        for i in range(3):
            for k in range(jacobian.shape[2]):
                contact[first + i, k] = (
                    R[0, i] * jacobian[f, 0, k] + R[1, i] * jacobian[f, 1, k] + R[2, i] * jacobian[f, 2, k]
                )
            normal_force += palm_force[side, i] * s.hand_normal[side, i]
            x_lower[y + i], x_upper[y + i] = -inf, inf
            diagonal[y + i] = g.hand_force_weight
            wanted = s.hand_force[side]
            reference[y + i] = R[0, i] * wanted[0] + R[1, i] * wanted[1] + R[2, i] * wanted[2]
        sensed[side] += SENSED_SHARE * (max(normal_force, 0.0) - sensed[side])
        x_lower[y + 2] = 0.0
        x_upper[y + 2] = min(s.hand_force_cap[side], sensed[side] + g.hand_force_rise)
        mu = s.hand_friction[side] / sqrt(2.0)
        rows[row : row + PALM_ROWS, y : y + 3] = 0.0
        for i in range(PALM_ROWS):
            rows[row + i, y + i // 2] = 1.0 - 2.0 * (i % 2)
            rows[row + i, y + 2] = -mu


@short_kernel
def arm_row(frames, side, share, d, out):  # type: ignore[no-untyped-def]
    """Write the row (nv,) of a point between palm (0) and elbow (1) along d (3,); returns its J̇v and speed."""
    _, jacobian, twist, drift = frames
    palm, elbow, kept = PALM + side, ELBOW + side, 1.0 - share
    for k in range(out.size):
        along_palm = d[0] * jacobian[palm, 0, k] + d[1] * jacobian[palm, 1, k] + d[2] * jacobian[palm, 2, k]
        along_elbow = d[0] * jacobian[elbow, 0, k] + d[1] * jacobian[elbow, 1, k] + d[2] * jacobian[elbow, 2, k]
        out[k] = kept * along_palm + share * along_elbow
    rate = speed = 0.0
    for i in range(3):
        rate += d[i] * (kept * drift[palm, i] + share * drift[elbow, i])
        speed += d[i] * (kept * twist[palm, i] + share * twist[elbow, i])
    return rate, speed


@short_kernel
def clearance_rows(s, g, torso_R, frames, matrix, lower):  # type: ignore[no-untyped-def]
    """Rows C (14, nv) and bounds of C v̇ ≥ c: see Clearance."""
    positions, jacobian, twist, drift = frames
    lower[:] = -inf
    nv = matrix.shape[1]
    axis = torso_R[:, 2]
    origin = positions[TORSO]
    point, outward, along = np.empty(3), np.empty(3), np.empty(3)
    for side in range(2):
        palm, elbow, first = positions[PALM + side], positions[ELBOW + side], ARM_ROWS * side
        for n in range(POINTS):  # off the trunk
            share = 0.5 * n
            height = 0.0
            for i in range(3):
                point[i] = palm[i] + share * (elbow[i] - palm[i]) - origin[i]
                height += point[i] * axis[i]
            square = 0.0
            for i in range(3):
                along[i] = height * axis[i]
                outward[i] = point[i] - along[i]
                square += outward[i] * outward[i]
            distance = sqrt(square)
            gap = distance - g.trunk_clearance
            if gap > NEAR or distance < 1e-6:
                continue
            for i in range(3):
                outward[i] /= distance
            row = matrix[first + n]
            rate, speed = arm_row(frames, side, share, outward, row)
            tx = along[1] * outward[2] - along[2] * outward[1]
            ty = along[2] * outward[0] - along[0] * outward[2]
            tz = along[0] * outward[1] - along[1] * outward[0]
            # outward · (v + ω × along) of the trunk; the scalar triple product turned round
            for k in range(nv):
                for i in range(3):
                    row[k] -= outward[i] * jacobian[TORSO, i, k]
                row[k] -= tx * jacobian[TORSO, 3, k] + ty * jacobian[TORSO, 4, k] + tz * jacobian[TORSO, 5, k]
            for i in range(3):
                rate -= outward[i] * drift[TORSO, i]
                speed -= outward[i] * twist[TORSO, i]
            speed -= tx * twist[TORSO, 3] + ty * twist[TORSO, 4] + tz * twist[TORSO, 5]
            lower[first + n] = -g.clearance_stiffness * gap - g.clearance_damping * speed - rate
        for n in range(POINTS):  # off the setpoint's half-spaces
            plane = s.arm_keep_out[side, n]
            if plane[3] > -inf:
                gap = -plane[3]
                for i in range(3):
                    gap += plane[i] * (palm[i] + plane[4] * (elbow[i] - palm[i]))
                row_index = first + POINTS + 1 + n
                rate, speed = arm_row(frames, side, plane[4], plane[:3], matrix[row_index])
                lower[row_index] = -g.clearance_stiffness * gap - g.clearance_damping * speed - rate
        if s.hand_mode[side] == CONTACT:  # elbow over the surface that the palm rests on
            normal = s.hand_normal[side]
            gap = -g.elbow_clearance
            for i in range(3):
                gap += normal[i] * (elbow[i] - palm[i])
            if gap < NEAR:
                row = matrix[first + POINTS]
                held_rate, held_speed = arm_row(frames, side, 0.0, normal, row)
                held = row.copy()
                rate, speed = arm_row(frames, side, 1.0, normal, row)
                row -= held
                rate, speed = rate - held_rate, speed - held_speed
                lower[first + POINTS] = -g.clearance_stiffness * gap - g.clearance_damping * speed - rate
