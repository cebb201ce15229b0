"""Checks of the hand contacts that were made: how many, on which patches, in which order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.blocks import by_blocks, lengths
from wbmpc.checks.context import CONTACT_FORCE, CheckContext
from wbmpc.checks.result import CheckResult, at_least, at_most, first_time
from wbmpc.checks.stretches import joined
from wbmpc.signals import SIDES, SolveStatus, Vector

EPISODE_GAP = 0.3  # [s] a palm that loses its object for less has kept the same contact
LOAD_FORCE, LOAD_TIME = 0.5, 0.1  # [N], [s] a contact that pushed so hard for so long has carried load
RELEASED_FOR = 0.1  # [s] without a touch at the end of the run, so that a bounce is no release


@dataclass(frozen=True, slots=True)
class HandContact:
    """A stretch of time in which one palm touches, its short losses included."""

    side: int
    start: int  # first tick
    stop: int  # one after the last tick


class ContactPatchesCheck:
    """Number of hand contacts really made, and whether the planner chose only allowed patches.

    With `max_count: 0` stage 3 must never have fired either.
    """

    def __init__(self, config: settings.ContactPatches) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, starts = self.config, [float(context.time[contact.start]) for contact in hand_contacts(context)]
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


class ContactSequenceCheck:
    """Number of hand contacts that carried load on the patch chosen for the hand, in the order in which they began."""

    def __init__(self, config: settings.ContactSequence) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        config, sequence = self.config, _sequence(context)
        count, wanted = float(len(sequence)), float(config.min_contacts)
        listed = ", ".join(f"{SIDES[contact.side]} {patch}" for patch, contact in sequence)
        message = f"hand contacts under load: {listed or 'none'}"
        for (patch_before, before), (patch, contact) in pairwise(sequence):
            when = float(context.time[contact.start])
            for broken, why in (
                (patch == patch_before, "one patch twice in a row"),
                (config.hands_alternate and contact.side == before.side, "one hand twice in a row"),
            ):
                if broken:
                    return CheckResult(name, False, count, wanted, "1", f"{message}; {why}", when)
        last = slice(-context.ticks(RELEASED_FOR), None)
        held = np.linalg.norm(context.palm_force[last], axis=2).max(axis=1) > CONTACT_FORCE  # (w,)
        if config.released and held.any():
            message = f"{message}; a hand is still in contact at the end"
            return CheckResult(name, False, count, wanted, "1", message, first_time(context.time[last], held))
        return at_least(name, count, wanted, "1", message, when=None)


def hand_contacts(context: CheckContext) -> list[HandContact]:
    """Contacts of a palm with one object after another in the order in which they began."""
    rows, palm, other_geom = _on_palms(context)
    contacts = []
    for side in range(len(SIDES)):
        for geom in np.unique(other_geom[palm == side]):
            touching = _force(context, rows[(palm == side) & (other_geom == geom)]) > CONTACT_FORCE
            contacts += [HandContact(side, *span) for span in joined(touching, context.ticks(EPISODE_GAP))]
    return sorted(contacts, key=lambda contact: contact.start)


def _sequence(context: CheckContext) -> list[tuple[str, HandContact]]:
    """Patch and contact of each hand contact under load, in order of time.

    A hand that comes back to the patch of the latest contact, its own, goes on with that contact.
    """
    (rows, palm, other_geom), (names, code) = _on_palms(context), context.patch_codes
    found = []
    for index, patch in enumerate(names):
        on_object = np.isin(other_geom, list(context.facts.patch_geoms[patch]))
        for side in range(len(SIDES)):
            force = np.where(code[:, side] == index, _force(context, rows[on_object & (palm == side)]), 0.0)
            for start, stop in joined(force > CONTACT_FORCE, context.ticks(EPISODE_GAP)):
                if np.count_nonzero(force[start:stop] >= LOAD_FORCE) >= context.ticks(LOAD_TIME):
                    found.append((patch, HandContact(side, start, stop)))
    found.sort(key=lambda entry: entry[1].start)
    return [
        (patch, contact)
        for k, (patch, contact) in enumerate(found)
        if k == 0 or (found[k - 1][0], found[k - 1][1].side) != (patch, contact.side)
    ]


def _on_palms(context: CheckContext) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Rows (r,) of the contacts of palms with the world, and of each its side index and the world's geom."""
    robot_geom, other_geom, outside = context.contact_sides
    side_of_geom = context.facts.geom_palm
    rows = np.flatnonzero(by_blocks(lambda geom, out: out & (side_of_geom[geom] >= 0), robot_geom, outside))
    return rows, side_of_geom[robot_geom[rows]], other_geom[rows]


def _force(context: CheckContext, rows: NDArray[np.int64]) -> Vector:
    """(n,) [N] sum over the `rows` (r,) of the contacts of the magnitudes of their forces, at each tick."""
    magnitude, tick = lengths(context.recorder.contacts.force[rows]), context.contact_tick(rows)
    ticks = context.recorder.ticks
    return np.bincount(tick, weights=magnitude, minlength=ticks).astype(np.float64)
