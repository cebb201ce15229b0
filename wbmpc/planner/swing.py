"""The swing foot's way from lift-off to a landing place that may still move."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep import Footstep
from wbmpc.planner.hand_path import minimum_jerk
from wbmpc.rotations import length
from wbmpc.signals import Vector

RISE = 0.5  # share of the swing after which a foot that goes over at once is up


class Swing:
    """One swing foot as a function of σ in [0, 1], its share of the swing time.

    The foot rises, goes over, and comes down; how early it goes over depends on `Footstep.lead`. The landing place may
    be moved while the foot is on its way: it follows at a bounded speed. After σ = 1 the foot sinks until it lands.
    """

    def __init__(self, step: Footstep, *, start: Vector, yaw: float, speed: float) -> None:
        """From `start` (3,) [m] and `yaw` [rad]; the landing place follows at `speed` [m/s]."""
        self.step = step
        self.start, self.start_yaw = start.copy(), yaw
        self.target = step.position.copy()
        self.sigma = 0.0
        self._speed = speed
        self._target_velocity = np.zeros(3)
        self._depth, self._sinking = 0.0, 0.0

    def move_target(self, target: Vector, dt: float) -> None:
        """Move the landing place towards `target` (2,) [m], no further than the speed allows in dt [s]."""
        way = target - self.target[:2]
        way *= min(1.0, self._speed * dt / max(length(way), 1e-9))
        self.target[:2] += way
        self._target_velocity[:2] = way / dt

    def lower(self, depth: float, speed: float) -> None:
        """After σ = 1: `depth` [m] below the landing place, moving down at `speed` [m/s]."""
        self._depth, self._sinking = depth, speed

    def reference(self, rate: float) -> tuple[Vector, Vector, Vector]:
        """Sole position (3,) [m], velocity and acceleration now, σ growing at `rate` [1/s]."""
        lead = self.step.lead
        span = 1.0 - 2.0 * lead
        s, ds, dds = minimum_jerk((self.sigma - lead) / span)
        way = self.target - self.start
        p = self.start + s * way
        v = (ds / span * rate) * way + s * self._target_velocity
        a = (dds / span**2 * rate**2) * way
        rise = RISE - 0.5 * lead
        height = self.step.clearance
        for begin, end, sign in ((0.0, rise, 1.0), (1.0 - rise, 1.0, -1.0)):
            h, dh, ddh = minimum_jerk((self.sigma - begin) / (end - begin))
            p[2] += sign * height * h
            v[2] += sign * height * dh / (end - begin) * rate
            a[2] += sign * height * ddh / ((end - begin) * (end - begin)) * rate**2
        p[2] -= self._depth
        v[2] -= self._sinking
        return p, v, a

    def heading(self, rate: float) -> tuple[float, float]:
        """Yaw [rad] and its rate [rad/s] now, σ growing at `rate` [1/s]."""
        lead = self.step.lead
        span = 1.0 - 2.0 * lead
        s, ds, _ = minimum_jerk((self.sigma - lead) / span)
        turn = self.step.yaw - self.start_yaw
        return self.start_yaw + s * turn, ds / span * rate * turn
