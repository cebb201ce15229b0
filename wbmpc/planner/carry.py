"""What is held while the feet go: both palms keep their places beside the CoM."""

from __future__ import annotations

import numpy as np

from wbmpc.rotations import cross, level_frame
from wbmpc.signals import Vector


class Carry:
    """Palm references that go along with the planned CoM, which is smooth, and turn with the feet.

    The CoM sways from foot to foot by half their distance; a box that stayed behind would come too near to the torso.
    """

    def __init__(self, palms: Vector, *, com: Vector, heading: float) -> None:
        """Keep the places that `palms` (2, 3) have beside the CoM (3,) [m] when the feet have this `heading` [rad]."""
        self._places = (palms - com) @ level_frame(heading)  # (2, 3) [m] in the frame of the heading
        self.follow(np.column_stack([com, np.zeros((3, 2))]), com[None], heading=heading, yaw_rate=0.0)

    def follow(self, com: Vector, course: Vector, *, heading: float, yaw_rate: float) -> None:
        """Take in the planned CoM: its state (3, 3) now, its course (N, 3) [m] over the horizon; the feet's heading."""
        self._com, self._course = com, course
        self._turn, self._yaw_rate = level_frame(heading), yaw_rate

    def beside(self, com: Vector, heading: float) -> Vector:
        """Palms (2, 3) [m] when the CoM is at `com` (3,) [m]."""
        return com + self._places @ level_frame(heading).T

    def reference(self, side: int) -> tuple[Vector, Vector]:
        """Palm position [m] and velocity [m/s] (3,) to follow now."""
        arm = self._turn @ self._places[side]
        return self._com[:, 0] + arm, self._com[:, 1] + cross(np.array([0.0, 0.0, self._yaw_rate]), arm)

    def preview(self) -> Vector:
        """Palm references (2, N, 3) [m]; the heading stays what it is now."""
        return self._course + (self._places @ self._turn.T)[:, None]
