"""The horizontal half of stage 2: jerks of the CoM, footsteps and the ZMP shift ΔZ ([M] eq. formul, Herdt)."""

from __future__ import annotations

from bisect import bisect_left
from itertools import product

import numpy as np

from wbmpc.planner.horizontal_answer import read_answer
from wbmpc.planner.horizontal_kernel import Costs, FreeMotion, Matrices
from wbmpc.planner.horizontal_problem import size_of_problem, write_problem
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.qp import QpSolution, QpWorkspace, QuadraticProgram, make_workspace
from wbmpc.qp.solution import failed
from wbmpc.record import record
from wbmpc.signals import SolveStatus, Vector

SIDES = (4, 6, MAX_EDGES)  # of the polygons: problems of three sizes
ROUNDS = 20  # of asking for further shifts; three are rare


@record
class ZmpModel:
    """Z = a c − b c̈ + j over the horizon (see zmp_model.py), the same a, b for both axes."""

    a: Vector  # (N,)
    b: Vector  # (N,)
    offset: Vector  # (N, 2) [m] j


@record
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
        self._matrices = tuple(Matrices(preview.P_ps, preview.P_vs, preview.P_pu, preview.P_vu, preview.P_au))
        self._unmoved = tuple(FreeMotion(np.zeros((2, n)), np.zeros((2, n)), np.zeros((n, 2)), np.zeros((n, n))))
        back = settings.velocity_cost * preview.P_vu.T @ preview.P_vu
        back += settings.position_cost * preview.P_pu.T @ preview.P_pu
        weights = (settings.velocity_cost, settings.position_cost, settings.zmp_centre_cost, settings.footstep_cost)
        self._costs = tuple(Costs(settings.jerk_cost, *weights, settings.delta_z_price, back))
        self._prices = settings.delta_z_price, settings.zmp_slack_cost, settings.rest_slack_cost
        self._sizes = (0, n // 2, n, 2 * n) if ask_shift else (0,)
        self._workspaces: dict[tuple[int, int, int], QpWorkspace] = {}
        for key in product((0, MAX_FOOTSTEPS), self._sizes, SIDES):
            self._workspaces[key] = make_workspace(backend, self._problem(*key))
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
        moved, shifts, most = size_of_problem(
            support.lower, support.upper, support.offsets, support.rest_offsets, self._signs
        )
        m, sides = MAX_FOOTSTEPS if moved else 0, SIDES[bisect_left(SIDES, most)]
        n, matrices, unmoved = self._preview.steps, self._matrices, self._unmoved
        model = (
            *(state, zmp.a, zmp.b, zmp.offset, support.normals, support.offsets, support.shift),
            *(support.rest_normals, support.rest_offsets, support.rest_shift),
        )
        for _ in range(ROUNDS):
            size = self._sizes[bisect_left(self._sizes, shifts)]
            workspace = self._workspaces[m, size, sides]
            qp = workspace.problem
            write_problem(
                *(qp.hessian, qp.gradient, qp.matrix, qp.all_lower, qp.all_upper),
                *(unmoved, matrices, self._costs),
                *model,
                *(support.com_velocity, support.com_reference, support.centres, support.centring),
                *(support.placement_axes, support.placement_lower, support.placement_upper),
                support.lower,
                support.upper,
                com_band,
                urgency,
                first_curvature,
                first_gradient,
                self._signs,
                m,
                size,
                sides,
            )
            solution = workspace.solve()
            if solution.status != SolveStatus.SOLVED:
                return None, solution
            courses, steps = np.empty((6, n, 2)), np.empty((MAX_FOOTSTEPS, 2))
            if not read_answer(
                *(solution.x, courses, steps, unmoved, matrices),
                *model,
                self._ask,
                self._signs,
                *self._prices,
                m,
                size,
            ):
                jerk, com, velocity, acceleration, delta_z, zmp_course = courses
                return Motion(jerk, com, velocity, acceleration, delta_z, zmp_course, steps), solution
            shifts = int(np.count_nonzero(self._signs))
        self._signs[:] = 0.0
        return None, failed(qp, SolveStatus.ITERATION_LIMIT, ROUNDS, solution.solve_time)
