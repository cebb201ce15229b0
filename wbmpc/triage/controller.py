"""What the controller itself reports: solves that failed, plans that came late, a state that is no state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wbmpc.checks.blocks import finite
from wbmpc.checks.context import CheckContext
from wbmpc.checks.stretches import joined
from wbmpc.signals import ContactPhase, SolveStatus
from wbmpc.triage.causes import Cause, Finding

IMPOSSIBLE_SPEED = 1e3  # [rad/s, m/s] no robot moves so fast
SHORTEST = 0.05  # [s] shorter stretches of failed solves are bridged by the last solution
HELPLESS = 1.0  # [s] of stage 3 without an answer; within it a hand may come free
NOMINAL_AGE = 3  # planner periods: a delay of one, a plan in use for another, and one to spare


def non_finite(context: CheckContext) -> Iterator[Finding]:
    """The state became no number, or grew so fast that the loop ended the run."""
    recorder = context.recorder
    number = finite(recorder.qpos, recorder.qvel, recorder.torque, recorder.com)
    ended = [event.time for event in recorder.events if event.text.startswith("state is not finite")]
    if number.all() and not ended:
        return
    fast = ~(np.abs(np.nan_to_num(recorder.qvel, nan=np.inf)).max(axis=1) < IMPOSSIBLE_SPEED)
    wild = np.flatnonzero(fast | ~number)
    time = float(context.time[wild[0]]) if wild.size else ended[0]
    pushed = np.linalg.norm(recorder.external_force[np.searchsorted(context.time, time - 0.01) :], axis=1).max(
        initial=0
    )
    under = f", under a disturbance of {pushed:.3g} N" if pushed else ""
    yield Finding(Cause.NON_FINITE, time, np.inf, f"positions or velocities stopped being those of a robot{under}")


def stage_infeasible(context: CheckContext) -> Iterator[Finding]:
    """A stage of the planner, or the tracker's QP, without a solution; stage 3 without any contact that helps."""
    recorder, plans = context.recorder, context.recorder.plans
    times = np.array([plan.time for plan in plans])
    for stage in ("stage1", "stage2"):
        status = np.array([getattr(plan, stage).status for plan in plans])
        for first, stop in joined((status != SolveStatus.SOLVED) & (status != SolveStatus.NOT_RUN), 3):
            if (end := float(times[stop - 1])) - times[first] >= SHORTEST:
                word = SolveStatus(int(status[first])).name.lower().replace("_", " ")
                yield Finding(Cause.STAGE_INFEASIBLE, float(times[first]), end, f"stage {stage[-1]}: {word}")
    failed = recorder.command_fallback | (recorder.command_status != SolveStatus.SOLVED)
    for first, stop in joined(failed, context.ticks(0.02)):
        start, end = float(context.time[first]), float(context.time[stop - 1])
        if end - start >= SHORTEST:
            yield Finding(Cause.STAGE_INFEASIBLE, start, end, "the tracker's QP: no solution, the last torque goes on")
    yield from _no_contact_helps(context)


def _no_contact_helps(context: CheckContext) -> Iterator[Finding]:
    plans = context.recorder.plans
    fired = [plan for plan in plans if plan.stage3.status != SolveStatus.NOT_RUN]
    none = np.array([plan.stage3.status != SolveStatus.SOLVED and not _has_contact(plan) for plan in fired], bool)
    chosen = np.array([plan.time for plan in plans if _has_contact(plan)])
    for first, stop in joined(none, 1):
        start, end = fired[first].time, fired[stop - 1].time
        if end - start >= HELPLESS and not ((chosen >= start) & (chosen <= end + HELPLESS)).any():
            what = f"stage 3: no candidate contact helps, asked {stop - first} times"
            yield Finding(Cause.STAGE_INFEASIBLE, float(start), np.inf, what)


def _has_contact(plan) -> bool:  # type: ignore[no-untyped-def]  # a PlanReport, or what a recording keeps of one
    return bool((np.asarray(plan.contact_phase) >= ContactPhase.CHOSEN).any())


def late_plans(context: CheckContext, *, period: float, knot: float) -> Iterator[Finding]:
    """Stretches in which plans in use were too old; firm when older than a knot, from which on they hold still.

    Args:
        period: of the planner [s].
        knot: of the horizon [s]; feet, hands and joints of a plan go on for one, and then stop.
    """
    timing = context.recorder.timing
    if not timing.effects:
        return
    snapshot, effect = (np.array(ticks) * timing.timestep for ticks in (timing.snapshots, timing.effects))
    order = np.argsort(effect, kind="stable")
    snapshot, effect = snapshot[order], effect[order]
    # A plan is as old as it gets when the next one takes over; in between nothing newer was there.
    age = np.append(effect[1:], effect[-1] + period) - snapshot
    for first, stop in joined(age > NOMINAL_AGE * period + 1e-9, round(0.5 / period)):
        oldest = float(age[first:stop].max())
        what = (
            f"plans were {1e3 * oldest:.0f} ms old before the next took over; one is made every {1e3 * period:.0f} ms"
        )
        yield Finding(Cause.LATE_PLAN, float(effect[first]), float(effect[stop - 1]), what, firm=oldest > knot + period)
