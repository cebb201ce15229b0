"""Checks of the servos: torque and speed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.blocks import by_blocks
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most, first_time
from wbmpc.signals import Vector


def _worst_joint(
    name: str, ratio: Callable[..., Vector], *columns: Vector, context: CheckContext, threshold: float, what: str
) -> CheckResult:
    """Compare the largest ratio with the threshold and name its joint and time.

    Args:
        ratio: of rows of the `columns`, each (n, nj), the ratio by joint (n, nj).
    """
    worst = by_blocks(lambda *rows: ratio(*rows).max(axis=1), *columns)  # (n,) nan when there is one
    tick = int(np.argmax(worst))  # of the first nan when there is one
    joint = int(np.argmax(ratio(*(column[tick] for column in columns))))
    when = first_time(context.time, ~(worst <= threshold * (1 + 1e-9)))
    message = f"{what} at {context.facts.joint_name[joint]}, t = {context.time[tick]:.3f} s"
    return at_most(name, float(worst[tick]), threshold, "1", message, when=when)


class TorqueLimitCheck:
    """max over ticks and joints of |τ| / τ_max(q̇), τ_max on the servo's torque-speed line."""

    def __init__(self, config: settings.TorqueLimit) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        recorder, what = context.recorder, "largest share of the limit"
        # At the no-load speed the limit is zero: a floor of a millionth of the stall torque keeps 0/0 at zero.
        floor = 1e-6 * context.facts.stall_torque

        def ratio(torque: Vector, limit: Vector) -> Vector:
            return np.abs(torque) / np.maximum(limit, floor)

        both = (recorder.torque, recorder.torque_limit)
        return _worst_joint(name, ratio, *both, context=context, threshold=self.config.max, what=what)


class SpeedLimitCheck:
    """max over ticks and joints of |q̇| / no-load speed."""

    def __init__(self, config: settings.SpeedLimit) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        no_load, what = context.facts.no_load_speed, "largest share of no-load speed"
        speed = context.recorder.qvel[:, 6 : 6 + no_load.size]  # after them come the loose objects of the world
        ratio = partial(_share, whole=no_load)
        return _worst_joint(name, ratio, speed, context=context, threshold=self.config.max, what=what)


class TorquePeakCheck:
    """max over ticks and joints of |τ| / stall torque."""

    def __init__(self, config: settings.TorquePeak) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        torque, what = context.recorder.torque, "largest share of stall torque"
        ratio = partial(_share, whole=context.facts.stall_torque)
        return _worst_joint(name, ratio, torque, context=context, threshold=self.config.max, what=what)


def _share(value: Vector, whole: Vector) -> Vector:
    return np.abs(value) / whole
