"""The check that the solvers solve."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most, first_time
from wbmpc.signals import SolveStatus


class SolverFailuresCheck:
    """The larger of two shares: tracker ticks that fell back, and planner stages that failed, each of those that ran.

    That no candidate contact is feasible is an answer of stage 3, not a failure of its solver.
    """

    def __init__(self, config: settings.SolverFailures) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        recorder = context.recorder
        fallback = recorder.command_fallback | (recorder.command_status != SolveStatus.SOLVED)  # (n,)
        ran = failures = 0
        failure_times: list[float] = []
        for plan in recorder.plans:
            bad = (
                (plan.stage1.status, plan.stage1.status != SolveStatus.SOLVED),
                (plan.stage2.status, plan.stage2.status != SolveStatus.SOLVED),
                (plan.stage3.status, plan.stage3.status not in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE)),
            )
            for status, is_failure in bad:
                if status != SolveStatus.NOT_RUN:
                    ran += 1
                    failures += is_failure
                    failure_times += [plan.time] * is_failure
        shares = [float(np.mean(fallback)), failures / ran if ran else 0.0]
        ticks = f"tracker: {int(fallback.sum())} of {fallback.size} ticks fell back"
        message = f"{ticks}; planner: {failures} of {ran} stages failed"
        times = [t for t in (first_time(context.time, fallback), *failure_times[:1]) if t is not None]
        return at_most(name, max(shares), self.config.max, "1", message, when=min(times, default=None))
