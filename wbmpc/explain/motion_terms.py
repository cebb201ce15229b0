"""Stage 2 in words: its QP as named terms, from what the stage was asked, written a second time."""

from __future__ import annotations

import numpy as np

from wbmpc.explain.height_terms import knot_names
from wbmpc.explain.program import Program, Term, facing, term
from wbmpc.planner.horizontal_motion import ZmpModel
from wbmpc.planner.horizontal_problem import LARGEST_SHIFT
from wbmpc.planner.joint_velocities import VelocityTasks
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.whole_body import HorizontalPlan
from wbmpc.signals import SIDES, Vector

AXES = "xyz"
TWIST = ("x", "y", "z", "about x", "about y", "about z")


class MotionProgram:
    """Stage 2 (`WholeBodyStage`) as one problem over x = (jerks, footsteps, ΔZ, q̇), x and y of each one after another.

    Args:
        asked: whether ΔZ is a variable; otherwise it is 0.
        joint_names: (nj,) for the bounds' names.
        The rest as of `WholeBodyStage.solve`.
    """

    def __init__(
        self,
        preview: Preview,
        settings: WholeBodySettings,
        state: Vector,
        *,
        asked: bool,
        joint_names: tuple[str, ...],
        zmp: ZmpModel,
        support: SupportPreview,
        com_band: Vector,
        tasks: VelocityTasks,
        velocity_time: float,
        urgency: float,
    ) -> None:
        self._preview, self._settings, self._state = preview, settings, state
        self._zmp, self._support, self._tasks = zmp, support, tasks
        n, m, nv = preview.steps, MAX_FOOTSTEPS, len(tasks.lower)
        self._size = 4 * n + 2 * m + nv
        knots = knot_names(preview)
        P_zs, P_zu = preview.zmp_matrices(zmp.a, zmp.b)
        self._free = state[:, :3] @ preview.P_ps.T  # (2, N)
        self._free_velocity = state @ preview.P_vs.T
        self._free_zmp = P_zs @ state.T + zmp.offset  # (N, 2)
        self._P_zu = P_zu
        steps = bool(support.lower.any() or support.upper.any())
        terms = [*self._com_terms(knots, urgency), *self._zmp_terms(knots, asked)]
        if steps:
            terms += self._footstep_terms()
        terms += [self._reach_term(knots, com_band), *self._joint_terms(velocity_time)]
        joints = [f"base {c}" for c in TWIST] + list(joint_names)
        names = [f"{what} {axis}, {k}" for what in ("jerk", "ΔZ") for axis in AXES[:2] for k in knots]
        landings = [f"footstep {f + 1} {axis}" for axis in AXES[:2] for f in range(m)]
        lower, upper = (np.full(self._size, bound) for bound in (-np.inf, np.inf))
        lower[self._steps], upper[self._steps] = support.lower.T.ravel(), support.upper.T.ravel()
        lower[self._shift], upper[self._shift] = -LARGEST_SHIFT * asked, LARGEST_SHIFT * asked
        lower[self._joints], upper[self._joints] = tasks.lower, tasks.upper
        price = np.zeros(self._size)
        price[self._shift] = settings.delta_z_price * asked
        self.program = Program(
            terms,
            [*names[: 2 * n], *landings, *names[2 * n :], *joints],
            lower,
            upper,
            price,
            "ΔZ price" if asked else "",
        )
        self.steps, self.asked = steps, asked

    def point(self, plan: HorizontalPlan) -> Vector:
        """x of a plan."""
        shift, jerk = plan.delta_z if self.asked else np.zeros_like(plan.jerk), plan.jerk
        return np.concatenate([jerk.T.ravel(), plan.footstep_shift.T.ravel(), shift.T.ravel(), plan.joint_velocity])

    # ------------------------------------------------------------------ where the variables are

    @property
    def _steps(self) -> slice:
        return slice(2 * self._preview.steps, 2 * self._preview.steps + 2 * MAX_FOOTSTEPS)

    @property
    def _shift(self) -> slice:
        return slice(self._steps.stop, self._steps.stop + 2 * self._preview.steps)

    @property
    def _joints(self) -> slice:
        return slice(self._shift.stop, self._size)

    def _rows(self, count: int) -> Vector:
        return np.zeros((count, self._size))

    def _per_axis(self, matrix: Vector) -> Vector:
        """Rows of both axes' jerks, x first."""
        n, rows = self._preview.steps, self._rows(2 * len(matrix))
        for axis in range(2):
            rows[axis * len(matrix) : (axis + 1) * len(matrix), axis * n : (axis + 1) * n] = matrix
        return rows

    # ------------------------------------------------------------------ terms

    def _com_terms(self, knots: list[str], urgency: float) -> list[Term]:
        w, preview, support = self._settings, self._preview, self._support
        both = [f"{axis}, {k}" for axis in AXES[:2] for k in knots]
        wanted = (support.com_velocity.T - self._free_velocity).ravel()
        place = (support.com_reference.T - self._free).ravel()
        jerk, velocity, position = (self._per_axis(P) for P in (np.eye(preview.steps), preview.P_vu, preview.P_pu))
        return [
            term("jerk", jerk, 0.0, weight=w.jerk_cost, unit="m/s³", labels=both),
            term("velocity", velocity, wanted, weight=urgency * w.velocity_cost, unit="m/s", labels=both),
            term("position", position, place, weight=urgency * w.position_cost, unit="m", labels=both),
        ]

    def _zmp_rows(self) -> Vector:
        """Rows (2N, n) of Z_k − S_k (F − F_ref), without ΔZ."""
        n, m, rows = self._preview.steps, MAX_FOOTSTEPS, self._per_axis(self._P_zu)
        for axis in range(2):
            first = self._steps.start + axis * m
            rows[axis * n : (axis + 1) * n, first : first + m] = -self._support.shift
        return rows

    def _zmp_terms(self, knots: list[str], asked: bool) -> list[Term]:
        w, support, zmp, preview = self._settings, self._support, self._zmp, self._preview
        n, m = preview.steps, MAX_FOOTSTEPS
        terms, Z = [], self._zmp_rows()
        if support.centring.any():
            target = (support.centres - self._free_zmp).T.ravel()
            weight = w.zmp_centre_cost * np.tile(support.centring, 2)
            terms.append(term("ZMP centring", Z, target, weight=weight, unit="m"))
        if asked:
            shift = self._rows(2 * n)
            shift[:, self._shift] = np.eye(2 * n)
            terms.append(term("ΔZ squared", shift, 0.0, weight=w.delta_z_cost, unit="m"))
            Z = Z + shift
        edges = support.normals.shape[1]
        rows = np.einsum("kei,ikn->ken", support.normals, Z.reshape(2, n, -1)).reshape(n * edges, -1)
        room = support.offsets - np.einsum("kei,ki->ke", support.normals, self._free_zmp)
        labels = [f"ZMP, {k}, {facing(normal)}" for k, of in zip(knots, support.normals, strict=True) for normal in of]
        terms.append(term("ZMP slack", rows, upper=room.ravel(), weight=w.zmp_slack_cost, unit="m", labels=labels))
        # A (a (c_N + τ ċ_N) + j + ΔZ_N − S (F − F_ref)) ≤ b
        a, tau = zmp.a[-1], np.sqrt(zmp.b[-1] / zmp.a[-1])
        capture = a * (self._per_axis(preview.P_pu[-1:]) + tau * self._per_axis(preview.P_vu[-1:]))
        for axis in range(2):
            first = self._steps.start + axis * m
            capture[axis, first : first + m] = -support.rest_shift
            if asked:
                capture[axis, self._shift.start + (axis + 1) * n - 1] = 1.0
        free = a * (self._free[:, -1] + tau * self._free_velocity[:, -1]) + zmp.offset[-1]
        A = support.rest_normals
        labels = [f"rest after the last knot, {facing(normal)}" for normal in A]
        room = support.rest_offsets - A @ free
        terms.append(term("rest slack", A @ capture, upper=room, weight=w.rest_slack_cost, unit="m", labels=labels))
        return terms

    def _footstep_terms(self) -> list[Term]:
        w, support, m = self._settings, self._support, MAX_FOOTSTEPS
        move, place = self._rows(2 * m), self._rows(2 * m)
        move[:, self._steps] = np.eye(2 * m)
        for f in range(m):
            for axis in range(2):
                column = self._steps.start + axis * m + f
                place[2 * f : 2 * f + 2, column] = support.placement_axes[f, :, axis]
                if f:
                    place[2 * f : 2 * f + 2, column - 1] = -support.placement_axes[f, :, axis]
        labels = [
            f"footstep {f + 1}, {way} beside the one before" for f in range(m) for way in ("ahead", "to the left")
        ]
        return [
            term("footsteps", move, 0.0, weight=w.footstep_cost, unit="m"),
            term(
                "footstep slack",
                place,
                lower=support.placement_lower.ravel(),
                upper=support.placement_upper.ravel(),
                weight=w.foot_slack_cost,
                unit="m",
                labels=labels,
            ),
        ]

    def _reach_term(self, knots: list[str], com_band: Vector) -> Term:
        gap = com_band - self._free[:, :, None]
        labels = [f"CoM {axis} within reach of hands and feet, {k}" for axis in AXES[:2] for k in knots]
        rows, weight = self._per_axis(self._preview.P_pu), self._settings.reach_slack_cost
        lower, upper = gap[:, :, 0].ravel(), gap[:, :, 1].ravel()
        return term("reach slack", rows, lower=lower, upper=upper, weight=weight, unit="m", labels=labels)

    def _joint_terms(self, tau: float) -> list[Term]:
        """What joint velocities should do; the CoM velocity that they should have is the plan's at `tau` [s]."""
        w, tasks, state = self._settings, self._tasks, self._state
        nv = len(tasks.lower)

        def on_joints(jacobian: Vector) -> Vector:
            rows = self._rows(len(jacobian))
            rows[:, self._joints] = jacobian
            return rows

        com = on_joints(tasks.com_jacobian)
        for axis in range(2):
            com[axis, axis * self._preview.steps] -= tau**2 / 2
        moving = np.array([*(state[:, 1] + tau * state[:, 2]), tasks.com_vertical_velocity]) + tasks.com_correction
        hand, torso = w.hand_velocity_cost * np.repeat(tasks.hand_active, 3), w.torso_cost
        posture = w.joint_velocity_cost * tasks.posture_weight
        feet = [f"{side} foot {c}" for side in SIDES for c in TWIST]
        return [
            term("q̇: posture", on_joints(np.eye(nv)), tasks.posture_velocity, weight=posture, unit="rad/s"),
            term("q̇: CoM", com, moving, weight=w.com_velocity_cost, unit="m/s"),
            term("q̇: hands", on_joints(tasks.hand_jacobian), tasks.hand_velocity, weight=hand, unit="m/s"),
            term("q̇: torso", on_joints(tasks.torso_jacobian), tasks.torso_velocity, weight=torso, unit="rad/s"),
            term(
                "q̇: feet",
                on_joints(tasks.foot_jacobian),
                tasks.foot_velocity,
                weight=w.foot_slack_cost,
                unit="m/s",
                labels=feet,
            ),
        ]
