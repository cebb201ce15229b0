"""How fast a hand goes to its contact: from careful, for a reach, to all that the arm can do, for a push."""

from __future__ import annotations

import math

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.settings import ContactSettings
from wbmpc.record import record
from wbmpc.signals import Vector

ARRIVED, ROUGHLY_ARRIVED = 0.012, 0.05  # [m] palm error at the clearance point below which the descent begins


def hurried(urgency: float) -> bool:
    """Whether hands go straight to their surface, as fast as the arm can."""
    return urgency > 0.5


def way_time(settings: ContactSettings, distance: float) -> float:
    """Time [s] that such a hand needs for `distance` [m], from rest to rest with the acceleration it may have."""
    return math.sqrt(6.0 * distance / settings.urgent_acceleration)


@kernel
def ramp(cap: float, level: float, slope: float, times: Vector) -> Vector:
    """Bounds (n,) [N] at `times` (n,) [s]: of `cap` the share `level`, which goes on with `slope` [1/s], 0 … 1."""
    caps = np.empty(len(times))
    for k in range(len(times)):
        caps[k] = cap * min(max(level + slope * times[k], 0.0), 1.0)
    return caps


@record
class Pace:
    """Speeds and times of one approach, between the careful (urgency 0) and the urgent (1) end of the settings."""

    urgency: float  # 0 … 1
    clearance: float  # [m] distance from the surface at which the way ends and the descent begins
    arrived: float  # [m] palm error there that is small enough
    touch_speed: float  # [m/s] of the descent
    ramp_time: float  # [s] of the force cap from nothing to all

    @property
    def hurried(self) -> bool:
        """Whether the palm goes straight to the surface, as fast as this."""
        return hurried(self.urgency)

    @classmethod
    def of(cls, settings: ContactSettings, urgency: float) -> Pace:
        """`urgency` 0 … 1: the planner's alarm."""

        def between(calm: float, urgent: float) -> float:
            return calm + urgency * (urgent - calm)

        return cls(
            urgency=urgency,
            clearance=between(settings.approach_clearance, 0.0),
            arrived=between(ARRIVED, ROUGHLY_ARRIVED),
            touch_speed=between(settings.touch_speed, settings.urgent_touch_speed),
            ramp_time=between(settings.ramp_time, settings.urgent_ramp_time),
        )
