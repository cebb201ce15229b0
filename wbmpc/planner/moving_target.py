"""A target that somebody moves in the middle of a run, as a smooth reference."""

from __future__ import annotations

import numpy as np

from wbmpc.signals import Vector

FREQUENCY = 6.0  # [rad/s] of the critically damped way to where the target was put
LEAD = 0.05  # [m] by which that may lead: the reference's speed stays below LEAD · FREQUENCY / 2 = 0.15 m/s


class MovingTarget:
    """Where a target is on its way to where it was put, `goal`: x'' = ω² (g - x) - 2 ω x', solved exactly.

    A goal far ahead counts as one at the distance `LEAD`, which bounds the speed. A target that nobody moves keeps its
    bits.
    """

    def __init__(self, place: Vector) -> None:
        """At rest at `place` (3,) [m] in world."""
        self.goal = self.position = place
        self.velocity = self.acceleration = np.zeros(3)  # [m/s], [m/s²]

    @property
    def moving(self) -> bool:
        """Whether it is on its way."""
        return self.position is not self.goal

    def advance(self, dt: float) -> None:
        """`dt` [s] later; it has arrived when less than 10 µm and 0.1 mm/s are left."""
        if not self.moving:
            return
        x, v = self._after(np.array([dt]))
        self.position, self.velocity = x[0], v[0]
        if np.linalg.norm(self.goal - self.position) < 1e-5 and np.linalg.norm(self.velocity) < 1e-4:
            self.position, self.velocity = self.goal, np.zeros(3)

    def preview(self, times: Vector) -> Vector:
        """Positions (n, 3) [m] at `times` (n,) seconds from now, if nobody moves it again."""
        return self._after(times)[0] if self.moving else np.tile(self.goal, (len(times), 1))

    def _after(self, times: Vector) -> tuple[Vector, Vector]:
        """Position and velocity, (n, 3) each."""
        way, w, t = self.goal - self.position, FREQUENCY, times[:, None]
        lead = way * min(1.0, LEAD / max(float(np.linalg.norm(way)), 1e-12))
        a, b = -lead, self.velocity - w * lead
        decay = np.exp(-w * t)
        return self.position + lead + (a + b * t) * decay, (b - w * (a + b * t)) * decay
