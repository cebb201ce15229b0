"""Checks of where the CoM is with respect to the feet that carry it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.context import SAMPLE_PERIOD, CheckContext
from wbmpc.checks.footsteps import Footstep, footsteps
from wbmpc.checks.hold import find_hold_of_body
from wbmpc.checks.result import CheckResult, at_least, failed, first_time
from wbmpc.checks.support import com_outside, distance_outside
from wbmpc.signals import SIDES, Vector

SETTLING = 0.5  # [s] after a landing, in which a falling robot shows


class ComBeyondToesCheck:
    """min over the best hold of the distance of the CoM's ground projection outside the support polygon of the feet.

    The polygon is the hull of the true sole corners of the feet that touch the world: the planner's is not trusted.
    """

    def __init__(self, config: settings.ComBeyondToes) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        window = find_hold_of_body(context, self.config)
        if isinstance(window, str):
            return failed(name, self.config.min, "m", window)
        ticks = range(window.start, window.stop, context.ticks(SAMPLE_PERIOD))
        touching = context.sole_touching
        if not all(touching[k].any() for k in ticks):
            return failed(name, self.config.min, "m", "no foot touches the ground during the hold")
        outside = np.array([self._distance(context, k, touching[k]) for k in ticks])
        when = first_time(context.time[list(ticks)], ~(outside >= self.config.min))
        message = f"outside the feet for {self.config.hold:g} s from t = {context.time[window.start]:.2f} s"
        return at_least(name, float(outside.min()), self.config.min, "m", message, when=when)

    @staticmethod
    def _distance(context: CheckContext, tick: int, touching: Vector) -> float:
        corners = context.facts.sole_vertices(context.recorder.qpos[tick])[touching]  # (1 or 2, k, 3)
        return distance_outside(context.recorder.com[tick, :2], corners.reshape(-1, 3)[:, :2])


class ComOutsideStanceCheck:
    """max over footsteps of the largest distance of the CoM's ground projection outside the stance sole's rectangle.

    Counted are the samples at which the stance sole touches and the other one does not, in flights that end with the
    torso up.
    """

    def __init__(self, config: settings.ComOutsideStance) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        best, message = -np.inf, "no foot was lifted and put down again with the torso up"
        for step in footsteps(context):
            end = step.touch_down + context.ticks(SETTLING)
            if not (context.recorder.torso_up[step.lift_off : end] >= self.config.min_torso_up).all():
                continue
            ticks, outside = self._flight(context, step)
            if outside.size and outside.max() > best:
                best, when = float(outside.max()), context.time[ticks[np.argmax(outside)]]
                landing = context.time[step.touch_down]
                message = f"at t = {when:.2f} s, before the {SIDES[step.side]} foot lands at t = {landing:.2f} s"
        if not np.isfinite(best):
            return failed(name, self.config.min, "m", message)
        return at_least(name, best, self.config.min, "m", message, when=None)

    @staticmethod
    def _flight(context: CheckContext, step: Footstep) -> tuple[NDArray[np.int64], Vector]:
        """Ticks (w,) of the samples of one flight on the other foot alone, and the distances outside it (w,) [m]."""
        sample, touching = context.sample_ticks, context.sole_touching
        single = (sample >= step.lift_off) & (sample < step.touch_down)
        single &= touching[sample, 1 - step.side] & ~touching[sample, step.side]
        stance = np.zeros((sample.size, len(SIDES)), dtype=bool)
        stance[single, 1 - step.side] = True
        return sample[single], com_outside(context, stance)[single]
