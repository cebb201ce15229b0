"""The CoM state that each plan starts from: the planned one, drawn to the measured one."""

from __future__ import annotations

import numpy as np

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
        if np.isfinite(velocity).all():  # one broken measurement must not stay in the filter
            self._velocity += VELOCITY_SHARE * (velocity - self._velocity)

    def update(self, planned: Vector, *, measured: Vector, height: float) -> None:
        """Continue from the last plan's state (3, 3), given the measured CoM (3,) and its height over the feet [m]."""
        settings = self._settings
        self.value = planned
        if not np.isfinite(measured).all():
            return
        felt = (self._velocity[:2] - self._before) / self._period - planned[:2, 2]
        self._push += PUSH_SHARE * (felt - self._push)
        self._before = self._velocity[:2].copy()
        position_error = measured[:2] - planned[:2, 0]
        velocity_error = self._velocity[:2] - planned[:2, 1]
        omega = np.sqrt(GRAVITY / max(height, 0.05))
        capture_error = float(np.linalg.norm(position_error + velocity_error / omega))
        alarm = min(max(capture_error / settings.feedback_knee - 1.0, 0.0), 1.0)
        self.alarm = max(alarm, self.alarm - self._period / ALARM_TIME)
        share = settings.feedback + alarm * (settings.feedback_large - settings.feedback)
        self.value[:2, 0] += share * position_error
        self.value[:2, 1] += share * velocity_error
