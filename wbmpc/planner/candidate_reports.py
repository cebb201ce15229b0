"""What stage 3 made of every candidate, for the recording: its cost in parts, its margins, why it lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wbmpc.planner.contact_choice import Option
from wbmpc.planner.contact_force import Need, force_price, shift_bound, shift_rows
from wbmpc.planner.contact_stage import ChoosesContacts
from wbmpc.planner.settings import ContactSettings
from wbmpc.record import record
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, Vector

STRONG = 1e3  # [N] a cap that is none
ROUGH = 10.0  # a friction coefficient at which nothing slips


class Reach(NamedTuple):
    """How far a candidate is from being out of reach."""

    slack: float  # [m] negative: out of reach by that much
    limit: str  # what bounds it: a key of FALLS_SHORT


FALLS_SHORT = {
    "palm": "the palm falls short",
    "elbow": "the forearm would meet the surface",
    "obstacle": "the forearm would meet an obstacle",
    "CoM": "the CoM would leave the feet",
}


class CostParts(NamedTuple):
    """Stage 3's objective as a sum."""

    way: float  # Σ w_i H_i
    force: float
    shift: float


NO_COST = CostParts(np.nan, np.nan, np.nan)


@record
class Weighed:
    """One candidate beside those it would have as company."""

    cost: float  # of all of them, prices included; inf when they cannot give what is needed
    parts: CostParts
    forces: Vector  # (knots, 3) [N] of the candidate
    beside: tuple[Option, ...]
    hindrance: str  # why the cost is inf, "" when it is not


def weigh(
    choice: ChoosesContacts,
    need: Need,
    options: Sequence[Option],
    sets: Sequence[tuple[int, ...]],
    *,
    left: Vector,
    settings: ContactSettings,
    mass: float,
) -> list[Weighed]:
    """What each of the `sets` of options costs; the first member of each is the candidate that is weighed.

    Args:
        choice: stage 3's problem; `left` as in `ChoosesContacts.solve`.
        mass: [kg] as in the problem's own prices.
    """
    answers = choice.costs(need, options, sets, left=left)
    lost = [members for members, (cost, _) in zip(sets, answers, strict=True) if not np.isfinite(cost)]
    hindrances = dict(zip(lost, _hindrances(choice, need, options, lost, left=left), strict=True))
    weighed = []
    for members, (cost, forces) in zip(sets, answers, strict=True):
        chosen = [options[i] for i in members]
        finite = bool(np.isfinite(cost))
        parts = cost_parts(need, chosen, forces, settings=settings, mass=mass) if finite else NO_COST
        alone = forces[0] if finite else np.zeros_like(forces[0])
        weighed.append(Weighed(cost, parts, alone, tuple(chosen[1:]), hindrances.get(members, "")))
    return weighed


def cost_parts(
    need: Need, options: Sequence[Option], forces: Vector, *, settings: ContactSettings, mass: float
) -> CostParts:
    """The objective of `ContactChoice` for these options and their forces (options, knots, 3) [N], part by part."""
    way = sum(option.price for option in options if not option.held)
    force, missing = 0.0, -shift_bound(need)
    for option, wanted in zip(options, forces, strict=True):
        force += 0.5 * float(np.einsum("ki,ij,kj->", wanted, force_price(option.patch, settings, mass), wanted))
        missing = missing + np.einsum("kij,kj->ki", shift_rows(need, option.patch.position), wanted)
    shift = 0.5 * settings.shift_slack_cost / (mass * GRAVITY) ** 2 * float(np.sum(missing**2))
    return CostParts(way, force, shift)


def friction_margin(patch: PatchPose, forces: Vector) -> float:
    """Smallest μ f_n − |f_t| [N] of forces (n, 3) in world: how far they are from slipping."""
    normal = forces @ patch.normal
    tangential = np.linalg.norm(forces - normal[:, None] * patch.normal, axis=1)
    return float(np.min(patch.friction * normal - tangential))


def _hindrances(
    choice: ChoosesContacts, need: Need, options: Sequence[Option], sets: Sequence[tuple[int, ...]], *, left: Vector
) -> list[str]:
    """What keeps the first member of each set from giving what is needed: found by taking it away."""
    if not sets:
        return []
    firsts = {members[0] for members in sets}

    def possible(friction: float | None, cap: float | None) -> list[bool]:
        eased = [
            replace(option, patch=replace(option.patch, friction=friction or option.patch.friction,
                                          force_cap=cap or option.patch.force_cap))
            if i in firsts else option
            for i, option in enumerate(options)
        ]  # fmt: skip
        return [bool(np.isfinite(cost)) for cost, _ in choice.costs(need, eased, sets, left=left)]

    out = []
    asked = zip(sets, possible(None, STRONG), possible(ROUGH, None), possible(ROUGH, STRONG), strict=True)
    for members, by_cap, by_friction, by_both in asked:
        patch = options[members[0]].patch
        if by_cap:
            out.append(f"needs more than its {patch.force_cap:g} N")
        elif by_friction:
            out.append(f"would slip: needs a friction above {patch.friction:g}")
        elif by_both:
            out.append(f"needs more than its {patch.force_cap:g} N, and a friction above {patch.friction:g}")
        else:
            out.append("does not do beside the others" if len(members) > 1 else "no force on it gives the shift")
    return out
