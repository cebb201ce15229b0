"""Footsteps as the plant saw them, and the check that there were enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_least
from wbmpc.checks.stretches import stretches
from wbmpc.signals import SIDES

FLIGHT_TIME = 0.1  # [s] a sole that loses its contact for less has not been lifted
LOAD_SHARE = 0.1  # of body weight, from which on a sole is loaded


@dataclass(frozen=True, slots=True)
class Footstep:
    """One flight of a foot from stance to stance."""

    side: int
    lift_off: int  # first tick of the flight
    touch_down: int  # first tick after it
    length: float  # [m] horizontal displacement of the sole's centre from one stance to the next


def sole_loaded(context: CheckContext) -> NDArray[np.bool_]:
    """(n, 2) whether each sole carries load."""
    loaded: NDArray[np.bool_] = context.sole_force[:, :, 2] >= LOAD_SHARE * context.body_weight
    return loaded


def footsteps(context: CheckContext) -> list[Footstep]:
    """All footsteps in the order in which they landed.

    A touch in passing that never takes load does not end a flight; a foot that starts in the air makes no step.
    """
    touching, loaded = context.sole_touching, sole_loaded(context)
    steps = [
        step for side in range(len(SIDES)) for step in _footsteps_of(context, side, touching[:, side], loaded[:, side])
    ]
    return sorted(steps, key=lambda step: step.touch_down)


def _footsteps_of(
    context: CheckContext, side: int, touching: NDArray[np.bool_], loaded: NDArray[np.bool_]
) -> list[Footstep]:
    flights = [(a, b) for a, b in stretches(~touching) if b - a >= context.ticks(FLIGHT_TIME)]
    sole = context.recorder.sole_position[:, side, :2]
    loads = np.flatnonzero(loaded)  # ticks
    steps: list[Footstep] = []
    lift_off: int | None = None
    for index, (start, stop) in enumerate(flights):
        lift_off = start if lift_off is None else lift_off
        until = flights[index + 1][0] if index + 1 < len(flights) else len(touching)
        before, landing = loads[loads < lift_off], loads[(loads >= stop) & (loads < until)]
        if before.size and landing.size:
            length = float(np.linalg.norm(sole[landing[0]] - sole[before[-1]]))
            steps.append(Footstep(side, lift_off, stop, length))
        if landing.size:
            lift_off = None
    return steps


class FootstepsCheck:
    """Number of footsteps of the chosen foot that landed in the window and were long enough."""

    def __init__(self, config: settings.Footsteps) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config = self.config
        first, last = config.window or (0.0, np.inf)
        landed = [
            step
            for step in footsteps(context)
            if config.foot in ("any", SIDES[step.side]) and first <= context.time[step.touch_down] <= last
        ]
        counted = [step for step in landed if step.length >= config.min_length]
        lengths = [step.length for step in landed]
        message = f"{len(counted)} of {len(landed)} landings count"
        if lengths:
            message += f", {min(lengths):.3f} to {max(lengths):.3f} m long, {np.mean(lengths):.3f} m on average"
        return at_least(name, float(len(counted)), float(config.min_count), "1", message, when=None)
