"""The check that a push was real and was recovered from."""

from __future__ import annotations

import math

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most, failed
from wbmpc.checks.stretches import stretches
from wbmpc.signals import Vector


class PushRecoveryCheck:
    """max over pushes of the time from a push's end until the CoM stays slow, up to the next push or the end.

    Every stretch of ticks with a declared external force is one push; its impulse is |Σ f_ext h|. Only the speed
    counts: the robot may have stepped away from where it was pushed.
    """

    def __init__(self, config: settings.PushRecovery) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, force = self.config, context.recorder.external_force
        pushes = stretches(np.linalg.norm(force, axis=1) > 0.0)
        if not pushes:
            return failed(name, config.max_time, "s", "no push ever acted")
        step, mass = context.facts.timestep, context.facts.mass
        impulses = [float(np.linalg.norm(force[a:b].sum(axis=0)) * step / mass) for a, b in pushes]
        listed = ", ".join(f"{impulse:.3f}" for impulse in impulses)
        if min(impulses) < config.min_impulse * (1 - 1e-9):
            message = f"pushes of {listed} N·s/kg, at least {config.min_impulse:g} wanted"
            return failed(name, config.max_time, "s", message)
        speed = np.linalg.norm(context.recorder.com_velocity, axis=1)  # (n,)
        ends = [start for start, _ in pushes[1:]] + [context.recorder.ticks]
        times = [_settling(speed[b:end], config.max_com_speed) * step for (_, b), end in zip(pushes, ends, strict=True)]
        worst = int(np.argmax(times))
        after = float(context.time[pushes[worst][1] - 1])
        recovered = ", ".join(f"{time:.2f}" for time in times)
        message = f"pushes of {listed} N·s/kg; recovered in {recovered} s; slowest after t = {after:.3f} s"
        return at_most(name, times[worst], config.max_time, "s", message, when=after)


def _settling(speed: Vector, bound: float) -> float:
    """Number of ticks until `speed` (k,) stays at or below the bound; inf when it does not at the last."""
    fast = np.flatnonzero(~(speed <= bound))
    if fast.size == 0:
        return 0.0
    return math.inf if fast[-1] == speed.size - 1 else float(fast[-1] + 1)
