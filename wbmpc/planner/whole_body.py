"""Stage 2: horizontal CoM jerks, the ZMP shift ΔZ and whole-body joint velocities in one QP ([M] eq. formul)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import MAX_EDGES, SupportPolygon
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.signals import SolveStatus, Vector

FOOT_ROWS = 12  # two soles, six rows each


@dataclass(frozen=True, slots=True)
class ZmpModel:
    """Z = a c − b c̈ + j over the horizon (see `Preview.zmp_gains`), the same a, b for both axes."""

    a: Vector  # (N,)
    b: Vector  # (N,)
    offset: Vector  # (N, 2) [m] j


@dataclass(frozen=True, slots=True)
class VelocityTasks:
    """What stage 2's joint velocities q̇ should do now, linearised at the planner's own configuration."""

    com_jacobian: Vector  # (3, nv) in world
    com_correction: Vector  # (3,) [m/s] added to the planned CoM velocity: closes the loop of the joint reference
    com_vertical_velocity: float  # [m/s] stage 1's ċ_z
    foot_jacobian: Vector  # (12, nv) left then right sole, linear then angular
    foot_velocity: Vector  # (12,) [m/s, rad/s] zero for a stance foot
    hand_jacobian: Vector  # (6, nv) left then right palm, linear
    hand_velocity: Vector  # (6,) [m/s]
    hand_active: Vector  # (2,) 1 for a hand with a reference, else 0
    torso_jacobian: Vector  # (3, nv) angular
    torso_velocity: Vector  # (3,) [rad/s] towards upright
    posture_velocity: Vector  # (nv,) [rad/s] towards the nominal posture; base entries zero
    lower: Vector  # (nv,) [m/s, rad/s] bounds on q̇ from joint speed and position limits
    upper: Vector  # (nv,)


@dataclass(frozen=True, slots=True)
class HorizontalPlan:
    """Stage 2's answer."""

    jerk: Vector  # (N, 2) [m/s³]
    com: Vector  # (N, 2) [m]
    velocity: Vector  # (N, 2) [m/s]
    acceleration: Vector  # (N, 2) [m/s²]
    delta_z: Vector  # (N, 2) [m]
    zmp: Vector  # (N, 2) [m] of the feet: a c − b c̈ + j + ΔZ
    joint_velocity: Vector  # (nv,) [m/s, rad/s] q̇ in Pinocchio's tangent coordinates


class WholeBodyStage:
    """minimise  α₁|U|² + α₂|ΔZ|² + α₃|q̇ − q̇_posture|² + α₄|J_com q̇ − ċ|² + α₅ Σ|J_hand q̇ − V_hand|²
                 + w_v|Ċ|² + w_p|C − C_ref|² + w_t|J_torso q̇ − ω_up|²

    over x = (U_x, U_y, ΔZ_x, ΔZ_y (N each), q̇ (nv)), subject to

        A_k (Z_k + ΔZ_k) ≤ b_k          ZMP in the support polygon of knot k ([M] eq. ZMP-constraint), soft
        A_N (a (c_N + √(b/a) ċ_N) + j + ΔZ_N) ≤ b_N   the plan can come to rest at its end, soft
        |R_k − C_k| ≤ d                 reach of each active hand, per axis, soft
        J_foot q̇ = v_foot               stance feet stay, swing feet follow
        q̇_low ≤ q̇ ≤ q̇_high, |ΔZ| ≤ ΔZ_max.

    ċ is the velocity of the first knot's plan at the end of `velocity_time`, so jerks and q̇ agree. All norms are
    weighted squares; the last three cost terms are not printed in the paper (damping, a weak pull, upright torso), nor
    is the row at the end of the horizon: without it a plan may keep every ZMP and still be falling over at knot N.
    """

    def __init__(self, preview: Preview, velocities: int, settings: WholeBodySettings, *, backend: str) -> None:
        n, nv = preview.steps, velocities
        self._preview, self._settings, self._nv = preview, settings, nv
        self._zmp_rows = slice(0, n * MAX_EDGES)
        self._reach_rows = slice(n * MAX_EDGES, n * MAX_EDGES + 4 * n)  # left x, left y, right x, right y
        self._foot_rows = slice(n * MAX_EDGES + 4 * n, n * MAX_EDGES + 4 * n + FOOT_ROWS)
        self._rest_rows = slice(self._foot_rows.stop, self._foot_rows.stop + MAX_EDGES)
        rows = self._rest_rows.stop
        soft = np.zeros(rows)
        soft[self._rest_rows] = settings.rest_slack_cost
        soft[self._zmp_rows] = settings.zmp_slack_cost
        soft[self._reach_rows] = settings.reach_slack_cost
        self.problem = QuadraticProgram(4 * n + nv, rows, soft_weight=soft)
        self._u, self._dz, self._qd = slice(0, 2 * n), slice(2 * n, 4 * n), slice(4 * n, 4 * n + nv)
        self._jerk_hessian = settings.jerk_cost * np.eye(n)
        self._return_hessian = (
            settings.velocity_cost * preview.P_vu.T @ preview.P_vu
            + settings.position_cost * preview.P_pu.T @ preview.P_pu
        )
        self.problem.hessian[self._dz, self._dz] = settings.delta_z_cost * np.eye(2 * n)
        for axis in range(2):
            block = slice(axis * n, (axis + 1) * n)
            for hand in range(2):
                first = self._reach_rows.start + (2 * hand + axis) * n
                self.problem.matrix[first : first + n, block] = preview.P_pu
        self._knots = np.arange(n)
        self._workspace = make_workspace(backend, self.problem)

    def solve(
        self,
        state: Vector,
        *,
        zmp: ZmpModel,
        polygons: tuple[SupportPolygon, ...],
        com_reference: Vector,
        reach: Vector,
        reach_distance: Vector,
        delta_z_limit: float,
        tasks: VelocityTasks,
        velocity_time: float,
        urgency: float,
    ) -> tuple[HorizontalPlan | None, QpSolution]:
        """Plan from the horizontal CoM state (2, 3): rows x, y; columns c, ċ, c̈ [m, m/s, m/s²].

        Args:
            zmp: the ZMP's model over the horizon, known contact forces included (the paper's case a).
            polygons: support polygon of each knot, N of them.
            com_reference: (N, 2) weak position reference [m].
            reach: (2, N, 2) hand references R [m]; nan rows are not bounded.
            reach_distance: (2, 2) d per hand and axis [m].
            delta_z_limit: bound on |ΔZ| per axis [m]: large to ask whether a contact is needed, 0 to execute.
            tasks: see `VelocityTasks`.
            urgency: factor ≥ 1 on the costs of CoM velocity and position: how fast to come to rest.
            velocity_time: when the CoM velocity that q̇ should meet is taken [s after the state], < T.

        Returns:
            The plan, or None when the solve failed (the solution carries the status).
        """
        n, qp, preview, settings = self._preview.steps, self.problem, self._preview, self._settings
        P_zs, P_zu = preview.zmp_matrices(zmp.a, zmp.b)
        free = state @ preview.P_ps.T  # (2, N) positions without jerk
        free_velocity = state @ preview.P_vs.T
        free_zmp = P_zs @ state.T + zmp.offset  # (N, 2)

        # cost of the jerks and of q̇, coupled by the CoM velocity at velocity_time
        tau = velocity_time
        gain = tau**2 / 2  # dċ(τ) / d(first jerk)
        J = tasks.com_jacobian
        H_qd = qp.hessian[self._qd, self._qd]
        w_com = settings.com_velocity_cost
        w_hand = settings.hand_velocity_cost * np.repeat(tasks.hand_active, 3)
        H_qd[:] = w_com * (J.T @ J)
        H_qd += (tasks.hand_jacobian.T * w_hand) @ tasks.hand_jacobian
        H_qd += settings.torso_cost * (tasks.torso_jacobian.T @ tasks.torso_jacobian)
        H_qd[np.diag_indices(self._nv)] += settings.joint_velocity_cost
        wanted = state[:, 1] + tau * state[:, 2] + tasks.com_correction[:2]  # ċ_xy without jerk
        wanted_z = tasks.com_vertical_velocity + tasks.com_correction[2]
        qp.gradient[self._qd] = -(
            w_com * (J[:2].T @ wanted + J[2] * wanted_z)
            + tasks.hand_jacobian.T @ (w_hand * tasks.hand_velocity)
            + settings.torso_cost * (tasks.torso_jacobian.T @ tasks.torso_velocity)
            + settings.joint_velocity_cost * tasks.posture_velocity
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
                settings.velocity_cost * (preview.P_vu.T @ free_velocity[axis])
                + settings.position_cost * (preview.P_pu.T @ (free[axis] - com_reference[:, axis]))
            )
            qp.gradient[first] += w_com * gain * wanted[axis]

        # ZMP rows: edge-major within a knot
        rows = qp.matrix[self._zmp_rows].reshape(n, MAX_EDGES, -1)
        A = np.array([polygon.normals for polygon in polygons])  # (N, edges, 2)
        offsets = np.array([polygon.offsets for polygon in polygons])
        np.multiply(A[:, :, :1], P_zu[:, None, :], out=rows[:, :, :n])
        np.multiply(A[:, :, 1:], P_zu[:, None, :], out=rows[:, :, n : 2 * n])
        rows[self._knots, :, 2 * n + self._knots] = A[:, :, 0]
        rows[self._knots, :, 3 * n + self._knots] = A[:, :, 1]
        qp.upper[self._zmp_rows] = (offsets - np.einsum("kei,ki->ke", A, free_zmp)).ravel()

        # capture point of the last knot
        tau_end = np.sqrt(zmp.b[-1] / zmp.a[-1])
        gain_end = zmp.a[-1] * (preview.P_pu[-1] + tau_end * preview.P_vu[-1])
        rest = qp.matrix[self._rest_rows]
        np.multiply(A[-1, :, :1], gain_end, out=rest[:, :n])
        np.multiply(A[-1, :, 1:], gain_end, out=rest[:, n : 2 * n])
        rest[:, 3 * n - 1], rest[:, 4 * n - 1] = A[-1, :, 0], A[-1, :, 1]
        free_rest = zmp.a[-1] * (free[:, -1] + tau_end * free_velocity[:, -1]) + zmp.offset[-1]
        qp.upper[self._rest_rows] = offsets[-1] - A[-1] @ free_rest

        # reach rows: |R - C| <= d
        gap = reach.transpose(0, 2, 1) - free  # (hand, axis, N)
        bounded, distance = np.isfinite(gap), reach_distance[:, :, None]
        qp.lower[self._reach_rows] = np.where(bounded, gap - distance, -np.inf).ravel()
        qp.upper[self._reach_rows] = np.where(bounded, gap + distance, np.inf).ravel()

        qp.matrix[self._foot_rows, self._qd] = tasks.foot_jacobian
        qp.lower[self._foot_rows] = qp.upper[self._foot_rows] = tasks.foot_velocity
        qp.x_lower[self._u], qp.x_upper[self._u] = -np.inf, np.inf
        qp.x_lower[self._dz], qp.x_upper[self._dz] = -delta_z_limit, delta_z_limit
        qp.x_lower[self._qd], qp.x_upper[self._qd] = tasks.lower, tasks.upper

        solution = self._workspace.solve()
        if solution.status != SolveStatus.SOLVED:
            return None, solution
        x = solution.x
        jerk = x[self._u].reshape(2, n)
        delta_z = x[self._dz].reshape(2, n).T.copy()
        return (
            HorizontalPlan(
                jerk=jerk.T.copy(),
                com=(free + jerk @ preview.P_pu.T).T,
                velocity=(free_velocity + jerk @ preview.P_vu.T).T,
                acceleration=(state @ preview.P_as.T + jerk @ preview.P_au.T).T,
                delta_z=delta_z,
                zmp=free_zmp + P_zu @ jerk.T + delta_z,
                joint_velocity=x[self._qd].copy(),
            ),
            solution,
        )
