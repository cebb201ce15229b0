"""What was measured at a plan's snapshot, as the planner needs it."""

from __future__ import annotations

import numpy as np

from wbmpc.frame_terms import chains_of, frame_twists
from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import Feet
from wbmpc.robot import Robot
from wbmpc.rotations import heading_of
from wbmpc.signals import RobotState, Vector

LEG_LINKS = [[7, 8], [8, 9], [10, 11], [11, 12]]  # among the frames that are read: hip to knee, knee to ankle


class Snapshot:
    """The robot at the last snapshot; all in world."""

    def __init__(self, robot: Robot, q: Vector) -> None:
        """At rest at `q` (nq,)."""
        self._kinematics = Kinematics(robot)
        frames = (*robot.palm_frames, *robot.elbow_frames, *robot.sole_frames, robot.torso_frame)
        legs = [frame for leg in robot.leg_frames for frame in leg]
        self._views = self._kinematics.views((*frames, *legs), (*robot.sole_frames, robot.torso_frame))
        self._palm_chains = chains_of(robot.pin_model, robot.palm_frames)
        self._kinematics.update_kinematics(q)
        self._read(np.zeros(robot.nv))
        self.feet_zmp = self.com[:2].copy()  # (2,) [m] centre of both soles' pressure
        self._homes = (self.palms - self._torso_position) @ self._torso_rotation  # in the torso

    def update(self, state: RobotState) -> None:
        """Take in a new state."""
        self._kinematics.update_kinematics(state.q)
        self._read(np.array(state.v))
        (_, _, left, left_x, left_y, _), (_, _, right, right_x, right_y, _) = state.sole_wrench_in_world.tolist()
        load = max(left + right, 1e-6)
        levers = np.array([-left_y - right_y, left_x + right_x])
        self.feet_zmp = (left * self.soles[0, :2] + right * self.soles[1, :2] + levers) / load

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

    def _read(self, v: Vector) -> None:
        """Copy what Pinocchio has computed, with joint velocities `v` (nv,)."""
        J, com_jacobian, com, places, rotations = self._views
        frames, twists = np.array(places), np.empty((2, 6))
        frame_twists(J, v, *self._palm_chains, places[:2], twists)
        self.com, self.com_velocity = com.copy(), com_jacobian @ v  # (3,) [m], [m/s]
        self.palms, self.elbows, self.soles = frames[:2], frames[2:4], frames[4:6]  # (2, 3) [m]
        self.leg_links = frames[LEG_LINKS]  # (4, 2, 3) [m] thighs, shanks
        self.palm_velocities = twists[:, :3]  # (2, 3) [m/s]
        self.sole_yaws = np.array([heading_of(rotations[0]), heading_of(rotations[1])])  # (2,) [rad]
        self._torso_position, self._torso_rotation = frames[6], rotations[2].copy()
