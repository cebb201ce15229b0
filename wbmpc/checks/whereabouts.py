"""Checks of where the robot got to: by walking, at its goal, with one foot."""

from __future__ import annotations

import math

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.footsteps import sole_loaded
from wbmpc.checks.result import CheckResult, at_least, at_most, failed, first_time
from wbmpc.signals import SIDES, Vector

LEVEL = 0.005  # [m] within which a sole is as high as the ground: the controller is not told of all its errors


class TravelledCheck:
    """Displacement of the midpoint between the soles, and the feet's mean turn, over the window.

    The value is that of the first violated range; if none is, of the first range given.
    """

    def __init__(self, config: settings.Travelled) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config = self.config
        ranges = {"forward": config.forward, "left": config.left, "turned": config.turned}
        units = {"forward": "m", "left": "m", "turned": "rad"}
        wanted = {key: bounds for key, bounds in ranges.items() if bounds is not None}
        start, end = config.window or (0.0, len(context.time) * context.facts.timestep)
        first, last = (round(time / context.facts.timestep) for time in (start, end))
        key = next(iter(wanted))
        if last > context.recorder.ticks:
            return failed(name, wanted[key][0], units[key], f"the run ended before t = {end:g} s")
        moved = _moved(context, first, last - 1)
        message = ", ".join(f"{key} {value:.3f} {units[key]}" for key, value in moved.items())
        for key, (lower, upper) in wanted.items():
            result = at_least(name, moved[key], lower, units[key], message, when=None)
            if result.passed:
                result = at_most(name, moved[key], upper, units[key], message, when=None)
            if not result.passed:
                return result
        key = next(iter(wanted))
        return at_least(name, moved[key], wanted[key][0], units[key], message, when=None)


class ArrivedCheck:
    """max distance of the midpoint between the soles from the target over the last stretch, standing on both feet."""

    def __init__(self, config: settings.Arrived) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config = self.config
        target = config.target or next(reversed(context.facts.go_targets), None)
        if target is None:
            return failed(name, config.tolerance, "m", "the scenario has no go task and the check no target")
        last = slice(-context.ticks(config.duration), None)
        distance = np.linalg.norm(_midpoint(context)[last] - target, axis=1)  # (w,)
        when = first_time(context.time[last], ~(distance <= config.tolerance))
        message = f"from the target at most, in the last {config.duration:g} s"
        result = at_most(name, float(distance.max()), config.tolerance, "m", message, when=when)
        lifted = ~sole_loaded(context)[last].all(axis=1)
        leaning = ~(context.recorder.torso_up[last] >= config.min_torso_up)
        for violated, why in ((lifted, "a sole carries no load"), (leaning, "the torso is not upright")):
            when = first_time(context.time[last], violated)
            if when is not None:
                return CheckResult(name, False, result.value, result.threshold, "m", why, when)
        return result


class ClimbedCheck:
    """max over ticks of the height of the lower one of two loaded soles."""

    def __init__(self, config: settings.Climbed) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        wanted, top = self.config.min, context.facts.highest_ground
        if wanted is None:
            if top is None:
                return failed(name, 0.0, "m", "the world holds no higher ground and the check no height")
            wanted = top - LEVEL
        lower = context.recorder.sole_position[:, :, 2].min(axis=1)
        lower = np.where(sole_loaded(context).all(axis=1), lower, -np.inf)
        highest = int(np.argmax(lower))
        if not np.isfinite(lower[highest]):
            return failed(name, wanted, "m", "both soles were never loaded at the same time")
        message = f"both soles loaded, t = {context.time[highest]:.2f} s"
        return at_least(name, float(lower[highest]), wanted, "m", message, when=None)


class FootMovedCheck:
    """Distance of the sole's centre from the target at the end, the sole loaded and away from where it began."""

    def __init__(self, config: settings.FootMoved) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, side = self.config, SIDES.index(self.config.foot)
        targets = [target for foot, target in context.facts.step_targets if foot == side]
        target = config.target or next(reversed(targets), None)
        if target is None:
            return failed(
                name, config.tolerance, "m", "the scenario has no step task of this foot, the check no target"
            )
        sole = context.recorder.sole_position[:, side, :2]
        error, distance = (float(np.linalg.norm(sole[-1] - point)) for point in (target, sole[0]))
        message = f"{config.foot} sole {error:.3f} m from its target, {distance:.3f} m from where it began"
        end = float(context.time[-1])
        result = at_most(name, error, config.tolerance, "m", message, when=end)
        if not sole_loaded(context)[-1, side]:
            return CheckResult(name, False, error, config.tolerance, "m", f"{message}; it carries no load", end)
        if result.passed and config.min_distance > 0:
            moved = at_least(name, distance, config.min_distance, "m", message, when=end)
            return result if moved.passed else moved
        return result


def _midpoint(context: CheckContext) -> Vector:
    """(n, 2) [m] midpoint between the soles in world."""
    return np.asarray(context.recorder.sole_position[:, :, :2].mean(axis=1))


def _moved(context: CheckContext, first: int, last: int) -> dict[str, float]:
    """Displacement [m] forward and left of the heading at tick `first`, and turn [rad], until tick `last`."""
    corners = context.sole_corners[..., :2]  # (m, 2, 4, 2)
    ahead = corners[:, :, :2].mean(axis=2) - corners[:, :, 2:].mean(axis=2)  # (m, 2, 2) rear to front
    yaw = np.unwrap(np.arctan2(ahead[..., 1], ahead[..., 0]), axis=0)  # (m, 2)
    # The samples at or just before the two ticks: standing or slow, a sole turns little within one period.
    begin, end = np.searchsorted(context.sample_ticks, [first, last], side="right") - 1
    heading = math.atan2(np.sin(yaw[begin]).sum(), np.cos(yaw[begin]).sum())
    midpoint = _midpoint(context)
    x, y = midpoint[last] - midpoint[first]
    return {
        "forward": float(math.cos(heading) * x + math.sin(heading) * y),
        "left": float(-math.sin(heading) * x + math.cos(heading) * y),
        "turned": float(np.mean(yaw[end] - yaw[begin])),
    }
