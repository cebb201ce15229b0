"""The horizontal half of stage 2: jerks of the CoM, footsteps and the ZMP shift ΔZ ([M] eq. formul, Herdt)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from wbmpc.planner.horizontal_answer import ask_for_shifts, read_motion
from wbmpc.planner.horizontal_kernel import (
    Costs,
    End,
    FreeMotion,
    HalfPlanes,
    Matrices,
    Slots,
    look_ahead,
    write_costs,
    write_rows,
)
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.qp import QpSolution, QpWorkspace, QuadraticProgram, make_workspace
from wbmpc.qp.solution import failed
from wbmpc.signals import SolveStatus, Vector

LARGEST_SHIFT = 1.0  # [m] bound on |ΔZ|
SIDES = (4, 6, MAX_EDGES)  # of the polygons: problems of three sizes
NO_SLOTS = (Slots(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)), np.empty(0))
ROUNDS = 20  # of asking for further shifts; three are rare


@dataclass(frozen=True, slots=True)
class ZmpModel:
    """Z = a c − b c̈ + j over the horizon (see zmp_model.py), the same a, b for both axes."""

    a: Vector  # (N,)
    b: Vector  # (N,)
    offset: Vector  # (N, 2) [m] j


@dataclass(frozen=True, slots=True)
class Motion:
    """The horizontal CoM over the horizon."""

    jerk: Vector  # (N, 2) [m/s³]
    com: Vector  # (N, 2) [m]
    velocity: Vector  # (N, 2) [m/s]
    acceleration: Vector  # (N, 2) [m/s²]
    delta_z: Vector  # (N, 2) [m]
    zmp: Vector  # (N, 2) [m] of the feet: a c − b c̈ + j + ΔZ
    footstep_shift: Vector  # (MAX_FOOTSTEPS, 2) [m] of the coming footsteps from their reference


class HorizontalMotion:
    """The terms of `WholeBodyStage` in jerks, footsteps and ΔZ, given what the first jerks cost the joints.

    Exact, with few variables: footsteps are variables only while one may be moved, and ΔZ only where it may be worth
    its price p. A soft row's multiplier is λ = w s; without its variable ΔZ_k is 0 at the optimum iff |Σ_e A_ke λ_ke|
    ≤ p on each axis. As long as that fails somewhere the problem is solved again with ΔZ_k there, of the sign that
    pays.
    """

    def __init__(self, preview: Preview, settings: WholeBodySettings, *, backend: str, ask_shift: bool) -> None:
        """`ask_shift`: ΔZ is a variable, or 0."""
        n = preview.steps
        self._preview, self._settings, self._ask = preview, settings, ask_shift
        self._matrices = Matrices(preview.P_ps, preview.P_vs, preview.P_pu, preview.P_vu, preview.P_au)
        self._unmoved = FreeMotion(np.zeros((2, n)), np.zeros((2, n)), np.zeros((n, 2)), np.zeros((n, n)))
        back = settings.velocity_cost * preview.P_vu.T @ preview.P_vu
        back += settings.position_cost * preview.P_pu.T @ preview.P_pu
        weights = (settings.velocity_cost, settings.position_cost, settings.zmp_centre_cost, settings.footstep_cost)
        self._costs = Costs(settings.jerk_cost, *weights, back)
        self._sizes = (0, n // 2, n, 2 * n) if ask_shift else (0,)
        self._problems: dict[tuple[int, int, int], QuadraticProgram] = {}
        self._workspaces: dict[tuple[int, int, int], QpWorkspace] = {}
        for key in product((0, MAX_FOOTSTEPS), self._sizes, SIDES):
            self._problems[key] = self._problem(*key)
            self._workspaces[key] = make_workspace(backend, self._problems[key])
        self._signs = np.zeros((n, 2))  # of the ΔZ that are variables, first guess for the next plan

    def _problem(self, footsteps: int, slots: int, sides: int) -> QuadraticProgram:
        """A problem for polygons of at most so many sides, with what never changes in it."""
        n, settings, preview = self._preview.steps, self._settings, self._preview
        soft = [settings.zmp_slack_cost] * (n * sides) + [settings.rest_slack_cost] * sides
        soft += [settings.reach_slack_cost] * (2 * n) + [settings.foot_slack_cost] * (2 * footsteps)
        first = 2 * n + 2 * footsteps
        qp = QuadraticProgram(first + slots, len(soft), soft_weight=soft)
        qp.hessian[first:, first:] = settings.delta_z_cost * np.eye(slots)
        for axis in range(2):
            band = (n + 1) * sides + axis * n
            qp.matrix[band : band + n, axis * n : (axis + 1) * n] = preview.P_pu
        return qp

    def solve(
        self,
        state: Vector,
        *,
        zmp: ZmpModel,
        support: SupportPreview,
        com_band: Vector,
        urgency: float,
        first_gradient: Vector,
        first_curvature: Vector,
    ) -> tuple[Motion | None, QpSolution]:
        """Plan from (2, 3) as in `WholeBodyStage.solve`.

        Args:
            first_gradient, first_curvature: (2,) and (2, 2) of ½ uᵀ H u + gᵀ u, the cost of the first jerks to others.
        """
        settings, matrices, unmoved, n = self._settings, self._matrices, self._unmoved, self._preview.steps
        m = MAX_FOOTSTEPS if support.lower.any() or support.upper.any() else 0
        end = End(zmp.a[-1], zmp.b[-1], zmp.offset[-1])
        edges = HalfPlanes(
            *(support.normals, support.offsets, support.shift),
            *(support.rest_normals, support.rest_offsets, support.rest_shift),
        )
        most = look_ahead(unmoved, matrices, state, zmp.a, zmp.b, zmp.offset, edges)
        sides = next(size for size in SIDES if size >= most)
        price = settings.delta_z_price
        for _ in range(ROUNDS):
            slots, sign = self._slots()
            size = len(sign)
            key = (m, size, sides)
            qp = self._problems[key]
            write_costs(
                *(qp.hessian, qp.gradient, self._costs, matrices, unmoved),
                *(support.com_velocity, support.com_reference, support.centres, support.centring, support.shift),
                *(m, urgency, first_curvature, first_gradient),
            )
            write_rows(qp.matrix, qp.lower, qp.upper, matrices, unmoved, end, edges, com_band, m, slots, sides)
            if m:
                self._footsteps(qp, support)
            if size:
                first = 2 * n + 2 * m
                qp.gradient[first:] = price * sign
                qp.x_lower[first:] = np.where(sign > 0.0, 0.0, -LARGEST_SHIFT)
                qp.x_upper[first:] = np.where(sign < 0.0, 0.0, LARGEST_SHIFT)
            solution = self._workspaces[key].solve()
            if solution.status != SolveStatus.SOLVED:
                return None, solution
            courses, steps = np.empty((6, n, 2)), np.empty((MAX_FOOTSTEPS, 2))
            read_motion(courses, steps, solution.x, state, matrices, unmoved, m, slots)
            if not self._ask or not ask_for_shifts(
                *(self._signs, price, courses, steps, end, edges),
                *(settings.zmp_slack_cost, settings.rest_slack_cost),
            ):
                jerk, com, velocity, acceleration, delta_z, zmp_course = courses
                return Motion(jerk, com, velocity, acceleration, delta_z, zmp_course, steps), solution
        self._signs[:] = 0.0
        return None, failed(qp, SolveStatus.ITERATION_LIMIT, ROUNDS, solution.solve_time)

    def _slots(self) -> tuple[Slots, Vector]:
        """The slots that hold the ΔZ asked for, and their signs; 0 of an unused one, a variable on its own."""
        if not self._signs.any():
            return NO_SLOTS
        knots, axes = np.nonzero(self._signs)
        count = len(knots)
        size = next(size for size in self._sizes if size >= count)
        slots, sign = Slots(np.full(size, -1), np.zeros(size, dtype=np.int64)), np.zeros(size)
        slots.knots[:count], slots.axes[:count], sign[:count] = knots, axes, self._signs[knots, axes]
        return slots, sign

    def _footsteps(self, qp: QuadraticProgram, support: SupportPreview) -> None:
        """Where the coming footsteps may be: beside the one before, and within the swing foot's reach in time."""
        m, first = MAX_FOOTSTEPS, 2 * self._preview.steps
        last_rows = slice(qp.rows - 2 * m, qp.rows)
        rows = qp.matrix[last_rows].reshape(m, 2, -1)
        each = np.arange(m)
        for axis in range(2):
            columns = first + axis * m + each
            rows[each, :, columns] = support.placement_axes[:, :, axis]
            rows[each[1:], :, columns[:-1]] = -support.placement_axes[1:, :, axis]
        qp.lower[last_rows] = support.placement_lower.ravel()
        qp.upper[last_rows] = support.placement_upper.ravel()
        steps = slice(first, first + 2 * m)
        qp.x_lower[steps], qp.x_upper[steps] = support.lower.T.ravel(), support.upper.T.ravel()
