"""Stage 3: which available contact to take and with what force, a mixed-integer QP ([M] eqs. neweq, QP2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import MAX_EDGES, SupportPolygon
from wbmpc.qp import QpSolution, QuadraticProgram, make_mip_workspace, make_workspace
from wbmpc.rotations import contact_frame
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SolveStatus, Vector


@dataclass(frozen=True, slots=True)
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
    """Normals (n, MAX_EDGES, 2) and offsets (n, MAX_EDGES) [m]; a padded row says f_z ≤ the feet's weight, roughly."""
    offsets = np.array([polygon.offsets for polygon in need.polygons])
    return np.array([polygon.normals for polygon in need.polygons]), np.where(np.isfinite(offsets), offsets, 1e3)


def cone_rows(patch: PatchPose) -> Vector:
    """Rows (4, 3) of C f ≤ 0: the linearised friction cone in the contact's own frame, inside the true cone."""
    mu = patch.friction / np.sqrt(2.0)
    tangent_1, tangent_2, normal = contact_frame(patch.normal).T
    return np.array([sign * t - mu * normal for t in (tangent_1, tangent_2) for sign in (1.0, -1.0)])


def force_price(patch: PatchPose, settings: ContactSettings, mass: float) -> Vector:
    """Hessian (3, 3) [cost / N²] of one force: the normal part, and the tangential part at its own price."""
    along = np.outer(patch.normal, patch.normal)
    return (settings.force_cost * along + settings.tangent_cost * (np.eye(3) - along)) / (mass * GRAVITY) ** 2


@dataclass(frozen=True, slots=True)
class Choice:
    """Stage 3's answer when it fires."""

    winner: int  # index of the candidate, -1 when none can give the wanted shift
    forces: Vector  # (candidates, knots, 3) [N] in world; only the winner's row is non-zero
    objective: float
    solution: QpSolution


class ContactChoice:
    """minimise  Σ_i w_i H_i + w_f Σ|f|²/(mg)² + w_s |G f − h|²   over forces f_i of every candidate i and binaries H_i

    subject to  n_i·f_i ≤ f_max H_i  (big-M: the force cap),  f_i in its friction cone,  ΣH_i = 1,
                Σ_i P f_i ≤ q        the feet's ZMP inside the support polygon.

    The shift equalities are softened because x and y share one force: a brace that gives ΔZ_x gives a ΔZ_y too, and
    the polygon says how much of it the feet can take. The sums couple the candidates; the problem stays exact.
    """

    KNOTS = 2

    def __init__(self, candidates: int, settings: ContactSettings, *, mass: float, backend: str) -> None:
        self._candidates, self._settings = candidates, settings
        forces = 3 * self.KNOTS * candidates
        knot_rows = 2 + MAX_EDGES
        rows = self.KNOTS * knot_rows + candidates * self.KNOTS * 5 + 1
        soft = np.zeros(rows)
        for knot in range(self.KNOTS):
            # the equality is in N m; the slack's price is per metre of shift
            soft[knot * knot_rows : knot * knot_rows + 2] = settings.shift_slack_cost / (mass * GRAVITY) ** 2
        self.problem = QuadraticProgram(
            forces + candidates, rows, soft_weight=soft, binary=range(forces, forces + candidates)
        )
        self._mass = mass
        self._forces, self._knot_rows = forces, knot_rows
        self._workspace = make_mip_workspace(backend, self.problem)

    def solve(self, need: Need, patches: list[PatchPose], weights: Vector) -> Choice:
        """Choose among `patches` (at most as many as built for) for a need of KNOTS knots.

        Args:
            weights: (len(patches),) w_i, the price of taking candidate i.
        """
        qp, forces, slots = self.problem, self._forces, self._candidates
        qp.matrix[:] = 0.0
        qp.gradient[:] = 0.0
        qp.x_lower[:forces], qp.x_upper[:forces] = -np.inf, np.inf
        qp.x_lower[forces:], qp.x_upper[forces:] = 0.0, 1.0
        # solvers want strict convexity; unused slots and binaries have no curvature of their own
        qp.hessian[:] = 1e-6 * np.eye(forces + slots)
        h, q = shift_bound(need), polygon_bound(need)
        for knot in range(self.KNOTS):
            first = knot * self._knot_rows
            qp.lower[first : first + 2] = qp.upper[first : first + 2] = h[knot]
            qp.lower[first + 2 : first + self._knot_rows] = -np.inf
            qp.upper[first + 2 : first + self._knot_rows] = q[knot]
        row = self.KNOTS * self._knot_rows
        for i in range(slots):
            block = slice(3 * self.KNOTS * i, 3 * self.KNOTS * (i + 1))
            if i >= len(patches):
                qp.x_lower[block] = qp.x_upper[block] = 0.0
                qp.x_upper[forces + i] = 0.0
                qp.lower[row : row + 5 * self.KNOTS], qp.upper[row : row + 5 * self.KNOTS] = -np.inf, 0.0
                row += 5 * self.KNOTS
                continue
            patch = patches[i]
            qp.gradient[forces + i] = weights[i]
            cone = cone_rows(patch)
            price = force_price(patch, self._settings, self._mass)
            G, P = shift_rows(need, patch.position), polygon_rows(need, patch.position)
            for knot in range(self.KNOTS):
                columns = slice(3 * (self.KNOTS * i + knot), 3 * (self.KNOTS * i + knot) + 3)
                first = knot * self._knot_rows
                qp.hessian[columns, columns] = price
                qp.matrix[first : first + 2, columns] = G[knot]
                qp.matrix[first + 2 : first + self._knot_rows, columns] = P[knot]
                qp.matrix[row : row + 4, columns] = cone
                qp.matrix[row + 4, columns] = patch.normal
                qp.matrix[row + 4, forces + i] = -patch.force_cap
                qp.lower[row : row + 5], qp.upper[row : row + 5] = -np.inf, 0.0
                row += 5
        qp.matrix[row, forces:] = 1.0
        qp.lower[row] = qp.upper[row] = 1.0
        solution = self._workspace.solve()
        if solution.status != SolveStatus.SOLVED:
            return Choice(-1, np.zeros((len(patches), self.KNOTS, 3)), np.inf, solution)
        x = solution.x
        return Choice(
            winner=int(np.argmax(x[forces : forces + len(patches)])),
            forces=x[:forces].reshape(slots, self.KNOTS, 3)[: len(patches)].copy(),
            objective=0.5 * float(x @ qp.hessian @ x) + float(qp.gradient @ x),
            solution=solution,
        )


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
        soft[:, 2 : 2 + MAX_EDGES] = 1e4 * settings.shift_slack_cost / (mass * GRAVITY) ** 2
        self.problem = QuadraticProgram(steps * width, rows, soft_weight=soft.ravel())
        self._settings, self._mass = settings, mass
        self.problem.hessian[:] = np.eye(steps * width) * (settings.force_cost / (mass * GRAVITY) ** 2)
        self.problem.gradient[:] = 0.0
        self.problem.x_lower[:], self.problem.x_upper[:] = -np.inf, np.inf
        self.problem.matrix[:] = 0.0
        self._width = width
        self._knots = np.arange(steps)
        self._workspace = make_workspace(backend, self.problem)

    def solve(self, need: Need, patches: list[PatchPose | None], caps: Vector) -> tuple[Vector | None, QpSolution]:
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
