"""The check of a reach: how close, for how long."""

from __future__ import annotations

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.hold import find_hold
from wbmpc.checks.result import CheckResult, at_most, failed
from wbmpc.signals import SIDES


class ReachCheck:
    """min over hands and windows of length `hold` of the largest |palm − target| in the window."""

    def __init__(self, config: settings.Reach) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        found = find_hold(context, self.config)
        if isinstance(found, str):
            return failed(name, self.config.max, "m", found)
        error, hand, window = found
        message = f"{SIDES[hand]} hand, held {self.config.hold:g} s from t = {context.time[window.start]:.2f} s"
        return at_most(name, error, self.config.max, "m", message, when=float(context.time[window.start]))
