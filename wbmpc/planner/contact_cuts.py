"""What the multipliers of one set of contacts say of every other set: the bounds behind stage 3's enumeration.

The rows that contacts share at a knot, shift equalities and polygon, have multipliers y and λ. For *any* y and λ ≥ 0,
the Lagrangian, minimised over the forces, bounds the knot's cost from below, and there each contact answers for itself:

  cost of a set  ≥  −yᵀh − |y|²/(2 w_s) − λᵀq  +  Σ over its contacts i of  min over cone and cap of  ½ fᵀ W f + g_iᵀ f
  with  g_i = (p_z α, β − αᵀ p_xy) in world,   α = y + Σ_e λ_e A_e,   β = yᵀ (Z_nc + ΔZ) + Σ_e λ_e b_e,

with equality for the set that y and λ are the multipliers of (generalised Benders cuts, Geoffrion 1972, whose master
problem is a table of sets). When a set cannot give the need, its λ proves it, and perhaps for others as well: no
forces of theirs reach Σ_i g_iᵀ f_i ≤ λᵀ q either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.knot_qp import Grips, KnotNeeds, KnotRoom
from wbmpc.planner.support import MAX_EDGES
from wbmpc.signals import Vector

PROOF = 1e-11  # [m] by which an infeasible set misses a polygon row, at least


class SetTable(NamedTuple):
    """Up to s sets of one or two of n options."""

    first: NDArray[np.int64]  # (s,)
    second: NDArray[np.int64]  # (s,) -1: none
    bound: Vector  # (s,) lower bound of its cost; inf once it is known or cannot give the need
    alpha: Vector  # (knots, 2) [cost / m] the present cut
    beta: Vector  # (knots,) [cost]
    share: Vector  # (n,) [cost] of each option in the cut
    price: Vector  # (n,) [cost] w_i, zero for what is held


@kernel
def empty_table(options: int, knots: int) -> SetTable:
    """Room for every option and every pair of a left and a right hand's."""
    sets = options + options * options // 4
    return SetTable(
        np.zeros(sets, dtype=np.int64), np.zeros(sets, dtype=np.int64), np.zeros(sets),
        np.zeros((knots, 2)), np.zeros(knots), np.zeros(options), np.zeros(options),
    )  # fmt: skip


@kernel
def collect_multipliers(table: SetTable, room: KnotRoom, need: KnotNeeds, k: int, slack_price: float) -> float:
    """Take knot `k`'s multipliers over into α and β, those of the knot just solved: the part −yᵀh − … of the bound."""
    pull, multiplier = room.pull, room.qp.multiplier
    constant = 0.0
    table.beta[k] = 0.0
    for axis in range(2):
        table.alpha[k, axis] = pull[axis]
        table.beta[k] += pull[axis] * need.centre[k, axis]
        constant -= pull[axis] * (need.moment[k, axis] + 0.5 * pull[axis] / slack_price)
    return constant - _add_polygon(table, multiplier, need, k)


@kernel
def cut_by_optimum(table: SetTable, sets: int, constant: float, need: KnotNeeds, grips: Grips) -> None:
    """Raise the bounds of all sets by the multipliers collected at every knot."""
    for i in range(len(table.share)):
        table.share[i] = table.price[i]
        for k in range(len(need.height)):
            x, y, z = _gradient(table, need, k, grips, i)
            table.share[i] += _least_cost(
                x, y, z, grips.tangent_price, grips.normal_price, grips.slope[i], grips.cap[i]
            )
    for s in range(sets):
        bound = constant + table.share[table.first[s]]
        if table.second[s] >= 0:
            bound += table.share[table.second[s]]
        table.bound[s] = max(table.bound[s], bound)


@kernel
def cut_by_infeasibility(table: SetTable, sets: int, room: KnotRoom, need: KnotNeeds, k: int, grips: Grips) -> None:
    """Dismiss all sets that the proof just found, of a set that cannot give the need at knot `k`, applies to."""
    table.alpha[k] = 0.0
    table.beta[k] = 0.0
    reach = _add_polygon(table, room.qp.multiplier, need, k)
    for i in range(len(table.share)):
        x, y, z = _gradient(table, need, k, grips, i)
        table.share[i] = grips.cap[i] * min(z - grips.slope[i] * (abs(x) + abs(y)), 0.0)  # at a corner of the pyramid
    scale = 0.0
    for e in range(MAX_EDGES):
        scale += room.qp.multiplier[e]
    for s in range(sets):
        least = table.share[table.first[s]]
        if table.second[s] >= 0:
            least += table.share[table.second[s]]
        if least > reach + PROOF * scale:
            table.bound[s] = np.inf


@kernel
def _add_polygon(table: SetTable, multiplier: Vector, need: KnotNeeds, k: int) -> float:
    """Add the polygon rows to α and β of knot `k`: λᵀ q."""
    product = 0.0
    for e in range(MAX_EDGES):
        table.alpha[k, 0] += multiplier[e] * need.normals[k, e, 0]
        table.alpha[k, 1] += multiplier[e] * need.normals[k, e, 1]
        table.beta[k] += multiplier[e] * need.offsets[k, e]
        product += multiplier[e] * need.room[k, e]
    return product


@kernel
def _gradient(table: SetTable, need: KnotNeeds, k: int, grips: Grips, i: int) -> tuple[float, float, float]:
    """g_i at knot `k` in the contact's frame."""
    position, axes = grips.position[i], grips.axes[i]
    lever = position[2] - need.height[k]
    x, y = lever * table.alpha[k, 0], lever * table.alpha[k, 1]
    z = table.beta[k] - table.alpha[k, 0] * position[0] - table.alpha[k, 1] * position[1]
    return (
        axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z,
        axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z,
        axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z,
    )


@kernel
def _least_cost(x: float, y: float, z: float, tangent: float, normal: float, slope: float, cap: float) -> float:
    """Minimum of ½ (a t₁² + a t₂² + b n²) + x t₁ + y t₂ + z n over |t| ≤ slope n, n ≤ cap.

    The best tangents for a given n are −x/a and −y/a, or the cone's side where that is nearer: what is left is convex
    and piecewise quadratic in n, its slope continuous, with a bend where each tangent leaves the side.
    """
    far, near = max(abs(x), abs(y)), min(abs(x), abs(y))
    pull = slope * (far + near) - z  # the slope at n = 0, reversed
    if pull <= 0.0:
        return 0.0
    side = tangent * slope  # on the side while |x| > a slope n
    n = pull / (normal + 2.0 * side * slope)
    if side * n > near:
        n = (slope * far - z) / (normal + side * slope)
        if side * n > far:
            n = -z / normal
    n = min(n, cap)
    cost = n * (0.5 * normal * n + z)
    for force in (far, near):
        t = min(slope * n, force / tangent)
        cost += t * (0.5 * tangent * t - force)
    return cost
