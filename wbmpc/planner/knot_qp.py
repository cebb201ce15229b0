"""Stage 3 at one knot, as kernels: the small QP of one or two given contacts, and what their multipliers say of others.

Forces and moments are divided by the robot's weight m g, so that forces count in weights, moments in metres and the
cost in the settings' unit; a force has the coordinates (tangent, tangent, normal) of its contact's frame. With H fixed
the knots of stage 3 share nothing: the shift equalities and the polygon rows couple forces of the same knot only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.contact_force import PADDING, Need
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.qp.small_qp import INFEASIBLE, SmallQp, room_for, solve_small
from wbmpc.scenario import PatchPose
from wbmpc.signals import Vector

CONE = 4  # sides of the linearised friction cone


NEED = 8 + 3 * MAX_EDGES  # numbers of one packed knot
GRIP = 8  # numbers of one packed contact


class KnotNeeds(NamedTuple):
    """A `Need` of n knots as the kernels read it."""

    centre: Vector  # (n, 2) [m] Z_nc + ΔZ
    moment: Vector  # (n, 2) [m] h of the shift equalities G f = h
    height: Vector  # (n,) [m] of the ZMP plane in world
    normals: Vector  # (n, MAX_EDGES, 2) of the polygon's edges
    offsets: Vector  # (n, MAX_EDGES) [m]
    room: Vector  # (n, MAX_EDGES) [m] q of the polygon rows P f ≤ q


class Grips(NamedTuple):
    """n contacts as the kernels read them, and the prices of stage 3."""

    position: Vector  # (n, 3) [m] in world
    axes: Vector  # (n, 3, 3) two tangents and the normal, as rows, in world
    slope: Vector  # (n,) largest |tangent| / normal, of each tangent
    cap: Vector  # (n,) largest normal force [m g]
    tangent_price: float  # [cost / (m g)²] of each tangential part
    normal_price: float  # [cost / (m g)²] of the normal part
    slack_price: float  # [cost / m²] of a shift that is not given


class KnotRoom(NamedTuple):
    """Room for the QP of two contacts at one knot."""

    qp: SmallQp
    shift: Vector  # (2, 6) G
    pull: Vector  # (2,) [cost / m] multipliers of the shift equalities: slack price × (G f − h)


def pack_need(need: Need, packed: Vector) -> None:
    """Write `need` into `packed` (n, NEED), the form in which it is handed to a kernel."""
    pack_shift(need, packed)
    for row, polygon in zip(packed, need.polygons, strict=True):
        row[7] = polygon.plane_height
        row[8 : 8 + MAX_EDGES] = polygon.offsets
        row[8 + MAX_EDGES :] = polygon.normals.ravel()


def pack_shift(need: Need, packed: Vector) -> None:
    """Write of `need` what changes from plan to plan even while the feet stand: all but the polygons."""
    packed[:, 0:2] = need.delta_z
    packed[:, 2:4] = need.zmp
    packed[:, 4] = need.weight
    packed[:, 5:7] = need.phantom


def pack_patch(patch: PatchPose, packed: Vector) -> None:
    """Write a contact on `patch` into `packed` (GRIP,)."""
    packed[0:3] = patch.position
    packed[3:6] = patch.normal
    packed[6] = patch.friction
    packed[7] = patch.force_cap


def pack_prices(settings: ContactSettings) -> Vector:
    """(3,) prices of tangential force, of normal force and of shift that is not given."""
    return np.array([settings.tangent_cost, settings.force_cost, settings.shift_slack_cost])


@kernel
def empty_room() -> KnotRoom:
    """All zero."""
    return KnotRoom(room_for(6, MAX_EDGES + 2 * (CONE + 1)), np.zeros((2, 6)), np.zeros(2))


@kernel
def unpack_need(packed: Vector, weight_of_robot: float) -> KnotNeeds:
    """The need that `pack_need` wrote, of a robot of that weight m g [N]."""
    n = len(packed)
    need = KnotNeeds(
        np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n),
        np.zeros((n, MAX_EDGES, 2)), np.zeros((n, MAX_EDGES)), np.zeros((n, MAX_EDGES)),
    )  # fmt: skip
    for k in range(n):
        row = packed[k]
        weight = row[4] / weight_of_robot
        need.height[k] = row[7]
        for axis in range(2):
            need.centre[k, axis] = row[2 + axis] + row[axis]
            need.moment[k, axis] = weight * row[axis] - row[5 + axis] / weight_of_robot
        for e in range(MAX_EDGES):
            offset = row[8 + e] if row[8 + e] < np.inf else PADDING
            room = weight * offset
            for axis in range(2):
                normal = row[8 + MAX_EDGES + 2 * e + axis]
                need.normals[k, e, axis] = normal
                room -= normal * (weight * row[2 + axis] + row[5 + axis] / weight_of_robot)
            need.offsets[k, e] = offset
            need.room[k, e] = room
    return need


@kernel
def is_finite(need: KnotNeeds) -> bool:
    """Whether a QP can be made of it."""
    total = 0.0  # finite − finite = 0; anything else is nan
    for value in need.centre.flat:
        total += value - value
    for value in need.moment.flat:
        total += value - value
    for value in need.room.flat:
        total += value - value
    return total == 0.0


@kernel
def unpack_grips(packed: Vector, prices: Vector, weight_of_robot: float) -> Grips:
    """The contacts that `pack_patch` wrote; the cone is that of `contact_force.cone_rows`."""
    n = len(packed)
    grips = Grips(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros(n), np.zeros(n), prices[0], prices[1], prices[2])
    for i in range(n):
        for j in range(3):
            grips.position[i, j] = packed[i, j]
            grips.axes[i, 2, j] = packed[i, 3 + j]
        grips.slope[i] = packed[i, 6] / np.sqrt(2.0)
        grips.cap[i] = packed[i, 7] / weight_of_robot
        set_axes(grips.axes[i])
    return grips


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
    room: KnotRoom, need: KnotNeeds, k: int, grips: Grips, first: int, second: int, softness: float
) -> float:
    """Cost of knot `k` with contact `first`, and `second` unless it is negative.

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
        qp.bound[MAX_EDGES + (CONE + 1) * (j // 3) + CONE] = grips.cap[i]
    constant = 0.0
    for axis in range(2):
        constant += 0.5 * w * need.moment[k, axis] ** 2
    for i in range(n):
        qp.gradient[i] = -w * (shift[0, i] * need.moment[k, 0] + shift[1, i] * need.moment[k, 1])
        for j in range(i + 1):
            qp.hessian[i, j] = w * (shift[0, i] * shift[0, j] + shift[1, i] * shift[1, j])
        qp.hessian[i, i] += grips.normal_price if i % 3 == 2 else grips.tangent_price
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
        price = grips.normal_price if i % 3 == 2 else grips.tangent_price
        cost += 0.5 * qp.x[i] * (price * qp.x[i] + product)
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
def to_world(forces: Vector, coordinates: Vector, axes: Vector, unit: float) -> None:
    """Write a force's three leading `coordinates` in the frame `axes` (3, 3) as `forces` (3,) in world, × `unit`."""
    for j in range(3):
        forces[j] = unit * (coordinates[0] * axes[0, j] + coordinates[1] * axes[1, j] + coordinates[2] * axes[2, j])
