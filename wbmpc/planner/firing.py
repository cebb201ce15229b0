"""One firing of stage 3: the knots it is asked about, the question with and without a reserve, and its record."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.candidates import Candidate, Candidates
from wbmpc.planner.contact_choice import Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.support import SupportPolygon
from wbmpc.record import record
from wbmpc.signals import SIDES, Firing, StageReport, Vector

RESERVE = 0.012  # [m] of the feet's pressure inside its polygon that a contact should leave, if any does


@record
class Asked:
    """The knots that a choice is made for."""

    need: Need  # of KNOTS knots
    after: Vector  # (KNOTS,) [s] from now; inf: where the running task ends


def worst_knots(need: Need, goal: Need | None, *, times: Vector, threshold: float) -> Asked:
    """Two knots: the largest shift in the horizon, and the task's end (`goal`, of one knot) or the largest sideways.

    At the first sign of need the horizon shows a few millimetres; the contact must also do for where this leads.
    `times` (N,): of the knots of `need` [s from now]; a goal that asks for less than `threshold` [m] is none.
    """
    sizes = np.abs(need.delta_z)
    worst = int(np.argmax(sizes.max(axis=1)))
    if goal is not None and np.abs(goal.delta_z).max() > threshold:
        return Asked(need.pick([worst]).followed_by(goal), np.array([times[worst], np.inf]))
    picked = [worst, int(np.argmax(sizes[:, 1]))]
    return Asked(need.pick(picked), times[picked])


def fire(
    candidates: Candidates,
    asked: Asked,
    *,
    time: float,
    palms: Vector,
    engaged: list[str],
    held: list[Option],
    polygon: SupportPolygon,
    urgency: float,
    events: list[str],
) -> tuple[list[Candidate], Firing, StageReport]:
    """Stage 3's choice of what joins the contacts that are `held`: with a reserve, or else without.

    Args:
        time: now [s].
        palms, engaged, polygon, urgency: see `Candidates.choose`.
    """
    for reserve in (RESERVE, 0.0):
        winners, reports, stage = candidates.choose(
            asked.need.inset(reserve) if reserve else asked.need,
            palms=palms,
            engaged=engaged,
            held=held,
            polygon=polygon,
            urgency=urgency,
        )
        if winners:
            break
    need = asked.need
    chosen = " and ".join(f"{w.patch.name} for the {SIDES[w.hand]} hand" for w in winners)
    beside = f" beside {' and '.join(option.patch.name for option in held)}" if held else ""
    outcome = f"chose {chosen}" if chosen else "no candidate helps"
    events.append(f"stage 3 fired: |ΔZ| {_sizes(asked)}{beside}, {outcome}")
    names = tuple(f"{option.patch.name} ({SIDES[option.hand]} hand)" for option in held)
    return winners, Firing(time + asked.after, need.delta_z, need.zmp, reserve, names, reports), stage


def _sizes(asked: Asked) -> str:
    """How large the shift is at each knot, and when."""
    sizes = 1e3 * np.abs(asked.need.delta_z).max(axis=1)
    whens = ("at the task's end" if np.isinf(after) else f"in {after:.1f} s" for after in asked.after)
    return " and ".join(f"{size:.1f} mm {when}" for size, when in zip(sizes, whens, strict=True))
