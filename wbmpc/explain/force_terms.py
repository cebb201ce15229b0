"""Stage 3 in words: forces of given contacts as named terms, from what the stage was asked, written a second time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from wbmpc.explain.program import Program, Term, facing, term
from wbmpc.planner.contact_choice import Option
from wbmpc.planner.contact_force import (
    POLYGON_PRICE,
    Need,
    cone_rows,
    polygon_bound,
    polygon_rows,
    shift_bound,
    shift_rows,
)
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, Vector


def choice_program(need: Need, options: Sequence[Option], settings: ContactSettings, *, mass: float) -> Program:
    """Stage 3's problem with these options taken and no other (`ContactChoice` with H given).

    The variables are forces (options, knots, 3) [N] in world; the polygon is hard.
    """
    patches = [option.patch for option in options]
    caps = np.array([[patch.force_cap] * len(need.zmp) for patch in patches]).reshape(len(patches), -1)
    price = sum((option.price for option in options if not option.held), 0.0)
    names = [option.patch.name for option in options]
    return _program(need, patches, names, caps, settings, mass, polygon_weight=np.inf, constants={"way": price})


def force_program(
    need: Need, patches: Sequence[PatchPose | None], caps: Vector, settings: ContactSettings, *, mass: float
) -> Program:
    """The forces at every knot (`ContactForce`); caps (contacts, N) [N]: 0 where a contact is not there yet."""
    there = [patch for patch in patches if patch is not None]
    kept = np.array([cap for patch, cap in zip(patches, caps, strict=True) if patch is not None]).reshape(
        len(there), -1
    )
    weight = POLYGON_PRICE * settings.shift_slack_cost / (mass * GRAVITY) ** 2
    return _program(need, there, [p.name for p in there], kept, settings, mass, polygon_weight=weight, constants={})


def _program(
    need: Need,
    patches: Sequence[PatchPose],
    names: Sequence[str],
    caps: Vector,
    settings: ContactSettings,
    mass: float,
    *,
    polygon_weight: float,
    constants: dict[str, float],
) -> Program:
    n, weight = len(need.zmp), (mass * GRAVITY) ** 2
    size = 3 * n * len(patches)
    used = np.any(caps > 0.0, axis=0)
    G, P = np.zeros((n, 2, size)), np.zeros((n, polygon_bound(need).shape[1], size))
    along: list[Vector] = []
    across: list[Vector] = []
    cones: list[Vector] = []
    normals: list[float] = []
    labels: list[str] = []
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    for i, (patch, name) in enumerate(zip(patches, names, strict=True)):
        shift, polygon, cone = shift_rows(need, patch.position), polygon_rows(need, patch.position), cone_rows(patch)
        tangents = 0.5 * (cone[0::2] - cone[1::2])  # the frame's: a cone row is ± tangent − μ normal
        for k in range(n):
            columns = slice(3 * (n * i + k), 3 * (n * i + k) + 3)
            if caps[i, k] <= 0.0:
                lower[columns] = upper[columns] = 0.0
            G[k, :, columns], P[k, :, columns] = shift[k], polygon[k]
            for rows, block in ((along, patch.normal[None]), (across, tangents), (cones, cone)):
                rows.append(_at(columns, block, size))
            normals.append(caps[i, k] if caps[i, k] > 0.0 else np.inf)
            labels.append(f"{name}, knot {k + 1}")
    rhs, room = shift_bound(need)[used].ravel(), polygon_bound(need)[used]
    edges = [
        f"feet's ZMP, knot {k + 1}, {facing(normal)}" if normal.any() else f"feet's load, knot {k + 1}"
        for k in np.flatnonzero(used)
        for normal in need.polygons[k].normals
    ]
    sides = [f"{label}, side {s + 1}" for label in labels for s in range(4)]
    slack = settings.shift_slack_cost / weight
    terms: list[Term] = [
        term("normal force", _stacked(along, size), 0.0, weight=settings.force_cost / weight, unit="N", labels=labels),
        term("tangential force", _stacked(across, size), 0.0, weight=settings.tangent_cost / weight, unit="N"),
        term("shift not given", _stacked(G[used], size), rhs, weight=slack, unit="N·m"),
        term("polygon", _stacked(P[used], size), upper=room.ravel(), weight=polygon_weight, unit="N·m", labels=edges),
        term("friction cone", _stacked(cones, size), upper=0.0, weight=np.inf, unit="N", labels=sides),
        term("force cap", _stacked(along, size), upper=np.array(normals), weight=np.inf, unit="N", labels=labels),
    ]
    names_of = [f"force on {label}, {axis}" for label in labels for axis in "xyz"]
    return Program(terms, names_of, lower, upper, np.zeros(size), "", constants)


def _at(columns: slice, block: Vector, size: int) -> Vector:
    rows = np.zeros((len(block), size))
    rows[:, columns] = block
    return rows


def _stacked(blocks: Iterable[Vector], size: int) -> Vector:
    return np.vstack([np.zeros((0, size)), *blocks])
