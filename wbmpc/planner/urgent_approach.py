"""The way of a hand that must be at its contact before the robot has fallen."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.hand_path import Landing
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import PatchPose
from wbmpc.signals import Vector

STOPPED_HEIGHT, STOPPED_SPEED = 0.004, 0.05  # [m], [m/s] a palm slower than this so near has touched
STANDOFF = 0.012  # [m] above the surface at which it has its landing speed
FOLLOWED = 0.02  # [s] after its snapshot a plan is followed so long
LAST_AIM = 0.03  # [s] it is aimed at least so far ahead: nearer, noise would be magnified


class UrgentApproach:
    """Straight to the patch as fast as the arm can, aimed anew at every plan from where the palm is by then."""

    def __init__(
        self, patch: PatchPose, settings: ContactSettings, *, radius: float, palm: Vector, velocity: Vector
    ) -> None:
        """From `palm` (3,) [m] moving with `velocity` (3,) [m/s]; `radius` is the palm's [m]."""
        self._patch, self._radius, self._most = patch, radius, settings.urgent_acceleration
        self._speed = settings.urgent_touch_speed
        self._arrival = -self._speed * patch.normal
        way = patch.position + radius * patch.normal - palm
        self.duration = Landing.shortest(
            way=way, velocity=velocity, arrival=self._arrival, acceleration=settings.urgent_acceleration
        )
        self.aim(palm, velocity, elapsed=0.0)

    def aim(self, palm: Vector, velocity: Vector, *, elapsed: float) -> None:
        """Aim anew, `elapsed` [s] after the start; past the end of its way it goes on at its landing speed.

        A palm that is there before its time is not called back: it takes its landing speed from where it is.
        """
        left = self.duration - elapsed
        normal, height = self._patch.normal, self._height(palm)
        duration, end = max(left, LAST_AIM), STANDOFF - max(LAST_AIM - left, 0.0) * self._speed
        if height < STANDOFF:
            duration, end = LAST_AIM, height - LAST_AIM * self._speed
        self._landing = Landing(
            start=palm.copy(),
            velocity=velocity.copy(),
            end=self._patch.position + (self._radius + end) * normal,
            arrival=self._arrival,
            duration=duration,
            normal=normal,
        )

    def _height(self, palm: Vector) -> float:
        """Of the palm's surface over the patch [m]."""
        return float((palm - self._patch.position) @ self._patch.normal) - self._radius

    def reference(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Palm position, velocity, acceleration and jerk (3,) to follow now, the last two within what an arm can give.

        A plan is followed until the next one's is there; on so short a way the acceleration changes sign meanwhile.
        """
        position, velocity, acceleration = self._landing.at(0.0)
        now, then = self._within(acceleration), self._within(self._landing.at(FOLLOWED)[2])
        return position, velocity, now, (then - now) / FOLLOWED

    def _within(self, acceleration: Vector) -> Vector:
        """An acceleration (3,) cut to what an arm can give [m/s²]."""
        along = float(acceleration @ self._patch.normal)
        across = acceleration - along * self._patch.normal
        across *= min(1.0, self._most / max(float(np.linalg.norm(across)), 1e-9))
        return across + min(max(along, -1.5 * self._most), 1.5 * self._most) * self._patch.normal

    def preview(self, times: Vector) -> Vector:
        """Palm references (n, 3) [m] at `times` (n,) seconds from now; it stays where it lands."""
        return np.array([self._landing.at(min(t, self._landing.duration))[0] for t in times])

    def stopped(self, palm: Vector, velocity: Vector, *, elapsed: float) -> bool:
        """Whether something has stopped a palm that was to meet the surface in motion: a bounce between two plans."""
        late = elapsed > 0.5 * self.duration
        return late and self._height(palm) < STOPPED_HEIGHT and float(velocity @ self._patch.normal) > -STOPPED_SPEED
