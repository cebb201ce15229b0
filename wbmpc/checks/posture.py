"""Checks of how the robot stands: to the end, on its feet, at the wanted height."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.blocks import finite
from wbmpc.checks.context import CONTACT_FORCE, CheckContext
from wbmpc.checks.fall import down
from wbmpc.checks.result import CheckResult, at_least, at_most, failed, first_time


class CompletedCheck:
    """The run lasted its full duration and its state stayed finite."""

    def __init__(self, config: settings.Completed) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        recorder, duration = context.recorder, context.facts.duration
        state = (recorder.qpos, recorder.qvel, recorder.torque, recorder.com, recorder.com_velocity)
        broken = first_time(context.time, ~finite(*state))
        if broken is not None:
            return failed(name, duration, "s", f"non-finite state at t = {broken:.3f} s", when=broken)
        end = float(context.time[-1]) + context.facts.timestep  # tick k covers [t_k, t_k + h]
        reached = end >= duration - 0.5 * context.facts.timestep
        message = "ran to its end with a finite state" if reached else f"stopped at t = {end:.3f} s"
        return CheckResult(name, reached, end, duration, "s", message, None if reached else end)


class NoFallCheck:
    """min over ticks of the torso's cosine, and of the CoM height over the lower sole, each against its own bound.

    The value is the torso's cosine unless only the height is violated.
    """

    def __init__(self, config: settings.NoFall) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        recorder, config = context.recorder, self.config
        height = recorder.com[:, 2] - recorder.sole_position[:, :, 2].min(axis=1)  # (n,)
        low, tilted = (first_time(context.time, violated) for violated in down(recorder, config))
        message = f"torso's cosine at least {recorder.torso_up.min():.3f}, CoM height at least {height.min():.3f} m"
        if low is not None and (tilted is None or low < tilted):
            return at_least(name, float(height.min()), config.min_com_height, "m", message, when=low)
        return at_least(name, float(recorder.torso_up.min()), config.min_torso_up, "1", message, when=tilted)


class UprightAtEndCheck:
    """min of the torso's cosine over the last stretch, in which the CoM hardly moves."""

    def __init__(self, config: settings.UprightAtEnd) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        last = slice(-context.ticks(self.config.duration), None)
        torso_up = context.recorder.torso_up[last]
        speed = np.linalg.norm(context.recorder.com_velocity[last], axis=1)
        when = first_time(context.time[last], ~(torso_up >= self.config.min_torso_up))
        moving = first_time(context.time[last], ~(speed <= self.config.max_com_speed))
        message = f"CoM speed at most {speed.max():.3f} m/s in the last {self.config.duration:g} s"
        if when is None and moving is not None:
            message = f"{message}, allowed {self.config.max_com_speed:g} m/s"
            return at_most(name, float(speed.max()), self.config.max_com_speed, "m/s", message, when=moving)
        return at_least(name, float(torso_up.min()), self.config.min_torso_up, "1", message, when=when)


class WithdrawnCheck:
    """max distance of the CoM from its start over the last stretch, in which the torso is up and the hands are free."""

    def __init__(self, config: settings.Withdrawn) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        recorder, config = context.recorder, self.config
        last = slice(-context.ticks(config.duration), None)
        distance = np.linalg.norm(recorder.com[last] - recorder.com[0], axis=1)  # (w,)
        when = first_time(context.time[last], ~(distance <= config.com_tolerance))
        result = at_most(name, float(distance.max()), config.com_tolerance, "m", "CoM back at its start", when=when)
        touching = np.linalg.norm(context.palm_force[last], axis=2).max(axis=1) > CONTACT_FORCE  # (w,)
        leaning = ~(recorder.torso_up[last] >= config.min_torso_up)
        for violated, message in ((touching, "a hand is still in contact"), (leaning, "the torso is not upright")):
            when = first_time(context.time[last], violated)
            if when is not None:
                return CheckResult(name, False, result.value, result.threshold, "m", message, when)
        return result


class ComHeightCheck:
    """max over the waypoints of the smallest |c_z − wanted| within the window around the waypoint's time."""

    def __init__(self, config: settings.ComHeight) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        waypoints = context.facts.com_heights
        if not waypoints:
            return failed(name, self.config.max, "m", "the scenario has no com_height task")
        worst, worst_time = -1.0, 0.0
        for time, height in waypoints:
            near = np.abs(context.time - time) <= self.config.window + 0.5 * context.facts.timestep
            if not near.any():
                return failed(name, self.config.max, "m", f"the run ended before t = {time:g} s")
            error = float(np.min(np.abs(context.recorder.com[near, 2] - height)))
            if not error <= worst:  # keeps a nan
                worst, worst_time = error, time
        message = f"largest error of {len(waypoints)} waypoints, at t = {worst_time:g} s"
        return at_most(name, worst, self.config.max, "m", message, when=worst_time)
