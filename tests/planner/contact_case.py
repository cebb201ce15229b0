"""A robot of 3.43 kg that leans over its toes, and patches to brace on."""

from __future__ import annotations

import numpy as np
from newton_euler import centre_of_pressure
from robots import standing_polygon

from wbmpc.planner.contact_choice import KNOTS
from wbmpc.planner.contact_force import Need
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, Vector

MASS, HEIGHT = 3.43, 0.25  # [kg], [m] CoM
SETTINGS = ContactSettings()
POLYGON = standing_polygon(margin=0.018)
FRONT = float(POLYGON.offsets[np.argmax(POLYGON.normals[:, 0])])  # [m] foremost place of the feet's pressure

UP = np.array([0.0, 0.0, 1.0])


def patch(position: Vector, normal: Vector = UP, *, friction: float = 0.5, cap: float = 20.0) -> PatchPose:
    return PatchPose("patch", "object", np.asarray(position, dtype=float), np.asarray(normal), friction, cap)


def lean(beyond: float, *, sideways: float = 0.0, knots: int = KNOTS, growth: float = 0.01) -> Need:
    """At rest with the CoM `beyond` the foremost pressure, a little more with every knot: ΔZ brings it back."""
    zmp = np.array([[FRONT + beyond + growth * k, sideways] for k in range(knots)])
    return Need(
        delta_z=np.column_stack([FRONT - zmp[:, 0], np.zeros(knots)]),
        zmp=zmp,
        weight=np.full(knots, MASS * GRAVITY),
        polygons=(POLYGON,) * knots,
        phantom=np.zeros((knots, 2)),
    )


def pressure(need: Need, knot: int, points: list[Vector], forces: Vector) -> Vector:
    """Centre of pressure (2,) of the feet under hand forces (k, 3); the robot is at rest with its CoM over Z_nc."""
    com = np.array([*need.zmp[knot], HEIGHT])
    return centre_of_pressure(
        mass=MASS, com=com, acceleration=np.zeros(3), plane_height=0.0, point=np.array(points), force=forces
    )


TABLE = patch([0.27, -0.11, 0.20])
BEHIND = patch([-0.25, -0.11, 0.20])
WALL = patch([0.25, 0.28, 0.25], np.array([0.0, -1.0, 0.0]))
