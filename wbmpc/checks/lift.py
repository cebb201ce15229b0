"""Checks of a lift: the box is up and held by the palms alone, and the CoM height went with the hands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.blocks import lengths
from wbmpc.checks.context import TOUCH, CheckContext, LiftedObject
from wbmpc.checks.result import CheckResult, at_least, at_most, failed, first_time
from wbmpc.signals import Vector

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


class LiftedCheck:
    """min over the last stretch of the rise of the box's lowest corner, in which nothing but palms touches it."""

    def __init__(self, config: settings.Lifted) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, things = self.config, context.facts.lifted_objects
        if not things:
            return failed(name, config.min, "m", "the world holds no box that is to be lifted")
        width = min(context.ticks(config.duration) + 1, context.recorder.ticks)
        last = np.arange(context.recorder.ticks - width, context.recorder.ticks)
        thing = things[0]
        lowest, tilt = _lowest_and_tilt(thing, context.recorder.qpos[np.append(0, last)])
        rise = lowest[1:] - lowest[0]
        message = f"{thing.name} tilted by at most {tilt[1:].max():.2f} rad in the last {config.duration:g} s"
        when = first_time(context.time[last], ~(rise >= config.min))
        result = at_least(name, float(rise.min()), config.min, "m", message, when=when)
        held = _held_by_palms_alone(context, thing)[last]
        for violated, what in (
            (~(tilt[1:] <= config.max_tilt), f"tilted by more than {config.max_tilt:g} rad"),
            (~held, "not held by both palms and nothing else"),
        ):
            if result.passed and violated.any():
                when = first_time(context.time[last], violated)
                return CheckResult(name, False, result.value, config.min, "m", f"{thing.name} {what}", when)
        return result


def _lowest_and_tilt(thing: LiftedObject, qpos: Vector) -> tuple[Vector, Vector]:
    """Height (n,) [m] of the lowest corner and angle (n,) [rad] to the vertical, from qpos (n, nq)."""
    position, w, x, y, z = qpos[:, thing.qpos : thing.qpos + 3], *qpos[:, thing.qpos + 3 : thing.qpos + 7].T
    third_row = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])  # of the rotation
    lowest = position[:, 2] + (third_row @ (CORNERS * thing.half).T).min(axis=1)
    return lowest, np.arccos(np.clip(third_row[:, 2], -1.0, 1.0))


def _held_by_palms_alone(context: CheckContext, thing: LiftedObject) -> NDArray[np.bool_]:
    """(n,) whether both palms touch the object, and nothing else does."""
    facts, recorder = context.facts, context.recorder
    geoms = recorder.contacts.geoms
    first, second = (np.isin(geoms[:, column], list(thing.geoms)) for column in (0, 1))
    other = np.where(first, geoms[:, 1], geoms[:, 0])
    touching = (first | second) & (lengths(recorder.contacts.force) > TOUCH)
    palms = np.zeros((recorder.ticks, 2), dtype=bool)
    foreign = np.zeros(recorder.ticks, dtype=bool)
    tick, palm = recorder.contact_tick, facts.geom_palm[other]
    palms[tick[touching & (palm >= 0)], palm[touching & (palm >= 0)]] = True
    foreign[tick[touching & (palm < 0)]] = True
    return palms.all(axis=1) & ~foreign


class ComDropCheck:
    """Height of the CoM at the start less its smallest."""

    def __init__(self, config: settings.ComDrop) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        height = context.recorder.com[:, 2]
        lowest = int(np.argmin(height))
        message = f"lowest at {height[lowest]:.3f} m, t = {context.time[lowest]:.2f} s"
        return at_least(name, float(height[0] - height[lowest]), self.config.min, "m", message, when=None)


class ComInBandCheck:
    """max over ticks of the distance of the CoM height from the band of the newest plan's first knot."""

    def __init__(self, config: settings.ComInBand) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        plans, which = context.recorder.plans, context.plan_of_tick
        if not plans or not (which >= 0).any():
            return failed(name, self.config.tolerance, "m", "there is no plan")
        band = np.array([plan.com_height_band[0] for plan in plans])[which]
        height = context.recorder.com[:, 2]
        outside = np.where(which >= 0, np.maximum(band[:, 0] - height, height - band[:, 1]), 0.0)
        worst = int(np.argmax(outside))
        message = f"band {band[worst, 0]:.3f} to {band[worst, 1]:.3f} m, CoM at {height[worst]:.3f} m"
        when = first_time(context.time, ~(outside <= self.config.tolerance))
        return at_most(name, max(0.0, float(outside[worst])), self.config.tolerance, "m", message, when=when)
