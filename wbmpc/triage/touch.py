"""Contacts that should have been and were not, and those that should not have been."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from wbmpc.checks.blocks import lengths
from wbmpc.checks.contacts import undeclared_contacts
from wbmpc.checks.context import CONTACT_FORCE, CheckContext
from wbmpc.checks.settings import DeclaredContacts
from wbmpc.checks.stretches import joined
from wbmpc.scenario import PatchPose
from wbmpc.signals import SIDES, ContactPhase
from wbmpc.triage.causes import Cause, Finding

GIVEN_UP = re.compile(r"contact (\w+) (\S+): (missing|unreached)")  # the planner's event when it does so
NO_GROUND = re.compile(r"foot (\w+): no ground for (\S+) s")  # the same for a foot that should have landed
PASSED = -0.005  # [m] height of a palm's surface over its patch: where the surface should be, it is through
NEAR = 0.03  # [m] from the patch's normal: elsewhere a palm is not at the patch, whatever its height
LOST = 0.15  # [s] without force, of a contact that should carry load
SLIDING = 0.95  # share of the friction cone from which on a contact counts as sliding
LEAST_LOAD = 2.0  # [N] on a contact that slides: lighter ones carry nothing
LEAST_SLIDE = 0.012  # [m] in one go; soles that roll over an edge or settle after a landing do less


def contacts_not_made(context: CheckContext, patches: Sequence[PatchPose], palm_radius: float) -> Iterator[Finding]:
    """Palms that found nothing, did not get there, went through where the surface should be, or lost it."""
    recorder, places = context.recorder, {patch.name: patch for patch in patches}
    for event in recorder.events:
        if match := GIVEN_UP.match(event.text):
            side, patch, outcome = match.groups()
            ended = "found nothing" if outcome == "missing" else "did not get to"
            where = f"where patch {patch} should be" if outcome == "missing" else f"patch {patch}"
            yield _not_made(context, event.time, f"the {side} palm {ended} {where}")
    if not places or not len(recorder.plans):
        return
    phases = np.vstack([[plan.contact_phase for plan in recorder.plans], [[0, 0]]])[context.plan_of_tick]  # (n, 2)
    push = np.linalg.norm(context.palm_force, axis=2)
    for side, word in enumerate(SIDES):
        names = np.array([pair[side] for pair in context.patch_of_tick])
        for name in sorted(set(names.tolist()) & set(places)):
            patch, chosen = places[name], names == name
            way = recorder.palm_position[:, side] - patch.position
            height = way @ patch.normal
            beside = np.linalg.norm(way - height[:, None] * patch.normal, axis=1) > NEAR
            untouched = push[:, side] < CONTACT_FORCE
            approaching = chosen & (phases[:, side] == ContactPhase.APPROACHING) & untouched & ~beside
            approaching &= height - palm_radius < PASSED
            if (through := np.flatnonzero(approaching)).size:
                what = f"the {word} palm went through where patch {name} should be"
                yield _not_made(context, float(context.time[through[0]]), what)
            loaded = chosen & np.isin(phases[:, side], (ContactPhase.LOADED, ContactPhase.QUIET))
            for first, stop in joined(loaded & untouched, 1):
                if stop - first >= context.ticks(LOST):
                    what = f"the {word} palm no longer pushes on patch {name}"
                    yield _not_made(context, float(context.time[first]), what)


def ground_not_met(context: CheckContext) -> Iterator[Finding]:
    """Feet that found no ground when they should have landed; from then until they were taken for landed."""
    events = context.recorder.events
    for event in events:
        if match := NO_GROUND.match(event.text):
            side, seconds = match.groups()
            landed = (e.time for e in events if e.time > event.time and e.text.startswith(f"foot {side}: landed"))
            what = f"the {side} foot found no ground where it should have landed"
            yield Finding(Cause.CONTACT_NOT_MADE, event.time - float(seconds), next(landed, np.inf), what)


def _not_made(context: CheckContext, time: float, what: str) -> Finding:
    """Over when a contact that carries load follows, whichever it is."""
    loaded = [
        p.time for p in context.recorder.plans if p.time > time and (p.contact_phase == ContactPhase.LOADED).any()
    ]
    really = np.linalg.norm(context.palm_force, axis=2).max(axis=1) > CONTACT_FORCE
    end = next((t for t in loaded if really[np.searchsorted(context.time, t - 1e-9) :][:1].any()), np.inf)
    return Finding(Cause.CONTACT_NOT_MADE, time, float(end), what)


def collisions(context: CheckContext, config: DeclaredContacts) -> Iterator[Finding]:
    """The robot touches itself, or what it is not to touch; the first of each pair."""
    undeclared = undeclared_contacts(context, config)
    force = lengths(context.recorder.contacts.force)
    robot_geom, other_geom, outside = context.contact_sides
    seen: set[tuple[int, int]] = set()
    for row in np.flatnonzero(undeclared):
        pair = (int(robot_geom[row]), int(other_geom[row]))
        if pair in seen:
            continue
        seen.add(pair)
        time = context.contact_time(int(row))
        a, b = (context.facts.geom_name[geom] for geom in pair)
        cause = Cause.COLLISION if outside[row] else Cause.SELF_COLLISION
        yield Finding(cause, time, np.inf, f"{a} touches {b}, {force[row]:.1f} N")


def slips(context: CheckContext, model: Any) -> Iterator[Finding]:
    """Soles and palms that slide under load: their force on the edge of the true friction cone, and they move.

    The normal is vertical under a sole (all ground is level) and goes through the centre of a palm, which is a sphere.
    """
    recorder, facts, contacts = context.recorder, context.facts, context.recorder.contacts
    robot_geom, other_geom, outside = context.contact_sides
    tick = recorder.contact_tick
    friction = np.maximum(model.geom_friction[other_geom, 0], 0.0)  # the world's geoms have priority
    for kind, parts, places in (
        ("foot", facts.geom_foot, recorder.sole_position),
        ("palm", facts.geom_palm, recorder.palm_position),
    ):
        for side, word in enumerate(SIDES):
            rows = np.flatnonzero(outside & (parts[robot_geom] == side))
            if not rows.size:
                continue
            away = places[tick[rows], side] - contacts.position[rows]
            normal = (
                away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None] if kind == "palm" else [0.0, 0.0, 1.0]
            )
            along = np.einsum("cx,cx->c", contacts.force[rows], np.broadcast_to(normal, (rows.size, 3)))
            across = np.sqrt(
                np.maximum(np.einsum("cx,cx->c", contacts.force[rows], contacts.force[rows]) - along**2, 0.0)
            )
            load, drag, most = (
                np.bincount(tick[rows], weights=values, minlength=recorder.ticks)
                for values in (along, across, np.maximum(along, 0.0) * friction[rows])
            )
            sliding = (load > LEAST_LOAD) & (drag > SLIDING * most)
            against = _motion_of(context, int(other_geom[rows[0]]))
            for first, stop in joined(sliding, context.ticks(0.03)):
                course = places[first:stop, side] - against[first:stop]
                distance = float(np.linalg.norm(course[-1] - course[0]))
                if distance >= LEAST_SLIDE:
                    surface = facts.geom_name[int(other_geom[rows[np.searchsorted(tick[rows], first)]])]
                    what = f"the {word} {kind} slides {1e2 * distance:.1f} cm on {surface}"
                    what += f" (friction {most[first] / load[first]:.2g})"
                    yield Finding(Cause.SLIP, float(context.time[first]), float(context.time[stop - 1]), what)


def _motion_of(context: CheckContext, geom: int) -> Any:
    """(n, 3) [m] place of the loose object that a geom belongs to; 0 for what does not move."""
    for thing in context.facts.lifted_objects:
        if geom in thing.geoms:
            return context.recorder.qpos[:, thing.qpos : thing.qpos + 3]
    return np.zeros((context.recorder.ticks, 3))
