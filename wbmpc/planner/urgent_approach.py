"""The way of a hand that must be at its contact before the robot has fallen."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.hand_path import Landing
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import PatchPose
from wbmpc.signals import Vector

STOPPED_HEIGHT, STOPPED_SPEED = 0.008, 0.05  # [m], [m/s] a palm slower than this so near has touched
STANDOFF = 0.004  # [m] above the surface at which it has its landing speed
LAST_AIM = 0.03  # [s] it is aimed at least so far ahead: nearer, noise would be magnified


class UrgentApproach:
    """Straight to the patch as fast as the arm can, aimed anew at every plan from where the palm is by then."""

    def __init__(
        self, patch: PatchPose, settings: ContactSettings, *, radius: float, palm: Vector, velocity: Vector
    ) -> None:
        """From `palm` (3,) [m] moving with `velocity` (3,) [m/s]; `radius` is the palm's [m]."""
        self._patch, self._radius, self._most = patch, radius, settings.urgent_acceleration
        self._arrival = -settings.urgent_touch_speed * patch.normal
        way = patch.position + radius * patch.normal - palm
        self.duration = Landing.shortest(
            way=way, velocity=velocity, arrival=self._arrival, acceleration=settings.urgent_acceleration
        )
        self.aim(palm, velocity, elapsed=0.0)

    def aim(self, palm: Vector, velocity: Vector, *, elapsed: float) -> None:
        """Aim anew, `elapsed` [s] after the start; past the end of its way it goes on at its landing speed."""
        left = self.duration - elapsed
        beyond = max(LAST_AIM - left, 0.0)
        normal = self._patch.normal
        self._landing = Landing(
            start=palm.copy(),
            velocity=velocity.copy(),
            end=self._patch.position + (self._radius + STANDOFF) * normal + beyond * self._arrival,
            arrival=self._arrival,
            duration=max(left, LAST_AIM),
            normal=normal,
        )

    def reference(self) -> tuple[Vector, Vector, Vector]:
        """Palm position, velocity and acceleration (3,) to follow now, the last within what an arm can give."""
        position, velocity, acceleration = self._landing.at(0.0)
        along = float(acceleration @ self._patch.normal)
        across = acceleration - along * self._patch.normal
        across *= min(1.0, self._most / max(float(np.linalg.norm(across)), 1e-9))
        return position, velocity, across + min(max(along, -1.5 * self._most), 1.5 * self._most) * self._patch.normal

    def preview(self, times: Vector) -> Vector:
        """Palm references (n, 3) [m] at `times` (n,) seconds from now; it stays where it lands."""
        return np.array([self._landing.at(min(t, self._landing.duration))[0] for t in times])

    def stopped(self, palm: Vector, velocity: Vector, *, elapsed: float) -> bool:
        """Whether something has stopped a palm that was to meet the surface in motion: a bounce between two plans."""
        height = float((palm - self._patch.position) @ self._patch.normal) - self._radius
        late = elapsed > 0.5 * self.duration
        return late and height < STOPPED_HEIGHT and float(velocity @ self._patch.normal) > -STOPPED_SPEED
