"""The ZMP of the plan without contact, and with the contacts' known forces."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.contact_force import Need
from wbmpc.planner.horizontal_motion import Motion, ZmpModel
from wbmpc.planner.support import SupportPolygon
from wbmpc.signals import GRAVITY, Vector

NO_POINTS = np.empty((0, 0, 3))


def free_model(height: HeightPlan, *, plane: float, mass: float, exact: bool) -> ZmpModel:
    """The ZMP without contact: exact, Z_nc = c − c_z c̈ / (g + c̈_z), or the paper's LIPM, which leaves c̈_z out.

    Args:
        plane: height of the ZMP plane in world [m].
        mass: [kg].
    """
    acceleration = height.acceleration if exact else np.zeros(len(height.height))
    return ZmpModel(*_model(height.height, acceleration, NO_POINTS, NO_POINTS, plane, mass))


def loaded_model(height: HeightPlan, *, forces: Vector, points: Vector, plane: float, mass: float) -> ZmpModel:
    """The ZMP under known contact forces, the paper's case a ([M] eq. ak_bk_qk), the forces of all contacts summed.

    Args:
        forces: (contacts, N, 3) on the robot, in world [N].
        points: (contacts, N, 3) where each acts, in world [m]; nan for an unused one.
    """
    return ZmpModel(*_model(height.height, height.acceleration, forces, points, plane, mass))


def held(points: list[Vector | None], steps: int) -> Vector:
    """Points (contacts, `steps`, 3) that stay where they are (3,); nan for None."""
    places = np.full((len(points), steps, 3), np.nan)
    for place, point in zip(places, points, strict=True):
        if point is not None:
            place[:] = point
    return places


@kernel
def _model(
    height: Vector, acceleration: Vector, forces: Vector, points: Vector, plane: float, mass: float
) -> tuple[Vector, Vector, Vector]:
    """a, b (N,) and j (N, 2) of Z = a c − b c̈ + j, [M] eq. ak_bk_qk with the erratum of docs/paper.md.

    With no force a = 1 and b = c_z / (g + c̈_z): the exact contact-free ZMP, of which the paper's LIPM ZMP is the
    special case c̈_z = 0.
    """
    n = len(height)
    a, b, offset = np.empty(n), np.empty(n), np.zeros((n, 2))
    for k in range(n):
        vertical = 0.0  # [N] of all contacts together
        for contact in range(len(forces)):
            vertical += forces[contact, k, 2]
        weight = mass * (GRAVITY + acceleration[k])
        ground = weight - vertical  # the feet's vertical force
        a[k], b[k] = weight / ground, mass * (height[k] - plane) / ground
        for contact in range(len(forces)):
            force, point = forces[contact, k], points[contact, k]
            if np.isnan(point[2]):
                continue
            for axis in range(2):
                offset[k, axis] += ((point[2] - plane) * force[axis] - point[axis] * force[2]) / ground
    return a, b, offset


def shift_to_rest(com: Vector, polygon: SupportPolygon) -> Vector:
    """The smallest shift (2,) [m] into the polygon that lets the CoM rest at `com` (3,) [m]."""
    return polygon.nearest(com[:2]) - com[:2]


def need_at_rest(com: Vector, *, polygon: SupportPolygon, shift: Vector, mass: float) -> Need:
    """The need, of one knot, of standing still with the CoM at `com` (3,) [m], given its `shift_to_rest` (2,)."""
    zmp = com[:2]
    return Need(
        delta_z=shift[None],
        zmp=zmp[None],
        weight=np.array([mass * GRAVITY]),
        polygons=(polygon,),
        phantom=np.zeros((1, 2)),
    )


def need_of(
    wish: Motion,
    height: HeightPlan,
    model: ZmpModel,
    *,
    carried: Vector,
    polygons: tuple[SupportPolygon, ...],
    mass: float,
    exact: bool,
) -> Need:
    """What stage 3 must know of a plan `wish` whose ΔZ was free; `model` is the ZMP that it was made with.

    `carried` (hands, N, 3) [N] are the forces of what the hands hold, already in that model.

    The paper's ΔZ has a term m c_z c̈ c̈_z / g even without a contact (docs/paper.md); the exact one has not.
    """
    zmp, weight, phantom = _need(
        *(model.a, model.b, model.offset, wish.com, wish.acceleration, height.height, height.acceleration),
        *(carried, polygons[0].plane_height, mass, exact),
    )
    return Need(delta_z=wish.delta_z, zmp=zmp, weight=weight, polygons=polygons, phantom=phantom)


@kernel
def _need(
    a: Vector,
    b: Vector,
    offset: Vector,
    com: Vector,
    acceleration: Vector,
    height: Vector,
    vertical: Vector,
    carried: Vector,
    plane: float,
    mass: float,
    exact: bool,
) -> tuple[Vector, Vector, Vector]:
    """ZMP (N, 2) [m], weight (N,) [N] and phantom term (N, 2) [N m] of `Need`; `vertical` (N,) is c̈_z [m/s²]."""
    n = len(a)
    zmp, weight, phantom = np.empty((n, 2)), np.empty(n), np.zeros((n, 2))
    for k in range(n):
        load = 0.0  # [N] that the hands hold
        for hand in range(len(carried)):
            load += carried[hand, k, 2]
        weight[k] = mass * (GRAVITY + vertical[k]) - load
        for axis in range(2):
            zmp[k, axis] = a[k] * com[k, axis] - b[k] * acceleration[k, axis] + offset[k, axis]
            if not exact:
                lever = (height[k] - plane) * vertical[k]
                phantom[k, axis] = mass * lever * acceleration[k, axis] / GRAVITY
    return zmp, weight, phantom
