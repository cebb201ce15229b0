"""One footstep: which foot goes where, and how."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.record import record
from wbmpc.rotations import plane_rotation
from wbmpc.signals import Vector

SIDE_SIGN = (1.0, -1.0)  # left is +y
CAREFUL_LEAD = 0.3  # of a slow step: the foot rises, goes over, comes down
ALIGNED, ALIGNED_YAW = 0.02, 0.06  # [m], [rad] feet so close to side by side need no further step


@dataclass(frozen=True, slots=True, eq=False)
class Footstep:
    """A place for a foot, before stage 2 has moved it."""

    side: int  # which foot goes
    position: Vector  # (3,) [m] sole centre in world
    yaw: float  # [rad]
    swing_time: float  # [s]
    double_support: float  # [s] before the foot is lifted, when it follows another step
    clearance: float  # [m] how high the foot is lifted
    lead: float  # share of the swing in which the foot only rises, and at its end only sinks: 0 … 0.4
    adaptable: bool  # a walking step: stage 2 may move it, its swing does not wait for the CoM
    task: int  # index of the task that asks for it

    def share(self, sigma: Vector) -> Vector:
        """Share (n,) of the horizontal way done at `sigma` (n,), shares of the swing time: minimum jerk."""
        phase = np.clip((sigma - self.lead) / (1.0 - 2.0 * self.lead), 0.0, 1.0)
        return phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)


@record
class SoleReferences:
    """Where both soles should be now, and how they should move: those that stand stay."""

    positions: Vector  # (2, 3) [m] in world
    yaws: Vector  # (2,) [rad]
    velocities: Vector  # (2, 3) [m/s]
    yaw_rates: Vector  # (2,) [rad/s]
    accelerations: Vector  # (2, 3) [m/s²]

    @property
    def heading(self) -> float:
        """[rad] between the two."""
        left, right = self.yaws.tolist()
        return 0.5 * (left + right)


@record
class Feet:
    """Where both feet stand, or will stand; the steps are planned from this."""

    positions: Vector  # (2, 3) [m] sole centres in world
    yaws: Vector  # (2,) [rad]
    last: int  # side of the foot that moved last; -1 when none has

    @property
    def heading(self) -> float:
        """[rad] the robot's, between the two."""
        left, right = self.yaws.tolist()
        return 0.5 * (left + right)

    @property
    def centre(self) -> Vector:
        """(2,) [m] between the two."""
        return 0.5 * (self.positions[0, :2] + self.positions[1, :2])

    @property
    def height(self) -> float:
        """[m] of the ground under the robot: the mean of both soles'."""
        return 0.5 * float(self.positions[0, 2] + self.positions[1, 2])

    @property
    def aligned(self) -> bool:
        """Whether they stand side by side."""
        across = plane_rotation(self.heading).T @ (self.positions[0] - self.positions[1])[:2]
        return bool(abs(across[0]) < ALIGNED and abs(self.yaws[0] - self.yaws[1]) < ALIGNED_YAW)

    def after(self, step: Footstep) -> Feet:
        """The feet when `step` has been made."""
        positions, yaws = self.positions.copy(), self.yaws.copy()
        positions[step.side], yaws[step.side] = step.position, step.yaw
        return Feet(positions, yaws, step.side)
