"""Checks of who touches what: declared pairs only, no deep penetration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks import settings
from wbmpc.checks.blocks import by_blocks, lengths
from wbmpc.checks.context import CheckContext
from wbmpc.checks.result import CheckResult, at_most
from wbmpc.signals import SIDES


class DeclaredContactsCheck:
    """Largest force of a contact that nobody declared: no foot where it may stand, no chosen palm on its object.

    A foot may stand on the floor and on walkable objects, and touch these alone; a palm may touch what is to be lifted.
    Objects may touch one another.
    """

    def __init__(self, config: settings.DeclaredContacts) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        facts = context.facts
        robot_geom, other_geom, _ = context.contact_sides
        undeclared = undeclared_contacts(context, self.config)
        if not undeclared.any():
            return at_most(name, 0.0, self.config.min_force, "N", "only declared pairs touched", when=None)
        pairs = {(int(a), int(b)) for a, b in zip(robot_geom[undeclared], other_geom[undeclared], strict=True)}
        named = sorted(f"{facts.geom_name[a]} – {facts.geom_name[b]}" for a, b in pairs)
        more = f" and {len(named) - 3} more" if len(named) > 3 else ""
        message = f"undeclared contact: {', '.join(named[:3])}{more}"
        when = context.first_contact_time(undeclared)
        force = lengths(context.recorder.contacts.force[undeclared])
        return at_most(name, float(force.max()), self.config.min_force, "N", message, when=when)


def undeclared_contacts(context: CheckContext, config: settings.DeclaredContacts) -> NDArray[np.bool_]:
    """(c,) contacts, of more than a touch, that nobody declared."""
    facts = context.facts
    to_lift = [geom for thing in facts.lifted_objects for geom in thing.geoms]

    def unexplained(robot_geom, other_geom, outside, force):  # type: ignore[no-untyped-def]
        both_robot = facts.geom_is_robot[robot_geom] & facts.geom_is_robot[other_geom]
        foot_on_ground = outside & (facts.geom_foot[robot_geom] >= 0) & facts.geom_walkable[other_geom]
        palm_on_load = outside & (facts.geom_palm[robot_geom] >= 0) & np.isin(other_geom, to_lift)
        declared = ~(outside | both_robot) | foot_on_ground | palm_on_load
        return ~declared & ~(np.linalg.norm(force, axis=1) <= config.min_force)

    undeclared = by_blocks(unexplained, *context.contact_sides, context.recorder.contacts.force)
    rows = np.flatnonzero(undeclared)
    undeclared[rows] = ~_chosen_palm(context, rows, config.release_time)
    return undeclared


def _chosen_palm(context: CheckContext, rows: NDArray[np.int64], release_time: float) -> NDArray[np.bool_]:
    """Which contacts, of these `rows`, are a palm's with the object of a patch chosen for it.

    A patch counts that is, or within `release_time` was, chosen.
    """
    facts, ticks = context.facts, context.recorder.ticks
    robot_geom, other_geom, outside = (side[rows] for side in context.contact_sides)
    tick, palm = context.contact_tick(rows), facts.geom_palm[robot_geom]
    grace = context.ticks(release_time)
    declared = np.zeros(tick.size, dtype=bool)
    names, code = context.patch_codes
    for index, patch in enumerate(names):
        on_object = outside & np.isin(other_geom, list(facts.patch_geoms[patch]))
        for side in range(len(SIDES)):
            chosen = code[:, side] == index
            if chosen.any():
                declared |= on_object & (palm == side) & (_ticks_since(chosen, ticks) <= grace)[tick]
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
        distance = context.recorder.contacts.distance  # (c,) [m]
        if distance.size == 0:
            return at_most(name, 0.0, self.config.max, "m", "nothing ever touched", when=None)
        worst = int(np.argmin(distance))  # of a nan when there is one
        a, b = context.recorder.contacts.geoms[worst]
        names = context.facts.geom_name
        message = f"deepest at {names[a]} – {names[b]}, t = {context.contact_time(worst):.3f} s"
        when = context.first_contact_time(~by_blocks(lambda block: -block <= self.config.max, distance))
        return at_most(name, max(0.0, float(-distance[worst])), self.config.max, "m", message, when=when)
