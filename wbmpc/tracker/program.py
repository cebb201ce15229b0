"""The tracker's quadratic program: its layout, its constant rows, and what is needed to read the answer."""

from __future__ import annotations

import numpy as np

from wbmpc.qp import QuadraticProgram
from wbmpc.robot import Robot
from wbmpc.signals import Vector
from wbmpc.tracker.answer import joint_torque, motion_and_wrenches
from wbmpc.tracker.clearance import CLEARANCE_ROWS
from wbmpc.tracker.constraints import PALM_ROWS, PRESSURE_ROWS, WRENCH_ROWS, pressure_rows, sole_wrench_rows
from wbmpc.tracker.settings import TrackerSettings

FORCES = 18  # two sole wrenches (6 each), then two palm forces (3 each), each in its contact's own frame
WRENCH = slice(0, 2 * WRENCH_ROWS)
PALM = slice(WRENCH.stop, WRENCH.stop + 2 * PALM_ROWS)
COMFORT = slice(PALM.stop, PALM.stop + 2 * PRESSURE_ROWS)
CLEARANCE = slice(COMFORT.stop, COMFORT.stop + CLEARANCE_ROWS)
TORQUE_SLACK_COST = 1e4  # [cost / (N·m)²]; what a violated row would ask is clipped by the servo's limit anyway


class TrackerProgram:
    """Everything that an assembly writes at every tick; the unknowns are y = (q̈ (nj), F (18)).

    The six base rows of the equations of motion give v̇_base = base_map y + base_offset, which eliminates them. The
    joint rows give τ = torque_matrix y + torque_offset; they come last, so that `relaxed`, the program without them,
    is the head of the same memory.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings) -> None:
        nj, n = robot.nj, robot.nj + FORCES
        self.torque_rows = slice(CLEARANCE.stop, CLEARANCE.stop + nj)
        soft = np.zeros(self.torque_rows.stop)
        soft[CLEARANCE] = settings.clearance_weight
        soft[COMFORT] = settings.foot_comfort_weight
        soft[self.torque_rows] = TORQUE_SLACK_COST
        self.qp = QuadraticProgram(n, self.torque_rows.stop, soft_weight=soft)
        self.relaxed = self.qp.head(self.torque_rows.start)
        self.qp.upper[: CLEARANCE.start] = 0.0
        cone = sole_wrench_rows(
            half_extents=robot.sole_half_extents - settings.foot_inset,
            friction=settings.foot_friction,
            yaw_radius=settings.foot_yaw_radius,
        )
        comfort = pressure_rows(robot.sole_half_extents - settings.foot_comfort_inset)
        for side in range(2):
            wrench = slice(nj + 6 * side, nj + 6 * side + 6)
            first = WRENCH.start + side * WRENCH_ROWS
            self.qp.matrix[first : first + WRENCH_ROWS, wrench] = cone
            first = COMFORT.start + side * PRESSURE_ROWS
            self.qp.matrix[first : first + PRESSURE_ROWS, wrench] = comfort
        self.base_map = np.zeros((6, n))
        self.base_offset = np.zeros(6)
        self.torque_matrix: Vector = self.qp.matrix[self.torque_rows]
        self.torque_offset = np.zeros(nj)
        self.torque_lower, self.torque_upper = np.zeros(nj), np.zeros(nj)  # the servo's line at this speed
        self.contact_rotation = np.zeros((4, 3, 3))  # soles, then palms: contact frame to world

    def torque(self, y: Vector, *, tolerance: float, out: Vector) -> bool:
        """Write the torques (nj,) of y (n,); returns whether one is within `tolerance` [N·m] of its bound or beyond."""
        return joint_torque(
            *(y, self.torque_matrix, self.torque_offset, self.torque_lower, self.torque_upper, tolerance, out)
        )

    def recover(self, y: Vector, acceleration: Vector, wrench: Vector, palm: Vector) -> None:
        """Write v̇ (nv,), the soles' wrenches (2, 6) and the palms' forces (2, 3) in world of y (n,)."""
        motion_and_wrenches(*(y, self.base_map, self.base_offset, self.contact_rotation), *(acceleration, wrench, palm))
