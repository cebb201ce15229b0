"""Stage 3 with the contacts given: what forces do to the feet's ZMP, and the forces at every knot ([M] eq. neweq)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import MAX_EDGES, SupportPolygon
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.record import record
from wbmpc.rotations import contact_frame
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SolveStatus, Vector

PADDING = 1e3  # [m] offset of a padded edge: f_z ≤ the feet's weight
POLYGON_PRICE = 1e4  # of a soft polygon row, in prices of the shift


@record
class Need:
    """The ZMP shift that stage 2 asks for over n knots, and what it takes to turn it into a force."""

    delta_z: Vector  # (n, 2) [m] wanted shift
    zmp: Vector  # (n, 2) [m] Z_nc, the ZMP without contact
    weight: Vector  # (n,) [N] m (g + c̈_z), the feet's vertical force without contact
    polygons: tuple[SupportPolygon, ...]  # n of them
    phantom: Vector  # (n, 2) [N m] 0 for the exact formulation; the paper's extra term m c_z c̈ c̈_z / g otherwise

    def followed_by(self, other: Need) -> Need:
        """The knots of both, this one's first."""
        return Need(
            delta_z=np.vstack([self.delta_z, other.delta_z]),
            zmp=np.vstack([self.zmp, other.zmp]),
            weight=np.concatenate([self.weight, other.weight]),
            polygons=self.polygons + other.polygons,
            phantom=np.vstack([self.phantom, other.phantom]),
        )

    def pick(self, knots: list[int]) -> Need:
        """The same need at some knots only."""
        return Need(
            delta_z=self.delta_z[knots],
            zmp=self.zmp[knots],
            weight=self.weight[knots],
            polygons=tuple(self.polygons[k] for k in knots),
            phantom=self.phantom[knots],
        )

    def inset(self, margin: float) -> Need:
        """The same need with every polygon shrunk by a further `margin` [m]; negative: grown."""
        return replace(self, polygons=tuple(polygon.shrunk(margin) for polygon in self.polygons))


def shift_rows(need: Need, point: Vector) -> Vector:
    """Rows G (n, 2, 3) of G f = h: the force f that gives the wanted ΔZ at each knot; h is `shift_bound`.

    p_z f_xy + (Z_nc − p_xy + ΔZ) f_z = m (g + c̈_z) ΔZ − phantom   ([M] eq. neweq multiplied by p_z, so that
    contacts near the foot plane are no singularity). `point` is p (3,) in world [m].
    """
    G = np.zeros((len(need.zmp), 2, 3))
    G[:, 0, 0] = G[:, 1, 1] = [point[2] - polygon.plane_height for polygon in need.polygons]
    G[:, :, 2] = need.zmp - point[:2] + need.delta_z
    return G


def shift_bound(need: Need) -> Vector:
    """Right-hand side h (n, 2) [N m] of `shift_rows`."""
    return need.weight[:, None] * need.delta_z - need.phantom


def polygon_rows(need: Need, point: Vector) -> Vector:
    """Rows P (n, MAX_EDGES, 3) of P f ≤ q: the feet's ZMP stays in its polygon under f; q is `polygon_bound`.

    A ((m (g + c̈_z)) Z_nc + p_z f_xy − p_xy f_z) ≤ b (m (g + c̈_z) − f_z): the exact ZMP times its denominator,
    which is linear in f because Z_nc belongs to the plan. `point` is p (3,) in world [m].
    """
    A, b = _half_planes(need)
    P = np.empty((*b.shape, 3))
    P[:, :, :2] = A * np.array([point[2] - polygon.plane_height for polygon in need.polygons])[:, None, None]
    P[:, :, 2] = b - A @ point[:2]
    return P


def polygon_bound(need: Need) -> Vector:
    """Right-hand side q (n, MAX_EDGES) [N m] of `polygon_rows`."""
    A, b = _half_planes(need)
    return need.weight[:, None] * (b - np.einsum("kei,ki->ke", A, need.zmp)) - np.einsum("kei,ki->ke", A, need.phantom)


def _half_planes(need: Need) -> tuple[Vector, Vector]:
    """Normals (n, MAX_EDGES, 2) and offsets (n, MAX_EDGES) [m]; a padded row says f_z ≤ the feet's weight."""
    offsets = np.array([polygon.offsets for polygon in need.polygons])
    return np.array([polygon.normals for polygon in need.polygons]), np.where(np.isfinite(offsets), offsets, PADDING)


def cone_rows(patch: PatchPose) -> Vector:
    """Rows (4, 3) of C f ≤ 0: the linearised friction cone in the contact's own frame, inside the true cone."""
    mu = patch.friction / np.sqrt(2.0)
    tangent_1, tangent_2, normal = contact_frame(patch.normal).T
    return np.array([sign * t - mu * normal for t in (tangent_1, tangent_2) for sign in (1.0, -1.0)])


def force_price(patch: PatchPose, settings: ContactSettings, mass: float) -> Vector:
    """Hessian (3, 3) [cost / N²] of one force: the normal part, and the tangential part at its own price."""
    along = np.outer(patch.normal, patch.normal)
    return (settings.force_cost * along + settings.tangent_cost * (np.eye(3) - along)) / (mass * GRAVITY) ** 2


class ContactForce:
    """The forces of the chosen contacts at every knot: stage 3 with H fixed.

    The same objective and constraints as `ContactChoice`, plus a cap per knot that ramps a new contact in and an old
    one out; over `contacts` hands at once. Polygon rows are soft: while a cap ramps, the shift may not be there.
    """

    def __init__(self, steps: int, settings: ContactSettings, *, mass: float, contacts: int, backend: str) -> None:
        self._steps, self._contacts = steps, contacts
        width = 3 * contacts
        self._rows_per_knot = 2 + MAX_EDGES + 5 * contacts
        rows = steps * self._rows_per_knot
        soft = np.zeros((steps, self._rows_per_knot))
        soft[:, :2] = settings.shift_slack_cost / (mass * GRAVITY) ** 2
        soft[:, 2 : 2 + MAX_EDGES] = POLYGON_PRICE * settings.shift_slack_cost / (mass * GRAVITY) ** 2
        self.problem = QuadraticProgram(steps * width, rows, soft_weight=soft.ravel())
        self._settings, self._mass = settings, mass
        self.problem.hessian[:] = np.eye(steps * width) * (settings.force_cost / (mass * GRAVITY) ** 2)
        self.problem.gradient[:] = 0.0
        self.problem.x_lower[:], self.problem.x_upper[:] = -np.inf, np.inf
        self.problem.matrix[:] = 0.0
        self._width = width
        self._knots = np.arange(steps)
        self._workspace = make_workspace(backend, self.problem)

    def solve(self, need: Need, patches: Sequence[PatchPose | None], caps: Vector) -> tuple[Vector | None, QpSolution]:
        """Forces (contacts, steps, 3) [N] in world for the wanted shifts.

        Args:
            patches: one per contact slot; None for an unused slot.
            caps: (contacts, steps) bound on each normal force at each knot [N]; 0 where the contact is not there yet.
        """
        qp, n, width = self.problem, self._steps, self._width
        rows = qp.matrix.reshape(n, self._rows_per_knot, n, width)[
            self._knots, :, self._knots
        ]  # diagonal blocks, a copy
        lower, upper = qp.lower.reshape(n, -1), qp.upper.reshape(n, -1)
        x_lower, x_upper = qp.x_lower.reshape(n, width), qp.x_upper.reshape(n, width)
        rows[:] = 0.0
        shift, polygon = slice(0, 2), slice(2, 2 + MAX_EDGES)
        h, q = shift_bound(need), polygon_bound(need)
        used = np.any(caps > 0.0, axis=0)[:, None]
        lower[:, shift], upper[:, shift] = np.where(used, h, -np.inf), np.where(used, h, np.inf)
        upper[:, polygon] = np.where(used, q, np.inf)
        for slot, patch in enumerate(patches):
            columns = slice(3 * slot, 3 * slot + 3)
            cone = slice(2 + MAX_EDGES + 5 * slot, 7 + MAX_EDGES + 5 * slot)
            free = np.reshape((caps[slot] > 0.0) & (patch is not None), (n, 1))
            x_lower[:, columns], x_upper[:, columns] = np.where(free, -np.inf, 0.0), np.where(free, np.inf, 0.0)
            if patch is None or not free.any():
                continue
            rows[:, shift, columns] = shift_rows(need, patch.position)
            rows[:, polygon, columns] = polygon_rows(need, patch.position)
            rows[:, cone, columns] = np.vstack([cone_rows(patch), patch.normal])
            upper[:, cone] = 0.0
            upper[:, cone.stop - 1] = caps[slot]
            price = force_price(patch, self._settings, self._mass)
            for k in range(n):
                first = k * width + 3 * slot
                qp.hessian[first : first + 3, first : first + 3] = price
        qp.matrix.reshape(n, self._rows_per_knot, n, width)[self._knots, :, self._knots] = rows
        solution = self._workspace.solve()
        if solution.status != SolveStatus.SOLVED:
            return None, solution
        forces = solution.x.reshape(self._steps, self._contacts, 3).transpose(1, 0, 2).copy()
        return forces, solution
