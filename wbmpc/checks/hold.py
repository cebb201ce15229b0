"""The stretch of time that the checks of a hold judge."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.blocks import by_blocks
from wbmpc.checks.context import SAMPLE_PERIOD, CheckContext
from wbmpc.checks.support import com_outside
from wbmpc.signals import Vector


def palm_error(context: CheckContext, target: tuple[float, float, float] | None) -> Vector:
    """(n, 2) [m] distance of each palm from the target, the scenario's (nearest, if there are several) by default."""
    targets = context.facts.reach_targets if target is None else (np.array(target),)
    palms = context.recorder.palm_position  # (n, 2, 3)

    def nearest(rows: Vector) -> Vector:
        return np.min([np.linalg.norm(rows - point, axis=2) for point in targets], axis=0)

    return by_blocks(nearest, palms)


def best_hold(error: Vector, width: int) -> tuple[float, int, slice]:
    """The window of `width` ticks, and the hand, with the smallest largest error.

    Args:
        error: (n, 2) with n >= width.

    Returns:
        Largest error in the window, side index of the hand, and the window's ticks.
    """
    largest, covered = error, 1  # entry k is the largest of ticks k .. k + covered - 1
    while covered < width:
        further = min(covered, width - covered)
        largest = np.maximum(largest[:-further], largest[further:])
        covered += further
    largest = np.where(np.isfinite(largest), largest, np.inf)
    start, hand = np.unravel_index(np.argmin(largest), largest.shape)
    return float(largest[start, hand]), int(hand), slice(int(start), int(start) + width)


def find_hold(context: CheckContext, config: settings.HoldSettings) -> tuple[float, int, slice] | str:
    """`best_hold` of the palms' errors, or the reason why there is none."""
    width = context.ticks(config.hold) + 1  # fence posts: `hold` seconds have one tick more than steps
    if config.target is None and not context.facts.reach_targets:
        return "the scenario has no reach task and the check no target"
    if context.recorder.ticks < width:
        return f"the run is shorter than the hold of {config.hold:g} s"
    return best_hold(palm_error(context, config.target), width)


def find_hold_of_body(context: CheckContext, config: settings.HoldSettings) -> slice | str:
    """The ticks of the hold: those of the reach, or without one those in which the CoM is farthest outside the feet."""
    if config.target is not None or context.facts.reach_targets:
        found = find_hold(context, config)
        return found if isinstance(found, str) else found[2]
    steps, period = context.ticks(config.hold), context.ticks(SAMPLE_PERIOD)
    width = -(-steps // period) + 1  # samples that span the hold
    if len(context.sample_ticks) < width:
        return f"the run is shorter than the hold of {config.hold:g} s"
    outside = com_outside(context, context.sole_touching[context.sample_ticks])
    start = best_hold(-outside[:, None], width)[2].start * period
    return slice(start, start + steps + 1)
