"""What was measured at a plan's snapshot, as the planner needs it."""

from __future__ import annotations

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import Feet
from wbmpc.robot import Robot
from wbmpc.rotations import heading_of
from wbmpc.signals import RobotState, Vector


class Snapshot:
    """The robot at the last snapshot; all in world."""

    def __init__(self, robot: Robot, q: Vector) -> None:
        """At rest at `q` (nq,)."""
        self._robot, self._kinematics = robot, Kinematics(robot)
        self._kinematics.update(q, np.zeros(robot.nv))
        self._read()
        self.feet_zmp = self.com[:2].copy()  # (2,) [m] centre of both soles' pressure
        self._homes = (self.palms - self._torso_position) @ self._torso_rotation  # in the torso

    def update(self, state: RobotState) -> None:
        """Take in a new state."""
        self._kinematics.update(state.q, state.v)
        self._read()
        force, moment = state.sole_wrench_in_world[:, :3], state.sole_wrench_in_world[:, 3:]
        load = max(float(force[:, 2].sum()), 1e-6)
        levers = np.column_stack([-moment[:, 1], moment[:, 0]])
        self.feet_zmp = (force[:, 2] @ self.soles[:, :2] + levers.sum(axis=0)) / load

    @property
    def palm_homes(self) -> Vector:
        """(2, 3) [m] where free palms hang: where they were at the start, as seen from the torso."""
        return self._torso_position + self._homes @ self._torso_rotation.T

    @property
    def feet(self) -> Feet:
        """Where the feet stand, none of them having stepped."""
        return Feet(self.soles.copy(), self.sole_yaws.copy(), -1)

    @property
    def limbs(self) -> tuple[Vector, Vector, Vector]:
        """Palms (2, 3), elbows (2, 3) and the ends of thighs and shanks (4, 2, 3) [m]."""
        return self.palms, self.elbows, self.leg_links

    def _read(self) -> None:
        kinematics, robot = self._kinematics, self._robot
        self.com, self.com_velocity = kinematics.com, kinematics.com_velocity  # (3,) [m], [m/s]
        self.palms = np.array([kinematics.position(f) for f in robot.palm_frames])  # (2, 3) [m]
        self.elbows = np.array([kinematics.position(f) for f in robot.elbow_frames])  # (2, 3) [m]
        joints = np.array([[kinematics.position(f) for f in leg] for leg in robot.leg_frames])  # (2, 3, 3)
        self.leg_links = np.stack([joints[:, :-1], joints[:, 1:]], axis=2).reshape(4, 2, 3)  # [m] thighs, shanks
        self.palm_velocities = np.array([kinematics.velocity(f)[:3] for f in robot.palm_frames])  # (2, 3) [m/s]
        self.soles = np.array([kinematics.position(f) for f in robot.sole_frames])  # (2, 3) [m]
        self.sole_yaws = np.array([heading_of(kinematics.rotation(f)) for f in robot.sole_frames])  # (2,) [rad]
        self._torso_position = kinematics.position(robot.torso_frame)
        self._torso_rotation = kinematics.rotation(robot.torso_frame)
