"""Stage 2 as one QP, in plain numpy: what its split into CoM and joints must not change.

Variables x = (U_x, U_y (N each), F − F_ref (x, y of MAX_FOOTSTEPS), q̇ (nv), ΔZ⁺, ΔZ⁻ (2N each)), ΔZ = ΔZ⁺ − ΔZ⁻.
"""

from __future__ import annotations

import numpy as np

from wbmpc.planner.horizontal_motion import ZmpModel
from wbmpc.planner.horizontal_problem import LARGEST_SHIFT
from wbmpc.planner.joint_velocities import FOOT_ROWS, VelocityTasks
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.whole_body import HorizontalPlan
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.signals import SolveStatus, Vector


class JointForm:
    """The QP of `wbmpc.planner.whole_body.WholeBodyStage`, unsplit."""

    def __init__(
        self, preview: Preview, velocities: int, settings: WholeBodySettings, *, backend: str, ask_shift: bool
    ) -> None:
        """`ask_shift`: ΔZ is a variable (to ask whether a contact is needed), or 0 (to execute)."""
        n, nv, m = preview.steps, velocities, MAX_FOOTSTEPS
        self._preview, self._settings, self._nv, self._ask = preview, settings, nv, ask_shift
        self._zmp_rows = slice(0, n * MAX_EDGES)
        self._rest_rows = slice(self._zmp_rows.stop, self._zmp_rows.stop + MAX_EDGES)
        self._band_rows = slice(self._rest_rows.stop, self._rest_rows.stop + 2 * n)
        self._step_rows = slice(self._band_rows.stop, self._band_rows.stop + 2 * m)
        self._foot_rows = slice(self._step_rows.stop, self._step_rows.stop + FOOT_ROWS)
        soft = np.zeros(self._foot_rows.stop)
        soft[self._zmp_rows] = settings.zmp_slack_cost
        soft[self._rest_rows] = settings.rest_slack_cost
        soft[self._band_rows] = settings.reach_slack_cost
        soft[self._step_rows] = soft[self._foot_rows] = settings.foot_slack_cost
        self._u, self._steps = slice(0, 2 * n), slice(2 * n, 2 * n + 2 * m)
        self._qd = slice(self._steps.stop, self._steps.stop + nv)
        shifts = slice(self._qd.stop, self._qd.stop + (4 * n if ask_shift else 0))
        self._plus, self._minus = slice(shifts.start, shifts.start + 2 * n), slice(shifts.start + 2 * n, shifts.stop)
        qp = self.problem = QuadraticProgram(shifts.stop, self._foot_rows.stop, soft_weight=soft)
        self._jerk_hessian = settings.jerk_cost * np.eye(n)
        self._return_hessian = (
            settings.velocity_cost * preview.P_vu.T @ preview.P_vu
            + settings.position_cost * preview.P_pu.T @ preview.P_pu
        )
        qp.hessian[self._steps, self._steps] = settings.footstep_cost * np.eye(2 * m)
        qp.hessian[shifts, shifts] = settings.delta_z_cost * np.eye(shifts.stop - shifts.start)
        qp.gradient[shifts] = settings.delta_z_price
        qp.x_lower[self._u], qp.x_upper[self._u] = -np.inf, np.inf
        qp.x_lower[shifts], qp.x_upper[shifts] = 0.0, LARGEST_SHIFT
        for axis in range(2):
            first = self._band_rows.start + axis * n
            qp.matrix[first : first + n, axis * n : (axis + 1) * n] = preview.P_pu
        self._knots = np.arange(n)
        self._workspace = make_workspace(backend, qp)

    def solve(
        self,
        state: Vector,
        *,
        zmp: ZmpModel,
        support: SupportPreview,
        com_band: Vector,
        tasks: VelocityTasks,
        velocity_time: float,
        urgency: float,
    ) -> tuple[HorizontalPlan | None, QpSolution]:
        """As `WholeBodyStage.solve`."""
        n, qp, preview = self._preview.steps, self.problem, self._preview
        P_zs, P_zu = preview.zmp_matrices(zmp.a, zmp.b)
        free = state @ preview.P_ps.T  # (2, N) positions without jerk
        free_velocity = state @ preview.P_vs.T
        free_zmp = P_zs @ state.T + zmp.offset  # (N, 2)
        self._costs(state, free, free_velocity, support, tasks, velocity_time, urgency)
        if support.centring.any():
            self._centring(P_zu, free_zmp, support)
        else:
            m = self._steps
            qp.hessian[m, : m.start] = qp.hessian[: m.start, m] = 0.0
            qp.hessian[m, m] = self._settings.footstep_cost * np.eye(2 * MAX_FOOTSTEPS)
            qp.gradient[m] = 0.0
        self._support_rows(zmp, P_zu, free, free_velocity, free_zmp, support)

        gap = com_band - free[:, :, None]
        qp.lower[self._band_rows], qp.upper[self._band_rows] = gap[:, :, 0].ravel(), gap[:, :, 1].ravel()
        self._footsteps(support)
        qp.matrix[self._foot_rows, self._qd] = tasks.foot_jacobian
        qp.lower[self._foot_rows] = qp.upper[self._foot_rows] = tasks.foot_velocity
        qp.x_lower[self._qd], qp.x_upper[self._qd] = tasks.lower, tasks.upper

        solution = self._workspace.solve()
        if solution.status != SolveStatus.SOLVED:
            return None, solution
        x = solution.x
        jerk = x[self._u].reshape(2, n)
        delta_z = (x[self._plus] - x[self._minus]).reshape(2, n).T if self._ask else np.zeros((n, 2))
        steps = x[self._steps].reshape(2, MAX_FOOTSTEPS).T.copy()
        return (
            HorizontalPlan(
                jerk=jerk.T.copy(),
                com=(free + jerk @ preview.P_pu.T).T,
                velocity=(free_velocity + jerk @ preview.P_vu.T).T,
                acceleration=(state @ preview.P_as.T + jerk @ preview.P_au.T).T,
                delta_z=delta_z,
                zmp=free_zmp + P_zu @ jerk.T + delta_z,
                footstep_shift=steps,
                joint_velocity=x[self._qd].copy(),
            ),
            solution,
        )

    def _costs(
        self,
        state: Vector,
        free: Vector,
        free_velocity: Vector,
        support: SupportPreview,
        tasks: VelocityTasks,
        tau: float,
        urgency: float,
    ) -> None:
        """Cost of the jerks and of q̇, coupled by the CoM velocity at `tau` [s]."""
        n, qp, preview, settings = self._preview.steps, self.problem, self._preview, self._settings
        gain = tau**2 / 2  # dċ(τ) / d(first jerk)
        J = tasks.com_jacobian
        H_qd = qp.hessian[self._qd, self._qd]
        w_com = settings.com_velocity_cost
        w_hand = settings.hand_velocity_cost * np.repeat(tasks.hand_active, 3)
        H_qd[:] = w_com * (J.T @ J)
        H_qd += (tasks.hand_jacobian.T * w_hand) @ tasks.hand_jacobian
        H_qd += settings.torso_cost * (tasks.torso_jacobian.T @ tasks.torso_jacobian)
        joint_cost = settings.joint_velocity_cost * tasks.posture_weight
        H_qd[np.diag_indices(self._nv)] += joint_cost
        wanted = state[:, 1] + tau * state[:, 2] + tasks.com_correction[:2]  # ċ_xy without jerk
        wanted_z = tasks.com_vertical_velocity + tasks.com_correction[2]
        qp.gradient[self._qd] = -(
            w_com * (J[:2].T @ wanted + J[2] * wanted_z)
            + tasks.hand_jacobian.T @ (w_hand * tasks.hand_velocity)
            + settings.torso_cost * (tasks.torso_jacobian.T @ tasks.torso_velocity)
            + joint_cost * tasks.posture_velocity
        )
        for axis in range(2):
            block = slice(axis * n, (axis + 1) * n)
            qp.hessian[block, block] = self._jerk_hessian + urgency * self._return_hessian
            first = axis * n
            qp.hessian[first, first] += w_com * gain**2
            cross = -w_com * gain * J[axis]  # (nv,)
            qp.hessian[first, self._qd] = cross
            qp.hessian[self._qd, first] = cross
            qp.gradient[block] = urgency * (
                settings.velocity_cost * (preview.P_vu.T @ (free_velocity[axis] - support.com_velocity[:, axis]))
                + settings.position_cost * (preview.P_pu.T @ (free[axis] - support.com_reference[:, axis]))
            )
            qp.gradient[first] += w_com * gain * wanted[axis]

    def _centring(self, P_zu: Vector, free_zmp: Vector, support: SupportPreview) -> None:
        """Add  w_z Σ s_k |Z_k − S_k (F − F_ref) − centre_k|²  to the costs of jerks and footsteps."""
        n, m, qp = self._preview.steps, MAX_FOOTSTEPS, self.problem
        weight = self._settings.zmp_centre_cost * support.centring
        weighted = P_zu.T * weight  # (N jerks, N knots)
        own, cross = weighted @ P_zu, -weighted @ support.shift
        steps = (support.shift.T * weight) @ support.shift + self._settings.footstep_cost * np.eye(m)
        error = free_zmp - support.centres  # (N, 2)
        for axis in range(2):
            jerks = slice(axis * n, (axis + 1) * n)
            footsteps = slice(self._steps.start + axis * m, self._steps.start + (axis + 1) * m)
            qp.hessian[jerks, jerks] += own
            qp.hessian[jerks, footsteps], qp.hessian[footsteps, jerks] = cross, cross.T
            qp.hessian[footsteps, footsteps] = steps
            qp.gradient[jerks] += weighted @ error[:, axis]
            qp.gradient[footsteps] = -(support.shift.T * weight) @ error[:, axis]

    def _support_rows(
        self,
        zmp: ZmpModel,
        P_zu: Vector,
        free: Vector,
        free_velocity: Vector,
        free_zmp: Vector,
        support: SupportPreview,
    ) -> None:
        """ZMP rows, edge-major within a knot, and those of the last knot's capture point."""
        n, m, qp, preview = self._preview.steps, MAX_FOOTSTEPS, self.problem, self._preview
        rows = qp.matrix[self._zmp_rows].reshape(n, MAX_EDGES, -1)
        A = support.normals  # (N, edges, 2)
        steps, plus, minus = self._steps.start, self._plus.start, self._minus.start
        for axis in range(2):
            edges = A[:, :, axis]
            np.multiply(edges[:, :, None], P_zu[:, None, :], out=rows[:, :, axis * n : (axis + 1) * n])
            columns = slice(steps + axis * m, steps + (axis + 1) * m)
            np.multiply(edges[:, :, None], -support.shift[:, None, :], out=rows[:, :, columns])
            if self._ask:
                rows[self._knots, :, plus + axis * n + self._knots] = edges
                rows[self._knots, :, minus + axis * n + self._knots] = -edges
        qp.upper[self._zmp_rows] = (support.offsets - np.einsum("kei,ki->ke", A, free_zmp)).ravel()

        tau_end = np.sqrt(zmp.b[-1] / zmp.a[-1])
        gain_end = zmp.a[-1] * (preview.P_pu[-1] + tau_end * preview.P_vu[-1])
        rest, A = qp.matrix[self._rest_rows], support.rest_normals
        for axis in range(2):
            edges = A[:, axis]
            np.multiply(edges[:, None], gain_end, out=rest[:, axis * n : (axis + 1) * n])
            columns = slice(steps + axis * m, steps + (axis + 1) * m)
            np.multiply(edges[:, None], -support.rest_shift, out=rest[:, columns])
            if self._ask:
                rest[:, plus + (axis + 1) * n - 1], rest[:, minus + (axis + 1) * n - 1] = edges, -edges
        free_rest = zmp.a[-1] * (free[:, -1] + tau_end * free_velocity[:, -1]) + zmp.offset[-1]
        qp.upper[self._rest_rows] = support.rest_offsets - A @ free_rest

    def _footsteps(self, support: SupportPreview) -> None:
        """Where the coming footsteps may be: beside the one before, and within the swing foot's reach in time."""
        m, qp = MAX_FOOTSTEPS, self.problem
        rows = qp.matrix[self._step_rows].reshape(m, 2, -1)
        for j in range(m):
            for axis in range(2):
                column = self._steps.start + axis * m + j
                rows[j, :, column] = support.placement_axes[j, :, axis]
                if j:
                    rows[j, :, column - 1] = -support.placement_axes[j, :, axis]
        qp.lower[self._step_rows] = support.placement_lower.ravel()
        qp.upper[self._step_rows] = support.placement_upper.ravel()
        qp.x_lower[self._steps], qp.x_upper[self._steps] = support.lower.T.ravel(), support.upper.T.ravel()
