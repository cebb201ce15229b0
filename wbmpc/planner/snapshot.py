"""What was measured at a plan's snapshot, as the planner needs it."""

from __future__ import annotations

from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.frame_terms import chains_of, frame_twists
from wbmpc.jit import kernel
from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import Feet
from wbmpc.robot import Robot
from wbmpc.rotations import heading_of
from wbmpc.signals import RobotState, Vector


class Snapshot:
    """The robot at the last snapshot; all in world."""

    def __init__(self, robot: Robot, q: Vector) -> None:
        """At rest at `q` (nq,)."""
        self._kinematics = Kinematics(robot)
        frames = (*robot.palm_frames, *robot.elbow_frames, *robot.sole_frames, robot.torso_frame)
        links = chain.from_iterable(link for leg in robot.leg_frames for link in pairwise(leg))
        self._views = self._kinematics.views((*frames, *links), (*robot.sole_frames, robot.torso_frame))
        self._palm_chains = chains_of(robot.pin_model, robot.palm_frames)
        self._kinematics.update_kinematics(q)
        self._read(np.zeros(robot.nv))
        self.feet_zmp = self.com[:2].copy()  # (2,) [m] centre of both soles' pressure
        self._homes = (self.palms - self._torso_position) @ self._torso_rotation  # in the torso
        self.palm_homes = self.palms  # (2, 3) [m] where free palms hang: as at the start, seen from the torso

    def update(self, state: RobotState) -> None:
        """Take in a new state."""
        self._kinematics.update_kinematics(state.q)
        self._read(np.array(state.v))
        self.palm_homes = self._torso_position + self._homes @ self._torso_rotation.T
        (_, _, left, left_x, left_y, _), (_, _, right, right_x, right_y, _) = state.sole_wrench_in_world.tolist()
        (left_px, left_py, _), (right_px, right_py, _) = self.soles.tolist()
        load = max(left + right, 1e-6)
        along = left * left_px + right * right_px + (-left_y - right_y)
        across = left * left_py + right * right_py + (left_x + right_x)
        self.feet_zmp = np.array([along / load, across / load])

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
        rotations = self._views[4]
        points, self.com, self.com_velocity, self.palm_velocities = _copy(self._views[:4], v, *self._palm_chains)
        self.palms, self.elbows, self.soles = points[:2], points[2:4], points[4:6]  # (2, 3) [m]
        self.leg_links = points[7:].reshape(4, 2, 3)  # [m] thighs, shanks
        self.sole_yaws = np.array([heading_of(rotations[0]), heading_of(rotations[1])])  # (2,) [rad]
        self._torso_position, self._torso_rotation = points[6], rotations[2].copy()


@kernel
def _copy(
    pin: Any, v: Vector, palm_chains: NDArray[np.int64], lengths: NDArray[np.int64]
) -> tuple[Vector, Vector, Vector, Vector]:
    """Places (n, 3) of the frames; the CoM (3,) and its velocity; velocities (2, 3) of the palms, the first frames.

    Args:
        pin: Pinocchio's views: J (6, nv), J_com (3, nv), CoM, n positions.
        palm_chains, lengths: see `chains_of`.
    """
    J, com_jacobian, com, positions = pin
    points, twists = np.empty((len(positions), 3)), np.empty((2, 6))
    for i in range(len(positions)):
        points[i] = positions[i]
    frame_twists(J, v, palm_chains, lengths, points[:2], twists)
    return points, com.copy(), np.dot(com_jacobian, v), twists[:, :3].copy()
