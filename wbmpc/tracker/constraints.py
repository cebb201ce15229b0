"""What a contact can transmit and what a joint can do, as rows and bounds of the tracker's QP."""

from __future__ import annotations

import numpy as np

from wbmpc.robot import Robot
from wbmpc.signals import Vector

WRENCH_ROWS = 10
PRESSURE_ROWS = 4
PALM_ROWS = 4
LARGE = 2000.0  # [rad/s²] no joint accelerates faster


def sole_wrench_rows(*, half_extents: Vector, friction: float, yaw_radius: float) -> Vector:
    """Rows W (10, 6) of W w ≤ 0 for a sole's wrench w = (force, moment) in the sole's frame about its centre.

    Inner pyramid of the friction cone (4 rows), centre of pressure within ± half_extents (4), yaw moment bounded by
    friction · yaw_radius · f_z (2).
    """
    mu = friction / np.sqrt(2.0)
    length, width = half_extents
    rows = []
    for sign in (1.0, -1.0):
        rows.append([sign, 0, -mu, 0, 0, 0])
        rows.append([0, sign, -mu, 0, 0, 0])
        rows.append([0, 0, -width, sign, 0, 0])  # m_x = y_cop f_z
        rows.append([0, 0, -length, 0, sign, 0])  # m_y = -x_cop f_z
        rows.append([0, 0, -friction * yaw_radius, 0, 0, sign])
    return np.array(rows, dtype=float)


def pressure_rows(half_extents: Vector) -> Vector:
    """Rows (4, 6) of P w ≤ 0: the centre of pressure of a sole's wrench lies within ± half_extents (2,) [m]."""
    length, width = half_extents
    return np.array(
        [[0, 0, -reach, *(sign * np.eye(3)[axis])] for axis, reach in ((0, width), (1, length)) for sign in (1, -1)]
    )


def palm_force_rows(friction: float) -> Vector:
    """Rows (4, 3) of C f ≤ 0 for a palm's force f = (t1, t2, n) in its contact's frame: inner friction pyramid."""
    mu = friction / np.sqrt(2.0)
    return np.array([[1.0, 0, -mu], [-1.0, 0, -mu], [0, 1.0, -mu], [0, -1.0, -mu]])


class JointLimits:
    """Bounds on q̈ that keep positions and speeds, and bounds on τ from the servo's torque-speed line."""

    def __init__(self, robot: Robot, *, speed_limit: float, horizon: float, torque_share: float) -> None:
        """speed_limit [rad/s], horizon [s] to stop in, torque_share of the servo's line."""
        self._lower, self._upper = robot.joint_lower, robot.joint_upper
        self._speed = np.minimum(speed_limit, 0.95 * robot.joint_speed)
        self._no_load = robot.joint_speed
        self._stall = torque_share * robot.torque_limit
        self._horizon = horizon

    def acceleration(self, position: Vector, velocity: Vector) -> tuple[Vector, Vector]:
        """Lower and upper bound (nj,) on q̈ [rad/s²] at position [rad] and velocity [rad/s] (nj,).

        q + h q̇ + h²/2 q̈ stays inside the range and q̇ + h q̈ inside the speed limit; where both disagree (a state
        already outside) the bounds collapse to their middle.
        """
        h = self._horizon
        ahead = position + h * velocity
        lower = np.maximum((-self._speed - velocity) / h, 2.0 * (self._lower - ahead) / h**2)
        upper = np.minimum((self._speed - velocity) / h, 2.0 * (self._upper - ahead) / h**2)
        np.minimum(np.maximum(lower, -LARGE, out=lower), LARGE, out=lower)
        np.minimum(np.maximum(upper, -LARGE, out=upper), LARGE, out=upper)
        crossed = lower > upper
        if crossed.any():
            lower[crossed] = upper[crossed] = 0.5 * (lower + upper)[crossed]
        return lower, upper

    def torque(self, velocity: Vector) -> tuple[Vector, Vector]:
        """Lower and upper bound (nj,) on τ [N·m]: stall torque, falling to zero at the no-load speed."""
        share = velocity / self._no_load
        upper = self._stall * np.minimum(np.maximum(1.0 - share, 0.0), 1.0)
        lower = self._stall * np.maximum(np.minimum(-1.0 - share, 0.0), -1.0)
        return lower, upper
