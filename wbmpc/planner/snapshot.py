"""What was measured at a plan's snapshot, as the planner needs it."""

from __future__ import annotations

from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.frame_terms import chains_of, frame_twists, rotation_of
from wbmpc.jit import kernel
from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import Feet
from wbmpc.robot import Robot
from wbmpc.signals import RobotState, Vector


class Snapshot:
    """The robot at the last snapshot; all in world."""

    def __init__(self, robot: Robot, q: Vector) -> None:
        """At rest at `q` (nq,)."""
        self._kinematics = Kinematics(robot)
        links = chain.from_iterable(link for leg in robot.leg_frames for link in pairwise(leg))
        frames = (*robot.palm_frames, *robot.elbow_frames, *robot.sole_frames, robot.torso_frame, *links)
        self._views, self._frames = self._kinematics.views, np.array(frames)
        self._palm_chains = chains_of(robot.pin_model, robot.palm_frames)
        self._kinematics.update_kinematics(q)
        self._homes = np.zeros((2, 3))  # in the torso
        self._look(np.zeros(robot.nv), np.zeros((2, 6)))
        self.feet_zmp = self.com[:2].copy()  # (2,) [m] centre of both soles' pressure
        self.palm_homes = self.palms  # (2, 3) [m] where free palms hang: as at the start, seen from the torso
        torso, rotation = (look(robot.torso_frame) for look in (self._kinematics.position, self._kinematics.rotation))
        self._homes = (self.palms - torso) @ rotation

    def update(self, state: RobotState) -> None:
        """Take in a new state."""
        self._kinematics.update_kinematics(state.q)
        self._look(np.array(state.v), np.array(state.sole_wrench_in_world))

    @property
    def feet(self) -> Feet:
        """Where the feet stand, none of them having stepped."""
        return Feet(self.soles.copy(), self.sole_yaws.copy(), -1)

    @property
    def limbs(self) -> tuple[Vector, Vector, Vector]:
        """Palms (2, 3), elbows (2, 3) and the ends of thighs and shanks (4, 2, 3) [m]."""
        return self.palms, self.elbows, self.leg_links

    def _look(self, v: Vector, wrenches: Vector) -> None:
        """Copy what Pinocchio has computed, with joint velocities `v` (nv,) and the soles' `wrenches` (2, 6)."""
        seen = _seen(self._views, self._frames, v, *self._palm_chains, self._homes, wrenches)
        self.palms, self.elbows, self.soles = seen[:2], seen[2:4], seen[4:6]  # (2, 3) [m]
        self.leg_links = seen[7:15].reshape(4, 2, 3)  # [m] thighs, shanks
        self.com, self.com_velocity, self.palm_velocities = seen[15], seen[16], seen[17:19]  # [m], [m/s]
        self.palm_homes, self.feet_zmp = seen[19:21], seen[23, :2]
        self.sole_yaws = np.arctan2(seen[21:23, 1], seen[21:23, 0])  # (2,) [rad]


@kernel
def _seen(
    pin: Any,
    frames: NDArray[np.int64],
    v: Vector,
    palm_chains: NDArray[np.int64],
    lengths: NDArray[np.int64],
    homes: Vector,
    wrenches: Vector,
) -> Vector:
    """Rows (24, 3): places of the frames; the CoM and its velocity; velocities and homes of the palms; the soles' own
    x axes; centre of their pressure; in world.

    Args:
        pin: Pinocchio's views, see `Kinematics`.
        frames: (15,) of palms, elbows, soles, torso and leg links.
        palm_chains, lengths: see `chains_of`.
        homes: (2, 3) in the torso [m].
        wrenches: (2, 6) on the soles, in world [N, N m].
    """
    J, com_jacobian, com, poses = pin
    seen, twists, torso = np.zeros((24, 3)), np.empty((2, 6)), np.empty((3, 3))
    for i in range(15):
        seen[i] = poses[frames[i], 3]
    frame_twists(J, v, palm_chains, lengths, seen[:2], twists)
    seen[15], seen[16], seen[17:19] = com, np.dot(com_jacobian, v), twists[:, :3]
    torso[:] = rotation_of(poses, frames[6])
    seen[19:21] = np.dot(homes, torso.T)
    for side in range(2):
        for i in range(3):
            seen[19 + side, i] += seen[6, i]
            seen[21 + side, i] = poses[frames[4 + side], 0, i]
    left, right, zmp = wrenches[0], wrenches[1], seen[23]
    load = max(left[2] + right[2], 1e-6)
    zmp[0] = (left[2] * seen[4, 0] + right[2] * seen[5, 0] + (-left[4] - right[4])) / load
    zmp[1] = (left[2] * seen[4, 1] + right[2] * seen[5, 1] + (left[3] + right[3])) / load
    return seen
