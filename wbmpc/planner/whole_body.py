"""Stage 2: CoM jerks, ZMP shift ΔZ, footsteps and whole-body joint velocities in one QP ([M] eq. formul, Herdt)."""

from __future__ import annotations

from wbmpc.planner.horizontal_motion import HorizontalMotion, Motion, ZmpModel
from wbmpc.planner.joint_velocities import JointVelocities, VelocityTasks
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support_preview import SupportPreview
from wbmpc.qp import QpSolution
from wbmpc.record import record
from wbmpc.signals import Vector

ROUNDS = 5  # between CoM and joints; one or two do, and what is left after five is the backend's own error
SLOPE_TOLERANCE = 1e-6  # [cost / (m/s)] of what a CoM velocity costs the joints: 1e-6 m/s³ of the first jerk


@record
class HorizontalPlan(Motion):
    """Stage 2's answer."""

    joint_velocity: Vector  # (nv,) [m/s, rad/s] q̇ in Pinocchio's tangent coordinates


class WholeBodyStage:
    """minimise  α₁|U|² + α₂|ΔZ|² + p|ΔZ|₁ + α₃|q̇ − q̇_posture|²_W + α₄|J_com q̇ − ċ|² + α₅ Σ|J_hand q̇ − V_hand|²
                 + w_v|Ċ − V_ref|² + w_p|C − C_ref|² + w_f|F − F_ref|² + w_t|J_torso q̇ − ω_up|²

    over x = (U_x, U_y (N each), F − F_ref (x, y of MAX_FOOTSTEPS), q̇ (nv), ΔZ (2N)), subject to

        A_k (Z_k + ΔZ_k − S_k (F − F_ref)) ≤ b_k      ZMP in the support of knot k, which moves with the footsteps, soft
        A (a (c_N + √(b/a) ċ_N) + j + ΔZ_N − S (F − F_ref)) ≤ b   the plan can come to rest at its end, soft
        C_low ≤ C_k ≤ C_high            reach of hands and feet, |R − C| ≤ d of each of them, per axis, soft
        l ≤ R_jᵀ (F_j − F_{j−1}) ≤ u    where a foot may be put beside the other, soft
        J_foot q̇ = v_foot               stance feet stay, swing feet follow, soft
        q̇_low ≤ q̇ ≤ q̇_high.

    ċ is the velocity of the first knot's plan at the end of `velocity_time`, so jerks and q̇ agree. ΔZ is there only
    when the stage is built to ask for it: its plain norm, as the paper prints it, leaves ΔZ at exactly 0 as long as the
    robot can do without a contact. Otherwise all norms are weighted squares. The footsteps are Herdt's; the last cost
    term and the row at the end of the horizon are not in the paper: without that row a plan may keep every ZMP and
    still be falling over at knot N.

    Solved as two smaller problems that meet in ċ, `HorizontalMotion` and `JointVelocities`: what ċ costs the joints is
    a convex, piecewise quadratic V(ċ). The motion is planned with the piece around the last ċ, and again when its own ċ
    turns out to lie on another piece, until V's slope there is as foreseen: then it is the optimum of the whole. Of the
    first jerks' cost V is a share τ⁴ α₄ / 4 α₁ at most, a few per cent, and by that factor each round's error shrinks.
    """

    def __init__(
        self,
        preview: Preview,
        settings: WholeBodySettings,
        joints: JointVelocities,
        *,
        backend: str,
        ask_shift: bool,
    ) -> None:
        """`joints` may be shared; `ask_shift`: ΔZ is a variable (whether a contact is needed), or 0 (to execute)."""
        self._joints = joints
        self._motion = HorizontalMotion(preview, settings, backend=backend, ask_shift=ask_shift)

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
        """Plan from the horizontal CoM state (2, 3): rows x, y; columns c, ċ, c̈ [m, m/s, m/s²].

        Args:
            zmp: the ZMP's model over the horizon, known contact forces included (the paper's case a).
            support: support polygons and footsteps over the horizon, and where the CoM should be and go.
            com_band: (2, N, 2) lowest and highest CoM per axis and knot [m]; ±inf where nothing binds.
            tasks: see `VelocityTasks`.
            velocity_time: when the CoM velocity that q̇ should meet is taken [s after the state], < T.
            urgency: factor ≥ 1 on the costs of CoM velocity and position: how fast to come to rest.

        Returns:
            The plan, or None when the solve failed (the solution carries the status).
        """
        joints = self._joints
        gain = velocity_time**2 / 2  # dċ / d(first jerk)
        unmoved = state[:, 1] + velocity_time * state[:, 2] + tasks.com_correction[:2]  # ċ without jerk
        joints.take(tasks)
        cost = joints.cost
        if cost is None:
            answer, cost = joints.solve(unmoved)
            if cost is None:
                return None, answer
        for _ in range(ROUNDS):
            first_gradient, first_curvature = cost.of_first_jerk(unmoved, gain)
            motion, solution = self._motion.solve(
                state,
                zmp=zmp,
                support=support,
                com_band=com_band,
                urgency=urgency,
                first_gradient=first_gradient,
                first_curvature=first_curvature,
            )
            if motion is None:
                return None, solution
            velocity = unmoved + gain * motion.jerk[0]
            foreseen = cost
            answer, cost = joints.solve(velocity)
            if cost is None:
                return None, answer
            plan = _with_joints(motion, answer.x)
            if foreseen.error(cost) <= SLOPE_TOLERANCE:
                break
        return plan, solution


def _with_joints(motion: Motion, joint_velocity: Vector) -> HorizontalPlan:
    return HorizontalPlan(
        jerk=motion.jerk,
        com=motion.com,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        delta_z=motion.delta_z,
        zmp=motion.zmp,
        footstep_shift=motion.footstep_shift,
        joint_velocity=joint_velocity,
    )
