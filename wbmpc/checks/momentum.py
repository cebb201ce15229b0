"""The check that no hidden support exists."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most, failed, first_time
from wbmpc.signals import GRAVITY


class MomentumBalanceCheck:
    """Impulse-momentum balance of the CoM over windows of W ticks of length h.

    For every start tick k:  r_k = m (ċ_{k+W} − ċ_k) − h Σ_{i=k}^{k+W−1} (Σ f_i + f_ext,i − m g e_z),
    value = max_k |r_k| / (m g W h). The forces of tick i act during [t_i, t_i + h].
    """

    def __init__(self, config: settings.MomentumBalance) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        width = context.ticks(self.config.window)
        if context.recorder.ticks <= width:
            return failed(name, self.config.max, "1", "the run is shorter than one window")
        step, mass = context.facts.timestep, context.facts.mass
        force = context.world_force + context.recorder.external_force  # (n, 3)
        force[:, 2] -= mass * GRAVITY
        impulse = np.vstack([np.zeros(3), np.cumsum(force, axis=0) * step])  # (n + 1, 3)
        momentum = mass * context.recorder.com_velocity  # (n, 3)
        change = momentum[width:] - momentum[:-width]  # (n - W, 3)
        missing = np.linalg.norm(change - (impulse[width:-1] - impulse[: -width - 1]), axis=1)
        ratio = missing / (mass * GRAVITY * width * step)
        worst = int(np.argmax(ratio))
        message = f"largest unexplained impulse in the {width * step * 1e3:.0f} ms from t = {context.time[worst]:.3f} s"
        when = first_time(context.time, ~(ratio <= self.config.max))
        return at_most(name, float(ratio[worst]), self.config.max, "1", message, when=when)
