"""Stage 3 at one knot, as kernels: the small QP of one or two given contacts, and what their multipliers say of others.

Forces and moments are divided by the robot's weight m g, so that forces count in weights, moments in metres and the
cost in the settings' unit; a force has the coordinates (tangent, tangent, normal) of its contact's frame. With H fixed
the knots of stage 3 share nothing: the shift equalities and the polygon rows couple forces of the same knot only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.contact_force import PADDING, Need
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.qp.small_qp import INFEASIBLE, SmallQp, solve_small
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, Vector

SQRT2 = float(np.sqrt(2.0))
CONE = 4  # sides of the linearised friction cone


class KnotNeeds(NamedTuple):
    """A `Need` of n knots as the kernels read it."""

    centre: Vector  # (n, 2) [m] Z_nc + ΔZ
    moment: Vector  # (n, 2) [m] h of the shift equalities G f = h
    height: Vector  # (n,) [m] of the ZMP plane in world
    normals: Vector  # (n, MAX_EDGES, 2) of the polygon's edges
    offsets: Vector  # (n, MAX_EDGES) [m]
    room: Vector  # (n, MAX_EDGES) [m] q of the polygon rows P f ≤ q

    @classmethod
    def room_for(cls, knots: int) -> KnotNeeds:
        """Arrays for so many knots, no need at all."""
        return cls(
            centre=np.zeros((knots, 2)),
            moment=np.zeros((knots, 2)),
            height=np.zeros(knots),
            normals=np.zeros((knots, MAX_EDGES, 2)),
            offsets=np.zeros((knots, MAX_EDGES)),
            room=np.zeros((knots, MAX_EDGES)),
        )

    def fill(self, need: Need, *, mass: float) -> None:
        """Take over `need`, of as many knots, of a robot of `mass` [kg]."""
        unit = 1.0 / (mass * GRAVITY)
        for k, polygon in enumerate(need.polygons):
            self.normals[k] = polygon.normals
            self.offsets[k] = polygon.offsets
            self.height[k] = polygon.plane_height
        self.offsets[self.offsets == np.inf] = PADDING
        weight, phantom = (unit * need.weight)[:, None], unit * need.phantom
        np.add(need.zmp, need.delta_z, out=self.centre)
        np.subtract(weight * need.delta_z, phantom, out=self.moment)
        pressure = weight * need.zmp + phantom
        np.subtract(weight * self.offsets, (self.normals @ pressure[:, :, None])[:, :, 0], out=self.room)

    def finite(self) -> bool:
        """Whether a QP can be made of it."""
        return bool(np.isfinite(self.moment).all() and np.isfinite(self.centre).all() and np.isfinite(self.room).all())


class Grips(NamedTuple):
    """Up to n contacts as the kernels read them, and the prices of stage 3."""

    position: Vector  # (n, 3) [m] in world
    axes: Vector  # (n, 3, 3) two tangents and the normal, as rows, in world
    slope: Vector  # (n,) largest |tangent| / normal, of each tangent
    cap: Vector  # (n,) largest normal force [m g]
    price: Vector  # (3,) [cost / (m g)²] of the force's coordinates
    slack_price: float  # [cost / m²] of a shift that is not given

    @classmethod
    def room_for(cls, count: int, settings: ContactSettings) -> Grips:
        """Arrays for `count` contacts."""
        return cls(
            position=np.zeros((count, 3)),
            axes=np.zeros((count, 3, 3)),
            slope=np.zeros(count),
            cap=np.zeros(count),
            price=np.array([settings.tangent_cost, settings.tangent_cost, settings.force_cost]),
            slack_price=settings.shift_slack_cost,
        )

    def fill(self, patches: Sequence[PatchPose | None], *, mass: float) -> None:
        """Take over the first contacts' `patches`, None for a place that is not used."""
        unit = 1.0 / (mass * GRAVITY)
        for i, patch in enumerate(patches):
            if patch is not None:
                self.position[i] = patch.position
                self.axes[i, 2] = patch.normal
                self.slope[i] = patch.friction / SQRT2  # the cone of `contact_force.cone_rows`
                self.cap[i] = unit * patch.force_cap


class KnotRoom(NamedTuple):
    """Room for the QP of two contacts at one knot."""

    qp: SmallQp
    shift: Vector  # (2, 6) G
    pull: Vector  # (2,) [cost / m] multipliers of the shift equalities: slack price × (G f − h)

    @classmethod
    def empty(cls) -> KnotRoom:
        """All zero."""
        return cls(SmallQp.of_size(6, MAX_EDGES + 2 * (CONE + 1)), np.zeros((2, 6)), np.zeros(2))


@kernel
def set_axes(axes: Vector) -> None:
    """The frame of `rotations.contact_frame` as rows of `axes` (3, 3), of which the last, the normal, is given."""
    normal = axes[2]
    helper = 0 if abs(normal[0]) < 0.7 else 1
    for j in range(3):
        axes[0, j] = 1.0 if j == helper else 0.0
    _cross(normal, axes[0], axes[1])
    length = np.sqrt(axes[1, 0] ** 2 + axes[1, 1] ** 2 + axes[1, 2] ** 2)
    for j in range(3):
        axes[1, j] /= length
    _cross(axes[1], normal, axes[0])


@kernel
def _cross(a: Vector, b: Vector, out: Vector) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def solve_knot(
    room: KnotRoom, need: KnotNeeds, k: int, grips: Grips, first: int, second: int, caps: Vector, softness: float
) -> float:
    """Cost of knot `k` with contact `first`, and `second` unless it is negative, under `caps` (n,) [m g].

    inf when no forces keep the feet's ZMP in its polygon (never when `softness` > 0: 1 / price of a polygon row), nan
    when the QP could not be solved. The forces are in `room.qp.x`; the polygon rows' multipliers lead
    `room.qp.multiplier`, those of the shift equalities are in `room.pull`.
    """
    qp, shift, w = room.qp, room.shift, grips.slack_price
    n = 3 if second < 0 else 6
    rows = MAX_EDGES + (CONE + 1) * n // 3
    for r in range(rows):
        qp.bound[r] = need.room[k, r] if r < MAX_EDGES else 0.0
        qp.softness[r] = softness if r < MAX_EDGES else 0.0
        for j in range(n):
            qp.rows[r, j] = 0.0
    for j in range(0, n, 3):
        i = first if j == 0 else second
        _write_contact(qp, shift, need, k, grips, i, j)
        qp.bound[MAX_EDGES + (CONE + 1) * (j // 3) + CONE] = caps[i]
    constant = 0.0
    for axis in range(2):
        constant += 0.5 * w * need.moment[k, axis] ** 2
    for i in range(n):
        qp.gradient[i] = -w * (shift[0, i] * need.moment[k, 0] + shift[1, i] * need.moment[k, 1])
        for j in range(i + 1):
            qp.hessian[i, j] = w * (shift[0, i] * shift[0, j] + shift[1, i] * shift[1, j])
        qp.hessian[i, i] += grips.price[i % 3]
    steps = solve_small(qp, n, rows)
    if steps < 0:
        return np.inf if steps == INFEASIBLE else np.nan
    cost = constant
    for axis in range(2):
        excess = -need.moment[k, axis]
        for i in range(n):
            excess += shift[axis, i] * qp.x[i]
        room.pull[axis] = w * excess
    for i in range(n):
        product = 0.0
        for axis in range(2):
            product += shift[axis, i] * (room.pull[axis] - w * need.moment[k, axis])
        cost += 0.5 * qp.x[i] * (grips.price[i % 3] * qp.x[i] + product)
    return cost


@kernel
def _write_contact(qp: SmallQp, shift: Vector, need: KnotNeeds, k: int, grips: Grips, i: int, column: int) -> None:
    """Columns of contact `i`: its moments in the shift equalities and polygon rows, its cone and cap."""
    position, axes = grips.position[i], grips.axes[i]
    lever = position[2] - need.height[k]
    for t in range(3):
        j = column + t
        for axis in range(2):
            shift[axis, j] = lever * axes[t, axis] + (need.centre[k, axis] - position[axis]) * axes[t, 2]
        for e in range(MAX_EDGES):
            a, b = need.normals[k, e, 0], need.normals[k, e, 1]
            beyond = need.offsets[k, e] - a * position[0] - b * position[1]
            qp.rows[e, j] = lever * (a * axes[t, 0] + b * axes[t, 1]) + beyond * axes[t, 2]
    row = MAX_EDGES + (CONE + 1) * (column // 3)
    for side in range(CONE):
        qp.rows[row + side, column + side // 2] = 1.0 if side % 2 == 0 else -1.0
        qp.rows[row + side, column + 2] = -grips.slope[i]
    qp.rows[row + CONE, column + 2] = 1.0


@kernel
def to_world(forces: Vector, coordinates: Vector, axes: Vector) -> None:
    """Write a force's three leading `coordinates` in the frame `axes` (3, 3) as `forces` (3,) in world."""
    for j in range(3):
        forces[j] = coordinates[0] * axes[0, j] + coordinates[1] * axes[1, j] + coordinates[2] * axes[2, j]
