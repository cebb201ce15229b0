"""Checks of who touches what: declared pairs only, no deep penetration, the wanted number of hand contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.posture import CONTACT_FORCE
from wbmpc.checks.result import CheckResult, at_least, at_most, first_time
from wbmpc.signals import SIDES, SolveStatus

EPISODE_GAP = 0.2  # [s] a palm that loses its contact for less has kept the same contact


class DeclaredContactsCheck:
    """Largest force of a contact that nobody declared: neither a foot on the world nor a chosen palm on its object."""

    def __init__(self, config: settings.DeclaredContacts) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        contacts, facts = context.recorder.contacts, context.facts
        robot_geom, other_geom, outside = context.contact_sides
        both_robot = facts.geom_is_robot[robot_geom] & facts.geom_is_robot[other_geom]
        foot_on_world = outside & (facts.geom_foot[robot_geom] >= 0)
        declared = ~(outside | both_robot) | foot_on_world | self._chosen_palm(context)
        force = np.linalg.norm(contacts.force, axis=1)  # (c,)
        undeclared = ~declared & ~(force <= self.config.min_force)
        if not undeclared.any():
            return at_most(name, 0.0, self.config.min_force, "N", "only declared pairs touched", when=None)
        pairs = {(int(a), int(b)) for a, b in zip(robot_geom[undeclared], other_geom[undeclared], strict=True)}
        named = sorted(f"{facts.geom_name[a]} – {facts.geom_name[b]}" for a, b in pairs)
        more = f" and {len(named) - 3} more" if len(named) > 3 else ""
        message = f"undeclared contact: {', '.join(named[:3])}{more}"
        when = first_time(context.contact_time, undeclared)
        return at_most(name, float(force[undeclared].max()), self.config.min_force, "N", message, when=when)

    def _chosen_palm(self, context: CheckContext) -> NDArray[np.bool_]:
        """(c,) contacts of a palm with the object of a patch that is, or within `release_time` was, chosen for it."""
        facts, ticks = context.facts, context.recorder.ticks
        robot_geom, other_geom, outside = context.contact_sides
        tick, palm = context.recorder.contact_tick, facts.geom_palm[robot_geom]
        grace = context.ticks(self.config.release_time)
        declared = np.zeros(tick.size, dtype=bool)
        for side in range(len(SIDES)):
            chosen = np.array([patches[side] for patches in context.patch_of_tick])  # (n,) names
            for patch in set(chosen.tolist()) - {""}:
                on_object = outside & (palm == side) & np.isin(other_geom, list(facts.patch_geoms[patch]))
                since = _ticks_since(chosen == patch, ticks)
                declared |= on_object & (since[tick] <= grace)
        return declared


def _ticks_since(active: NDArray[np.bool_], ticks: int) -> NDArray[np.int64]:
    """(n,) ticks since `active` (n,) was last true, 0 while it is; more than n before it ever was."""
    index = np.arange(ticks)
    last = np.maximum.accumulate(np.where(active, index, -ticks - 1))
    return index - last


class PenetrationCheck:
    """Deepest penetration over all contacts, the robot's and the objects'."""

    def __init__(self, config: settings.Penetration) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        depth = -context.recorder.contacts.distance  # (c,) [m]
        if depth.size == 0:
            return at_most(name, 0.0, self.config.max, "m", "nothing ever touched", when=None)
        worst = int(np.argmax(depth))
        a, b = context.recorder.contacts.geoms[worst]
        names = context.facts.geom_name
        message = f"deepest at {names[a]} – {names[b]}, t = {context.contact_time[worst]:.3f} s"
        when = first_time(context.contact_time, ~(depth <= self.config.max))
        return at_most(name, max(0.0, float(depth[worst])), self.config.max, "m", message, when=when)


class ContactPatchesCheck:
    """Number of hand contacts really made, and whether the planner chose only allowed patches.

    With `max_count: 0` stage 3 must never have fired either.
    """

    def __init__(self, config: settings.ContactPatches) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, starts = self.config, hand_contact_starts(context)
        chosen = sorted({patch for pair in context.patch_of_tick for patch in pair if patch})
        message = f"{len(starts)} hand contacts made; chosen: {', '.join(chosen) or 'none'}"
        fired = [plan.time for plan in context.recorder.plans if plan.stage3.status != SolveStatus.NOT_RUN]
        if config.max_count == 0 and (fired or chosen):
            when = fired[0] if fired else None
            return CheckResult(name, False, float(len(starts)), 0.0, "1", f"{message}; stage 3 fired", when)
        wrong = [patch for patch in chosen if config.allowed is not None and patch not in config.allowed]
        if wrong:
            when = first_time(context.time, [bool(set(pair) & set(wrong)) for pair in context.patch_of_tick])
            message = f"{message}; not allowed: {', '.join(wrong)}"
            return CheckResult(name, False, float(len(starts)), float(config.min_count), "1", message, when)
        if config.max_count is not None and len(starts) >= config.min_count:
            when = starts[config.max_count] if len(starts) > config.max_count else None
            return at_most(name, float(len(starts)), float(config.max_count), "1", message, when=when)
        return at_least(name, float(len(starts)), float(config.min_count), "1", message, when=None)


def hand_contact_starts(context: CheckContext) -> list[float]:
    """Times [s] at which a palm began to push on something, in order; short losses do not start a new contact."""
    starts: list[float] = []
    gap = context.ticks(EPISODE_GAP)
    for side in range(len(SIDES)):
        touching = np.linalg.norm(context.palm_force[:, side], axis=1) > CONTACT_FORCE  # (n,)
        before = np.concatenate([[context.recorder.ticks + 1], 1 + _ticks_since(touching, context.recorder.ticks)[:-1]])
        starts += context.time[touching & (before > gap)].tolist()
    return sorted(starts)
