"""The ZMP of the plan without contact, and with the contacts' known forces."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.contact_force import Need
from wbmpc.planner.horizontal_motion import Motion, ZmpModel
from wbmpc.planner.preview import Preview
from wbmpc.planner.support import SupportPolygon
from wbmpc.signals import GRAVITY, Vector


def free_model(preview: Preview, height: HeightPlan, *, plane: float, mass: float, exact: bool) -> ZmpModel:
    """The ZMP without contact: exact, Z_nc = c − c_z c̈ / (g + c̈_z), or the paper's LIPM, which leaves c̈_z out.

    Args:
        plane: height of the ZMP plane in world [m].
        mass: [kg].
    """
    zero = np.zeros(preview.steps)
    a, b = preview.zmp_gains(
        height=height.height - plane,
        vertical_acceleration=height.acceleration if exact else zero,
        vertical_force=zero,
        mass=mass,
    )
    return ZmpModel(a, b, np.zeros((preview.steps, 2)))


def loaded_model(
    preview: Preview, height: HeightPlan, *, forces: Vector, points: list[Vector | None], plane: float, mass: float
) -> ZmpModel:
    """The ZMP under known contact forces, the paper's case a ([M] eq. ak_bk_qk), the forces of all contacts summed.

    Args:
        forces: (contacts, N, 3) on the robot, in world [N].
        points: where each acts, (3,) or (N, 3), in world [m]; None for an unused one.
    """
    total = forces[:, :, 2].sum(axis=0)
    a, b = preview.zmp_gains(
        height=height.height - plane, vertical_acceleration=height.acceleration, vertical_force=total, mass=mass
    )
    offset = np.zeros((preview.steps, 2))
    for force, point in zip(forces, points, strict=True):
        if point is not None:
            offset += preview.zmp_offset(
                point=np.broadcast_to(point, (preview.steps, 3)),
                force=force,
                vertical_acceleration=height.acceleration,
                vertical_force=total,
                mass=mass,
                plane_height=plane,
            )
    return ZmpModel(a, b, offset)


def need_at_rest(com: Vector, *, polygon: SupportPolygon, mass: float) -> Need:
    """The need, of one knot, of standing still with the CoM at `com` (3,) [m]: the smallest shift into the polygon."""
    zmp = com[:2]
    return Need(
        delta_z=(polygon.nearest(zmp) - zmp)[None],
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

    `carried` (N,) is the vertical force [N] of what the hands hold, already in that model.

    The paper's ΔZ has a term m c_z c̈ c̈_z / g even without a contact (docs/paper.md); the exact one has not.
    """
    phantom = np.zeros_like(wish.delta_z)
    if not exact:
        lever = (height.height - polygons[0].plane_height) * height.acceleration
        phantom = mass * lever[:, None] * wish.acceleration / GRAVITY
    return Need(
        delta_z=wish.delta_z,
        zmp=model.a[:, None] * wish.com - model.b[:, None] * wish.acceleration + model.offset,
        weight=mass * (GRAVITY + height.acceleration) - carried,
        polygons=polygons,
        phantom=phantom,
    )
