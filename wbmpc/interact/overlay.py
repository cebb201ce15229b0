"""What the window draws besides robot and world: the plan, the targets, the candidate patches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from wbmpc.interact.exchange import Frame
from wbmpc.rerun_sink.palette import FAULT, GOOD, LIMIT, PLANNED
from wbmpc.scenario import PatchPose
from wbmpc.signals import Vector

TARGET_RADIUS, CHOSEN_RADIUS = 0.012, 0.016  # [m]
LINE = 0.0025  # [m] radius
PATCH = (0.02, 0.02, 0.0008)  # [m] half edges
ABOVE_GROUND = 0.002  # [m] what lies on a surface would flicker
Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Shape:
    """One geom of the drawing."""

    kind: int  # mjtGeom
    size: Vector  # (3,) [m]
    position: Vector  # (3,) [m]
    rotation: Vector  # (3, 3)
    rgba: Vector  # (4,)


@dataclass(frozen=True, slots=True)
class Line:
    """A straight piece from one point (3,) to another [m]."""

    start: Vector
    end: Vector
    rgba: Vector  # (4,)


def shapes_of(frame: Frame, patches: Sequence[PatchPose]) -> Iterator[Shape | Line]:
    """The drawing of a frame; the targets are always there, the rest when the plan is shown."""
    for index, target in enumerate(frame.targets):
        mine = index == frame.chosen
        size = np.full(3, CHOSEN_RADIUS if mine else TARGET_RADIUS)
        yield Shape(mujoco.mjtGeom.mjGEOM_SPHERE, size, target, np.eye(3), _rgba(GOOD, 0.8 if mine else 0.4))
    if not frame.plan_shown:
        return
    for patch in patches:
        colour = _rgba(PLANNED, 0.9) if patch.name in frame.patches else _rgba(LIMIT, 0.35)
        centre = patch.position + ABOVE_GROUND * patch.normal
        yield Shape(mujoco.mjtGeom.mjGEOM_BOX, np.array(PATCH), centre, _onto(patch.normal), colour)
    yield from _polyline(frame.com, PLANNED)
    yield from _polyline(frame.zmp, FAULT)
    yield from _polyline(np.vstack([frame.support, frame.support[:1]]), LIMIT)


def draw(scene: mujoco.MjvScene, shapes: Iterator[Shape | Line]) -> None:
    """Replace what is in the scene by the shapes, as many as it has room for."""
    scene.ngeom = 0
    for shape in shapes:
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        if isinstance(shape, Line):
            kind = mujoco.mjtGeom.mjGEOM_CAPSULE
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), shape.rgba)
            mujoco.mjv_connector(geom, kind, LINE, shape.start, shape.end)
        else:
            mujoco.mjv_initGeom(geom, shape.kind, shape.size, shape.position, shape.rotation.ravel(), shape.rgba)
        scene.ngeom += 1


def _polyline(points: Vector, colour: Colour) -> Iterator[Line]:
    for start, end in pairwise(points):
        if np.isfinite(start).all() and np.isfinite(end).all() and np.linalg.norm(end - start) > 1e-6:
            yield Line(start, end, _rgba(colour, 1.0))


def _rgba(colour: Colour, alpha: float) -> Vector:
    return np.array([*(c / 255 for c in colour), alpha])


def _onto(normal: Vector) -> Vector:
    """(3, 3) rotation whose z axis is `normal` (3,)."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(normal, x), normal])
