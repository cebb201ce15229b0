"""Checks of the servos: torque and speed."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most, first_time
from wbmpc.signals import Vector


def _worst_joint(name: str, ratio: Vector, context: CheckContext, *, threshold: float, what: str) -> CheckResult:
    """Compare the largest entry of `ratio` (n, nj) with the threshold and name its joint and time."""
    tick, joint = np.unravel_index(np.argmax(ratio), ratio.shape)  # argmax returns a nan when there is one
    when = first_time(context.time, ~(ratio <= threshold * (1 + 1e-9)).all(axis=1))
    message = f"{what} at {context.facts.joint_name[joint]}, t = {context.time[tick]:.3f} s"
    return at_most(name, float(ratio[tick, joint]), threshold, "1", message, when=when)


class TorqueLimitCheck:
    """max over ticks and joints of |τ| / τ_max(q̇), τ_max on the servo's torque-speed line."""

    def __init__(self, config: settings.TorqueLimit) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        # At the no-load speed the limit is zero: a floor of a millionth of the stall torque keeps 0/0 at zero.
        limit = np.maximum(context.recorder.torque_limit, 1e-6 * context.facts.stall_torque)
        ratio = np.divide(np.abs(context.recorder.torque), limit, out=limit)  # (n, nj)
        return _worst_joint(name, ratio, context, threshold=self.config.max, what="largest share of the limit")


class SpeedLimitCheck:
    """max over ticks and joints of |q̇| / no-load speed."""

    def __init__(self, config: settings.SpeedLimit) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        joints = context.facts.no_load_speed.size  # after them come the loose objects of the world
        ratio = np.abs(context.recorder.qvel[:, 6 : 6 + joints])  # (n, nj)
        ratio /= context.facts.no_load_speed
        return _worst_joint(name, ratio, context, threshold=self.config.max, what="largest share of no-load speed")


class TorquePeakCheck:
    """max over ticks and joints of |τ| / stall torque."""

    def __init__(self, config: settings.TorquePeak) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        ratio = np.abs(context.recorder.torque)  # (n, nj)
        ratio /= context.facts.stall_torque
        return _worst_joint(name, ratio, context, threshold=self.config.max, what="largest share of stall torque")
