"""Candidate contact patches in world coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.world import Box, Face, Patch
from wbmpc.signals import Vector


class FaceAxes(NamedTuple):
    """A face of a box in the box's own axes (0 = x, 1 = y, 2 = z)."""

    normal_axis: int
    sign: int
    plane_axes: tuple[int, int]  # along which a patch's offset runs


FACES: dict[Face, FaceAxes] = {
    "front": FaceAxes(0, +1, (1, 2)),
    "back": FaceAxes(0, -1, (1, 2)),
    "left": FaceAxes(1, +1, (0, 2)),
    "right": FaceAxes(1, -1, (0, 2)),
    "top": FaceAxes(2, +1, (0, 1)),
    "bottom": FaceAxes(2, -1, (0, 1)),
}


@dataclass(frozen=True, slots=True, eq=False)
class PatchPose:
    """A candidate contact as the planner sees it, in world."""

    name: str
    object: str  # name of the object, which is also the name of its geom
    position: Vector  # (3,) [m] centre of the patch, on the surface
    normal: Vector  # (3,) unit, out of the surface
    friction: float  # coefficient that the planner counts on
    force_cap: float  # [N] largest normal force that the planner may ask for


def resolve_patches(scenario: Scenario) -> tuple[PatchPose, ...]:
    """All patches of a valid scenario, in the order of the file, whether or not their object is present."""
    return tuple(_resolve(name, patch, scenario.world.objects[patch.on]) for name, patch in scenario.patches.items())


def _resolve(name: str, patch: Patch, box: Box) -> PatchPose:
    face = FACES[patch.face]
    normal_in_box, position_in_box = np.zeros(3), np.zeros(3)
    normal_in_box[face.normal_axis] = face.sign
    position_in_box[face.normal_axis] = face.sign * box.size[face.normal_axis] / 2
    position_in_box[list(face.plane_axes)] = patch.offset
    cosine, sine = math.cos(box.yaw), math.sin(box.yaw)
    box_to_world = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    position, normal = np.array(box.centre) + box_to_world @ position_in_box, box_to_world @ normal_in_box
    for array in (position, normal):
        array.flags.writeable = False
    return PatchPose(name, patch.on, position, normal, patch.friction, patch.force_cap)
