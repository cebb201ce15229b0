"""A step that is slow or long: what it asks of the CoM is planned with a posture, as a reach of the foot."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.swing import Swing
from wbmpc.record import record
from wbmpc.signals import Vector


@record
class Stride:
    """The step ahead or under way, as far as the CoM is concerned."""

    step: Footstep
    feet: Feet  # before the step
    swing: Swing | None  # None: the foot still stands
    left: float  # [s] until the foot lifts, or lands when it swings, at full pace

    @property
    def after(self) -> Feet:
        """The feet when the step has been made."""
        return self.feet.after(self.step)

    @property
    def stance_centre(self) -> Vector:
        """(2,) [m] of the foot that stands."""
        return self.feet.positions[1 - self.step.side][:2]

    @property
    def sigma(self) -> float:
        """Share of the foot's way done, 0 … 1."""
        return float(self.shares(np.zeros(1), rate=0.0)[0])

    def shares(self, times: Vector, *, rate: float) -> Vector:
        """Shares (n,) of the foot's way done `times` (n,) seconds from now, the clock going on at `rate`."""
        duration = self.step.swing_time
        passed = rate * times - self.left + (0.0 if self.swing is None else duration)
        return self.step.share(np.clip(passed / duration, 0.0, 1.0))

    def positions(self, shares: Vector) -> Vector:
        """Horizontal places (n, 2) [m] of the foot at `shares` (n,) of its way."""
        start = self.feet.positions[self.step.side][:2]
        return start + shares[:, None] * (self.step.position[:2] - start)
