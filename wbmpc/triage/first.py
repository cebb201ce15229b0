"""The first cause of a failed run: which of all that went wrong could have brought it about.

A fall drags everything else along: soles slide, servos saturate, limbs touch. What begins after the point of no return
is its consequence. Before it, the earliest firm finding that was not over long since is the cause; findings that runs
also pass with (a mild push, plans a little late) only where there is no firm one. A run that did not fall failed by
what an always-on check saw first, or by its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult
from wbmpc.scenario import Scenario, resolve_patches
from wbmpc.signals import SIDES
from wbmpc.triage.balance import point_of_no_return, time_down
from wbmpc.triage.causes import Cause, Finding, Triage
from wbmpc.triage.controller import late_plans, non_finite, stage_infeasible
from wbmpc.triage.limits import joint_limits, out_of_reach, saturations
from wbmpc.triage.pushes import pushes
from wbmpc.triage.touch import collisions, contacts_not_made, ground_not_met, slips

SLACK = 0.03  # [s] by which a cause may be noticed after its effect
OVER = 2.0  # [s] after which a robot that did not fall has got over something
_EVENTS = ("declared_contacts", "penetration", "torque_limit", "speed_limit", "momentum_balance")  # fail by one tick


@dataclass(frozen=True, slots=True)
class Evidence:
    """A finished run: of a recorder, or of a recording at its own rate."""

    context: CheckContext
    scenario: Scenario  # as run
    model: Any  # compiled MjModel of robot and world


@dataclass(frozen=True, slots=True)
class Fall:
    """How a robot fell."""

    lost: float  # [s] from when on nothing that carried it then could have saved it
    down: float  # [s]
    awaited: bool  # whether a hand was on its way to a contact, which might still have caught it


def triage(evidence: Evidence, checks: Sequence[CheckResult]) -> Triage | None:
    """The first cause of a run's failure; None when every check passed, or when the run has no tick."""
    failing = [check for check in checks if not check.passed]
    if not failing or evidence.context.recorder.ticks == 0:
        return None
    found = sorted(findings(evidence), key=lambda finding: finding.start)
    fall = _fall(evidence)
    events = [c.first_violation for c in failing if c.name in _EVENTS and c.first_violation is not None]
    cause = first_of(found, fall, min(events, default=np.inf))
    if fall is None or (cause is not None and cause.cause is Cause.NON_FINITE):
        return _answer(evidence, cause or _not_reached(evidence, failing), found)
    if cause is None:
        what = "the capture point leaves the feet and hands that carry the robot, and nothing else went wrong before"
        cause = Finding(Cause.BALANCE_LOST, fall.lost, fall.down, what)
    before = [finding for finding in found if finding.start <= fall.down]  # of a robot that lies there is no end
    return _answer(evidence, cause, before, f"; past saving at {fall.lost:.2f} s, down at {fall.down:.2f} s")


def first_of(found: Sequence[Finding], fall: Fall | None, violated: float) -> Finding | None:
    """Which of the findings, in order of time, came first and could have brought the failure about; None: none could.

    Args:
        fall: None when the robot did not fall.
        violated: [s] when an always-on check that one tick can fail was first violated; inf: never.
    """
    for finding in found:
        if finding.cause is Cause.NON_FINITE:
            return finding
    if fall is None:
        able = [finding for finding in found if finding.start <= violated + SLACK]
    else:
        latest = {Cause.CONTACT_NOT_MADE: fall.down if fall.awaited else fall.lost}
        able = [f for f in found if f.start <= latest.get(f.cause, fall.lost) + SLACK and f.end >= fall.lost - OVER]
    firm = [finding for finding in able if finding.firm] or able
    missing = [finding for finding in firm if finding.cause is Cause.CONTACT_NOT_MADE]
    if firm and firm[0].cause is Cause.PUSH and missing:
        return missing[0]  # which was to catch the push
    return firm[0] if firm else None


def _fall(evidence: Evidence) -> Fall | None:
    context = evidence.context
    down = time_down(context, evidence.scenario.universal.no_fall)
    if down is None:
        return None
    lost = point_of_no_return(context, down)
    return Fall(lost, down, any(context.patch_of_tick[int(np.searchsorted(context.time, lost))]))


def findings(evidence: Evidence) -> list[Finding]:
    """Everything that every detector finds, causes and consequences alike."""
    context, scenario, model = evidence.context, evidence.scenario, evidence.model
    loop, planner = scenario.loop, scenario.planner
    reach = out_of_reach(context, model)
    # The joints of a straight arm are at their ends because of where the target is, not the other way round.
    held = [reach[0]] if reach and reach[1] else joint_limits(context, model)
    palm_radius = float(model.geom(f"{SIDES[0]}_palm_geom").size[0])
    return [
        *non_finite(context),
        *late_plans(context, period=loop.planner_period_ticks * loop.timestep, knot=planner.horizon_step),
        *stage_infeasible(context),
        *contacts_not_made(context, resolve_patches(scenario), palm_radius),
        *ground_not_met(context),
        *collisions(context, scenario.universal.declared_contacts),
        *slips(context, model),
        *saturations(context, scenario.tracker.torque_share),
        *held,
        *pushes(context),
    ]


def _not_reached(evidence: Evidence, failing: Sequence[CheckResult]) -> Finding:
    """Nothing broke: what was asked for was not reached; the check that was violated first says it."""
    if (reach := out_of_reach(evidence.context, evidence.model)) is not None:
        return reach[0]
    end = float(evidence.context.time[-1])
    times = [end if check.first_violation is None else check.first_violation for check in failing]
    time, check = min(zip(times, failing, strict=True), key=lambda pair: pair[0])
    unit = "" if check.unit == "1" else f" {check.unit}"
    value = f"{check.value:.4g}{unit} against {check.threshold:.4g}{unit}"
    what = f"nothing broke, and {check.name} is not met, {value}: {check.message}"
    return Finding(Cause.UNREACHABLE, time, np.inf, what)


def _switched_off(scenario: Scenario) -> str:
    """Stages that this scenario does without: what they would have done is not done."""
    stages = {"1": scenario.planner.height.enabled, "3": scenario.planner.contact_stage}
    return "".join(f"; stage {stage} is off" for stage, on in stages.items() if not on)


def _answer(evidence: Evidence, cause: Finding, found: Sequence[Finding], after: str = "") -> Triage:
    everything = sorted({*found, cause}, key=lambda finding: finding.start)
    message = cause.what + _switched_off(evidence.scenario) + after
    return Triage(cause.cause, cause.start, message, everything)
