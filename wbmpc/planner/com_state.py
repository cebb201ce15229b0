"""The CoM state that each plan starts from: the planned one, drawn to the measured one."""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.settings import PlannerSettings
from wbmpc.signals import GRAVITY, Vector

ALARM_TIME = 0.6  # [s] in which an alarm wears off
PUSH_TIME = 0.05  # [s] for which a push that is felt now is taken to go on
PUSH_SHARE = 0.5  # per plan, of the felt push
VELOCITY_SHARE = 0.6  # per plan: a filter of about 15 Hz at 100 plans a second


class ComState:
    """c, ċ, c̈ per axis, the planned state continued and pulled by a share of its error; c̈ is always the plan's.

    Pure measured feedback would put sensor noise into every plan, none at all would not notice a push. The share grows
    from `feedback` to `feedback_large` while the capture-point error c + ċ/ω goes from one to two `feedback_knee`; the
    same measure sounds the alarm (0 … 1), which wears off over ALARM_TIME.
    """

    def __init__(self, settings: PlannerSettings, *, com: Vector, period: float) -> None:
        """At rest at `com` (3,) [m]; `period` is the time between two plans [s]."""
        self._settings, self._period = settings, period
        self.value = np.zeros((3, 3))  # rows x, y, z; columns c, ċ, c̈ [m, m/s, m/s²]
        self.value[:, 0] = com
        self.alarm = 0.0
        self._velocity = np.zeros(3)
        self._before = np.zeros(2)  # [m/s] the velocity at the last plan
        self._push = np.zeros(2)  # [m/s²] measured acceleration that no plan has asked for

    @property
    def anticipated(self) -> Vector:
        """The state (3, 3) with the velocity that a push leads to if it goes on for PUSH_TIME; without alarm `value`.

        A hand takes longer to its contact than a push lasts: whether it is needed cannot wait for the push's end.
        """
        ahead = self.value.copy()
        ahead[:2, 1] += self.alarm * PUSH_TIME * self._push
        return ahead

    def inset(self, *, walking: bool) -> float:
        """Inset of the support polygon [m], smaller the louder the alarm."""
        settings = self._settings.whole_body
        alarmed = settings.zmp_margin_step if walking else settings.zmp_margin_alarm
        return settings.zmp_margin + self.alarm * (alarmed - settings.zmp_margin)

    def filter(self, velocity: Vector) -> None:
        """Take in a measured CoM velocity (3,) [m/s]."""
        _filter(velocity, self._velocity)

    def update(self, planned: Vector, *, measured: Vector, height: float) -> None:
        """Continue from the last plan's state (3, 3), given the measured CoM (3,) and its height over the feet [m]."""
        settings, period = self._settings, self._period
        self.value = planned
        alarm = _draw(
            *(planned, measured, self._velocity, self._before, self._push),
            *(period, sqrt(GRAVITY / max(height, 0.05))),
            *(settings.feedback, settings.feedback_large, settings.feedback_knee),
        )
        if alarm >= 0.0:
            self.alarm = max(alarm, self.alarm - period / ALARM_TIME)


@kernel
def _filter(velocity: Vector, filtered: Vector) -> None:
    """Move `filtered` (3,) by its share to `velocity` (3,) [m/s]."""
    if isfinite(velocity[0]) and isfinite(velocity[1]) and isfinite(velocity[2]):
        for i in range(3):  # one broken measurement must not stay in the filter
            filtered[i] += VELOCITY_SHARE * (velocity[i] - filtered[i])


@kernel
def _draw(
    state: Vector,
    measured: Vector,
    velocity: Vector,
    before: Vector,
    push: Vector,
    period: float,
    omega: float,
    least: float,
    largest: float,
    knee: float,
) -> float:
    """Draw `state` (3, 3) to the measured CoM (3,) and its velocity (3,), and take in what push (2,) they show.

    Args:
        before: (2,) [m/s] the velocity at the last plan; becomes that at this one.
        omega: [1/s] of the capture point.
        least, largest, knee: shares of the error, and the capture-point error [m] between them.

    Returns:
        The alarm 0 … 1 of this error alone; negative when nothing can be said.
    """
    if not (isfinite(measured[0]) and isfinite(measured[1]) and isfinite(measured[2])):
        return -1.0
    position_error, velocity_error, capture_error = np.empty(2), np.empty(2), np.empty(2)
    for i in range(2):
        felt = (velocity[i] - before[i]) / period - state[i, 2]
        push[i] += PUSH_SHARE * (felt - push[i])
        before[i] = velocity[i]
        position_error[i] = measured[i] - state[i, 0]
        velocity_error[i] = velocity[i] - state[i, 1]
        capture_error[i] = position_error[i] + velocity_error[i] / omega
    size = sqrt(np.dot(capture_error, capture_error))
    alarm = min(max(size / knee - 1.0, 0.0), 1.0)
    share = least + alarm * (largest - least)
    for i in range(2):
        state[i, 0] += share * position_error[i]
        state[i, 1] += share * velocity_error[i]
    return alarm
