"""Rows that keep the arms off the trunk and off obstacles, and a forearm off the surface that its palm rests on."""

from __future__ import annotations

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.robot import Robot
from wbmpc.rotations import cross
from wbmpc.signals import HandMode, Setpoint, Vector
from wbmpc.tracker.settings import TrackerSettings

SHARES = (0.0, 0.5, 1.0)  # of the elbow in an arm's points; the rest is the palm's
POINTS = 3  # of each arm: palm, one of the forearm, elbow
ROWS_PER_ARM = 2 * POINTS + 1
CLEARANCE_ROWS = 2 * ROWS_PER_ARM
NEAR = 0.10  # [m] a point farther than this from its bound is left alone
CONTACT = int(HandMode.CONTACT)


class Clearance:
    """Soft rows  ḋ̇ ≥ −k (d − d_min) − c ḋ  of distances d = d(q), one-sided: a barrier that an arm may slide along.

    For palm, middle of the forearm and elbow d is the distance from the trunk's axis (the torso's z), a cylinder round
    everything between pelvis and head. For the elbow of an arm whose palm is in contact it is also the height above
    the contact's tangent plane: a fixed palm leaves an arm of four joints one freedom, and it would find the wall. For
    the points of a free arm it is also the distance from the half-spaces of the setpoint.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings) -> None:
        self._robot, self._settings = robot, settings
        self.matrix = np.zeros((CLEARANCE_ROWS, robot.nv))  # of v̇
        self.lower = np.full(CLEARANCE_ROWS, -np.inf)

    def build(self, kinematics: Kinematics, v: Vector, setpoint: Setpoint) -> None:
        """Write `matrix` v̇ ≥ `lower` for the state that `kinematics` was updated with; `v` (nv,) is its velocity."""
        robot, settings = self._robot, self._settings
        self.lower[:] = -np.inf
        torso = robot.torso_frame
        origin, axis = kinematics.position(torso), kinematics.rotation(torso)[:, 2]
        for side in range(2):
            palm, elbow = (kinematics.position(f[side]) for f in (robot.palm_frames, robot.elbow_frames))
            for i, share in enumerate(SHARES):
                offset = palm + share * (elbow - palm) - origin
                along = (offset @ axis) * axis
                outward = offset - along
                distance = float(np.sqrt(outward @ outward))
                gap = distance - settings.trunk_clearance
                if gap > NEAR or distance < 1e-6:
                    continue
                outward /= distance
                jacobian, drift = self._arm_point(kinematics, side, share, outward)
                trunk = kinematics.jacobian(torso)
                jacobian -= outward @ trunk[:3] + cross(along, outward) @ trunk[3:]
                drift -= float(outward @ kinematics.drift(torso)[:3])
                self._barrier(ROWS_PER_ARM * side + i, jacobian, drift, gap, v)
            for i, plane in enumerate(setpoint.arm_keep_out[side]):
                if plane[3] > -np.inf:
                    share = float(plane[4])
                    point = palm + share * (elbow - palm)
                    jacobian, drift = self._arm_point(kinematics, side, share, plane[:3])
                    gap = float(plane[:3] @ point) - plane[3]
                    self._barrier(ROWS_PER_ARM * side + POINTS + 1 + i, jacobian, drift, gap, v)
            if int(setpoint.hand_mode[side]) == CONTACT:
                normal = setpoint.hand_normal[side]
                gap = float(normal @ (elbow - palm)) - settings.elbow_clearance
                if gap < NEAR:
                    jacobian, drift = self._arm_point(kinematics, side, 1.0, normal)
                    held, held_drift = self._arm_point(kinematics, side, 0.0, normal)
                    self._barrier(ROWS_PER_ARM * side + POINTS, jacobian - held, drift - held_drift, gap, v)

    def _arm_point(self, kinematics: Kinematics, side: int, share: float, direction: Vector) -> tuple[Vector, float]:
        """Row (nv,) and J̇v [m/s²] of a point's velocity along `direction` (3,), between palm (0) and elbow (1)."""
        row, drift = np.zeros(self._robot.nv), 0.0
        for weight, frames in ((1.0 - share, self._robot.palm_frames), (share, self._robot.elbow_frames)):
            if weight > 0.0:
                row += weight * (direction @ kinematics.jacobian(frames[side])[:3])
                drift += weight * float(direction @ kinematics.drift(frames[side])[:3])
        return row, drift

    def _barrier(self, row: int, jacobian: Vector, drift: float, gap: float, v: Vector) -> None:
        settings = self._settings
        self.matrix[row] = jacobian
        self.lower[row] = -settings.clearance_stiffness * gap - settings.clearance_damping * float(jacobian @ v) - drift
