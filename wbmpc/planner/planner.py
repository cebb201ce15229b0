"""The planner: a snapshot of the robot through stages 1, 2 and 3 to a plan, 100 times a second."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.candidates import Candidates
from wbmpc.planner.com_height import ComHeightStage, HeightPlan
from wbmpc.planner.contact_force import ContactChoice, ContactForce, Need
from wbmpc.planner.hand_contact import HandContact
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.plan import Plan
from wbmpc.planner.posture import Posture
from wbmpc.planner.preview import Preview
from wbmpc.planner.reach import Reach, ReachPhase
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.planner.whole_body import HorizontalPlan, WholeBodyStage, ZmpModel
from wbmpc.qp import QpSolution
from wbmpc.robot import Robot
from wbmpc.scenario import ComHeightTask, PatchPose, ReachTask, Task
from wbmpc.signals import (
    GRAVITY,
    SIDES,
    CandidateReport,
    ContactPhase,
    HandMode,
    PlanReport,
    RobotState,
    SolveStatus,
    StageReport,
    Vector,
)

FREE_SHIFT = 1.0  # [m] bound on ΔZ when the need is asked for
REACH_FLOOR = 0.12  # [m] smallest d: a hand never pins the CoM to itself
RETRY_PLANS = 10  # plans between two firings of stage 3 when no candidate can help
GIVE_UP_TIME = 2.0  # [s] without a helpful candidate after which the task goes on without a contact
ALARM_TIME = 0.6  # [s] in which an alarm wears off
NOT_RUN = StageReport(SolveStatus.NOT_RUN, 0.0, 0)


class Planner:
    """The three stages and what lives between two solves: CoM state, tasks, contacts, joint reference.

    Every plan:
      1. advances tasks and contacts with what was measured,
      2. stage 1 plans the CoM height,
      3. stage 2 with ΔZ free and the tasks at full pace asks whether a contact is needed,
      4. stage 3 chooses one when it is (first time), or gives the chosen contact's forces at all knots,
      5. stage 2 again, ΔZ = 0, with the known contact force in the ZMP ([M] case a), gives the motion to execute.
    """

    def __init__(
        self,
        robot: Robot,
        settings: PlannerSettings,
        *,
        tasks: tuple[Task, ...],
        patches: tuple[PatchPose, ...],
        q: Vector,
        period: float,
    ) -> None:
        """Start from rest at configuration `q` (nq,); `period` is the time between two plans [s]."""
        self._robot, self._settings, self._period = robot, settings, period
        contact = settings.contact
        self._preview = Preview(steps=settings.horizon_steps, step=settings.horizon_step)
        self._height_stage = ComHeightStage(self._preview, settings.height, backend=settings.qp_backend)
        self._need_stage, self._motion_stage = (
            WholeBodyStage(self._preview, robot.nv, settings.whole_body, backend=settings.qp_backend) for _ in range(2)
        )
        self._force_stage = ContactForce(
            self._preview.steps, contact, mass=robot.mass, contacts=len(SIDES), backend=settings.qp_backend
        )
        self._measured = Kinematics(robot)
        self._reference = JointReference(robot, settings.whole_body, q=q)
        self._measured.update_kinematics(q)
        self._soles = np.array([self._measured.position(f) for f in robot.sole_frames])
        self._yaws = np.array([_yaw(self._measured.rotation(f)) for f in robot.sole_frames])
        self._palms = np.array([self._measured.position(f) for f in robot.palm_frames])
        self._palm_homes = self._palms.copy()
        self._com = np.zeros((3, 3))  # c, ċ, c̈ per axis: the state that the next plan starts from
        self._com[:, 0] = self._measured.com
        self._com_velocity = np.zeros(3)  # filtered
        self._nominal_height = float(self._com[2, 0])
        self._contacts = [HandContact(side, contact, palm_radius=robot.palm_radius) for side in range(len(SIDES))]
        self._reaches = [
            Reach(t, side=self._hand_of(t), palm=self._palms[self._hand_of(t)])
            for t in tasks
            if isinstance(t, ReachTask)
        ]
        self._heights = [t for t in tasks if isinstance(t, ComHeightTask)]
        self._goal = Posture(robot, nominal=q)
        self._alarm = 0.0  # 0 … 1: how far the measured capture point is from the planned one
        self._candidates = Candidates(robot, patches, contact, nominal=q, backend=settings.miqp_backend)
        polygon = self._polygon()
        self._candidates.refresh(
            soles=self._soles, yaws=self._yaws, centre=polygon.centre, iterations=40, everyone=True
        )
        for _ in range(80):
            self._update_goal(polygon)
        self._shrink = 0.0  # [m] taken off d while a held hand stays short of its target
        self._needed, self._quiet = False, True
        self._hopeless = 0.0  # [s] that no candidate has been able to help
        self._since_fired = RETRY_PLANS
        self._forces = np.zeros((len(SIDES), self._preview.steps, 3))
        self._last: Plan | None = None

    # ------------------------------------------------------------------ one plan

    def solve(self, state: RobotState) -> Plan:
        """Plan from a snapshot. A failed solve keeps the last plan (or stands still) and says so in the report."""
        start = perf_counter()
        events: list[str] = []
        self._observe(state)
        polygon = self._polygon()
        growth = self._settings.whole_body.zmp_margin_growth
        polygons = tuple(polygon.shrunk(growth * t) for t in self._preview.times)
        self._advance(state, events)
        self._update_goal(polygon)
        self._candidates.refresh(soles=self._soles, yaws=self._yaws, centre=polygon.centre, iterations=1)
        times = self._preview.times
        mass = state.mass_scale * self._robot.mass

        intent, _ = self._hand_references(state.time, full_pace=True)
        gated, gated_sigma = self._hand_references(state.time, full_pace=False)
        stage1_start = perf_counter()
        band = self._band(gated, polygon)
        height, solution = self._plan_height(state.time, times, gated_sigma, band, polygon)
        stage1 = _stage_report(solution, stage1_start)

        stage2_start = perf_counter()
        plane = polygon.plane_height
        free_model = self._free_model(height, plane, mass)
        common = {
            "polygons": polygons,
            "com_reference": np.tile(polygon.centre, (self._preview.steps, 1)),
            "reach_distance": self._reach_distance(),
            "tasks": self._reference.tasks(
                com=self._com[:, 0],
                vertical_velocity=float(height.velocity[0] if self._settings.height.enabled else 0.0),
                soles=self._soles,
                yaws=self._yaws,
                hands=self._hand_targets(),
                posture=self._posture_target(),
            ),
            "velocity_time": self._period,
            "urgency": 1.0 + self._alarm * (self._settings.whole_body.alarm_urgency - 1.0),
        }
        forces = np.zeros_like(self._forces)
        delta_z = np.zeros((self._preview.steps, 2))
        reports: tuple[CandidateReport, ...] = ()
        stage3 = NOT_RUN
        if self._settings.contact_stage:
            wish, _ = self._need_stage.solve(
                self._com[:2], zmp=free_model, reach=intent[:, :, :2], delta_z_limit=FREE_SHIFT, **common
            )
            if wish is not None:
                delta_z = wish.delta_z
                need = self._need(wish, height, free_model, polygons, mass)
                self._judge(np.abs(delta_z).max())
                forces, reports, stage3 = self._contact_stage(need, polygons[-1], events)
        model = self._loaded_model(free_model, height, forces, plane, mass)
        motion, solution2 = self._motion_stage.solve(
            self._com[:2], zmp=model, reach=gated[:, :, :2], delta_z_limit=0.0, **common
        )
        stage2 = _stage_report(solution2, stage2_start)
        self._forces = forces

        report = PlanReport(
            time=state.time,
            com=np.column_stack([motion.com, height.height]) if motion else np.full((len(times), 3), np.nan),
            com_height_band=band,
            zmp=motion.zmp if motion else np.full((len(times), 2), np.nan),
            support_polygon=polygon.vertices,
            delta_z=delta_z,
            hand_reference=gated,
            contact_force=forces,
            contact_phase=np.array([c.phase for c in self._contacts]),
            contact_patch=(self._patch_name(0), self._patch_name(1)),
            progress=min((r.rate for r in self._reaches), default=1.0),
            stage1=stage1,
            stage2=stage2,
            stage3=stage3,
            candidates=reports,
            plan_time=perf_counter() - start,
            events=tuple(events),
        )
        plan = self._make_plan(state, motion, height, forces, times, report)
        self._last = plan
        return plan

    # ------------------------------------------------------------------ state between plans

    def _observe(self, state: RobotState) -> None:
        """Continue the planned CoM state to now and pull it towards the measured one."""
        self._measured.update(state.q, state.v)
        self._palms = np.array([self._measured.position(f) for f in self._robot.palm_frames])
        settings = self._settings
        measured, velocity = self._measured.com, self._measured.com_velocity
        self._com_velocity += 0.6 * (velocity - self._com_velocity)  # about 15 Hz at 100 plans a second
        if self._last is None:
            return
        self._com = self._last.com_state(state.time)
        position_error = measured - self._com[:, 0]
        velocity_error = self._com_velocity - self._com[:, 1]
        omega = np.sqrt(GRAVITY / max(self._com[2, 0] - self._soles[:, 2].mean(), 0.05))
        capture_error = np.linalg.norm(position_error[:2] + velocity_error[:2] / omega)
        alarm = float(np.clip(capture_error / settings.feedback_knee - 1.0, 0.0, 1.0))
        self._alarm = max(alarm, self._alarm - self._period / ALARM_TIME)
        share = settings.feedback + alarm * (settings.feedback_large - settings.feedback)
        self._com[:2, 0] += share * position_error[:2]
        self._com[:2, 1] += share * velocity_error[:2]
        self._reference.advance(self._last.velocity, self._period)

    def _advance(self, state: RobotState, events: list[str]) -> None:
        """Tasks and contacts one plan further."""
        carried = any(c.phase in (ContactPhase.LOADED, ContactPhase.QUIET) for c in self._contacts)
        gate_open = carried or not self._needed or self._hopeless >= GIVE_UP_TIME
        for reach in self._reaches:
            before = reach.phase
            reach.advance(state.time, self._period, gate_open=gate_open, palm=self._palms[reach.side])
            if reach.phase != before:
                events.append(f"reach {SIDES[reach.side]}: {before.name.lower()} -> {reach.phase.name.lower()}")
            if reach.phase == ReachPhase.HOLD:
                short = float(np.linalg.norm(self._palms[reach.side] - reach.target)) - 0.5 * reach.task.tolerance
                self._shrink = float(np.clip(self._shrink + 1.0 * self._period * short, 0.0, 0.02))
        for contact in self._contacts:
            before_phase, patch = contact.phase, self._patch_name(contact.side)
            wanted = float(self._forces[contact.side, 0] @ contact.patch.normal) if contact.patch else 0.0
            outcome = contact.advance(
                self._period,
                palm=self._palms[contact.side],
                force=state.palm_force_in_world[contact.side],
                wanted_force=wanted,
                needed=self._needed,
                quiet=self._quiet,
                home=self._palm_homes[contact.side],
            )
            if outcome == "failed":
                for candidate in self._candidates.all:
                    if candidate.patch is contact.patch and candidate.hand == contact.side:
                        candidate.excluded = True
                events.append(f"contact {SIDES[contact.side]} {patch}: not found, excluded")
                contact.release(palm=self._palms[contact.side], home=self._palm_homes[contact.side])
            if contact.phase != before_phase:
                events.append(
                    f"contact {SIDES[contact.side]} {patch}: {before_phase.name.lower()} -> {contact.phase.name.lower()}"
                )

    def _judge(self, shift: float) -> None:
        """Whether the asked shift needs a contact, or is negligible."""
        contact = self._settings.contact
        self._needed = bool(shift > contact.need_threshold)
        self._quiet = bool(shift < contact.quiet_threshold)

    def _contact_stage(
        self, need: Need, polygon: SupportPolygon, events: list[str]
    ) -> tuple[Vector, tuple[CandidateReport, ...], StageReport]:
        """Stage 3: choose a contact when one is needed, and the forces of those that touch."""
        reports: tuple[CandidateReport, ...] = ()
        stage = NOT_RUN
        held = [c for c in self._contacts if c.busy and c.phase != ContactPhase.RELEASED]
        free = [not c.busy and not self._hand_taken(c.side) for c in self._contacts]
        self._since_fired += 1
        if not held:
            if not self._needed:
                self._hopeless = 0.0
            elif self._since_fired >= RETRY_PLANS and any(free) and self._candidates.all and self._hopeless < GIVE_UP_TIME:
                self._since_fired = 0
                worst = int(np.argmax(np.abs(need.delta_z).max(axis=1)))
                last = int(np.argmax(np.abs(need.delta_z[:, 1]))) if np.abs(need.delta_z[:, 1]).max() > 1e-3 else worst
                winner, reports, stage = self._candidates.choose(
                    need.pick([worst, last][: ContactChoice.KNOTS]),
                    palms=self._palms,
                    free_hands=free,
                    polygon=polygon,
                )
                events.append(
                    f"stage 3 fired: |ΔZ| {1e3 * np.abs(need.delta_z).max():.1f} mm at knot {worst + 1}, "
                    + (f"chose {winner.patch.name} for the {SIDES[winner.hand]} hand" if winner else "no candidate helps")
                )
                if winner:
                    self._contacts[winner.hand].choose(winner.patch, palm=self._palms[winner.hand])
                    self._hopeless = 0.0
            if self._needed and not any(c.phase == ContactPhase.CHOSEN for c in self._contacts):
                self._hopeless += self._period
            for contact in self._contacts:
                contact.need(self._needed and free[contact.side] and self._hopeless < GIVE_UP_TIME)
        caps = np.array([c.caps(self._preview.times) for c in self._contacts])
        if not caps.any():
            return np.zeros_like(self._forces), reports, stage
        begin = perf_counter()
        forces, solution = self._force_stage.solve(need, [c.patch for c in self._contacts], caps)
        if stage is NOT_RUN:
            stage = _stage_report(solution, begin)
        return (self._forces if forces is None else forces), reports, stage

    # ------------------------------------------------------------------ inputs of the stages

    def _polygon(self) -> SupportPolygon:
        corners = np.vstack(
            [
                foot_corners(position=p, yaw=yaw, half_extents=self._robot.sole_half_extents)
                for p, yaw in zip(self._soles, self._yaws, strict=True)
            ]
        )
        settings = self._settings.whole_body
        margin = settings.zmp_margin + self._alarm * (settings.zmp_margin_alarm - settings.zmp_margin)
        return SupportPolygon.of_corners(corners, margin=margin, plane_height=float(self._soles[:, 2].mean()))

    def _update_goal(self, polygon: SupportPolygon) -> None:
        """The posture at the reach's target, the bracing palm on its patch: what the reach needs of the CoM."""
        palms: list[Vector | None] = [c.goal for c in self._contacts]
        for reach in self._reaches:
            if reach.phase != ReachPhase.DONE:
                palms[reach.side] = reach.target
        if any(p is not None for p in palms):
            self._goal.iterate(1, soles=self._soles, yaws=self._yaws, palms=palms, centre=polygon.centre)

    def _hand_references(self, time: float, *, full_pace: bool) -> tuple[Vector, Vector]:
        """Palm references (2, N, 3) over the horizon, nan for a free hand, and the reach's σ (N,)."""
        times = self._preview.times
        references = np.full((len(SIDES), len(times), 3), np.nan)
        sigma = np.zeros(len(times))
        for contact in self._contacts:
            if contact.goal is not None:
                references[contact.side] = contact.preview(times)
        for reach in self._reaches:
            if reach.phase == ReachPhase.DONE:
                continue
            rate = 1.0 if full_pace else reach.rate
            references[reach.side] = reach.preview(time, times, rate=rate)
            sigma = np.maximum(sigma, reach.sigmas(time, times, rate=rate))
        return references, sigma

    def _band(self, references: Vector, polygon: SupportPolygon) -> Vector:
        """Admissible band (N, 2) of the CoM height: the legs' range, narrowed by the hands' |c_z − r_z| ≤ d."""
        settings = self._settings.height
        band = np.empty((self._preview.steps, 2))
        band[:, 0], band[:, 1] = polygon.plane_height + settings.lowest, polygon.plane_height + settings.highest
        for hand in range(len(SIDES)):
            z = references[hand, :, 2]
            known = np.isfinite(z)
            band[known, 0] = np.maximum(band[known, 0], z[known] - settings.reach)
            band[known, 1] = np.minimum(band[known, 1], z[known] + settings.reach)
        return band

    def _plan_height(
        self, time: float, times: Vector, sigma: Vector, band: Vector, polygon: SupportPolygon
    ) -> tuple[HeightPlan, QpSolution]:
        settings = self._settings.height
        wanted = np.full(len(times), self._nominal_height)
        if self._reaches:
            wanted += sigma * (self._goal.com[2] - self._nominal_height)
        for task in self._heights:
            knots = [0.0] + [w.time for w in task.waypoints]
            heights = [self._nominal_height] + [w.height for w in task.waypoints]
            wanted = np.interp(time + times, knots, heights)
        limits = np.tile(
            [polygon.plane_height + settings.lowest, polygon.plane_height + settings.highest], (len(times), 1)
        )
        plan, solution = self._height_stage.solve(self._com[2], wanted=wanted, limits=limits, band=band)
        if plan is None or not settings.enabled:
            zero = np.zeros(len(times))
            plan = HeightPlan(jerk=zero, height=np.full(len(times), self._com[2, 0]), velocity=zero, acceleration=zero)
            if self._last is None or not settings.enabled:
                self._com[2, 1:] = 0.0
        return plan, solution

    def _free_model(self, height: HeightPlan, plane: float, mass: float) -> ZmpModel:
        """The ZMP without contact, exact or the paper's LIPM."""
        exact = self._settings.formulation == "exact"
        a, b = self._preview.zmp_gains(
            height=height.height - plane,
            vertical_acceleration=height.acceleration if exact else np.zeros(self._preview.steps),
            vertical_force=np.zeros(self._preview.steps),
            mass=mass,
        )
        return ZmpModel(a, b, np.zeros((self._preview.steps, 2)))

    def _loaded_model(self, free: ZmpModel, height: HeightPlan, forces: Vector, plane: float, mass: float) -> ZmpModel:
        """The ZMP with the contacts' known forces, [M] eq. ak_bk_qk."""
        if not forces.any():
            return free
        total = forces[:, :, 2].sum(axis=0)
        a, b = self._preview.zmp_gains(
            height=height.height - plane,
            vertical_acceleration=height.acceleration,
            vertical_force=total,
            mass=mass,
        )
        offset = np.zeros((self._preview.steps, 2))
        weight = mass * (height.acceleration + GRAVITY)
        for contact in self._contacts:
            goal = contact.patch
            if goal is None:
                continue
            f = forces[contact.side]
            lever = goal.position[2] - plane
            offset += (lever * f[:, :2] - goal.position[:2] * f[:, 2:]) / (weight - total)[:, None]
        return ZmpModel(a, b, offset)

    def _need(
        self,
        wish: HorizontalPlan,
        height: HeightPlan,
        model: ZmpModel,
        polygons: tuple[SupportPolygon, ...],
        mass: float,
    ) -> Need:
        zmp = model.a[:, None] * wish.com - model.b[:, None] * wish.acceleration
        phantom = np.zeros_like(zmp)
        if self._settings.formulation == "paper":
            lever = (height.height - polygons[0].plane_height) * height.acceleration
            phantom = mass * lever[:, None] * wish.acceleration / GRAVITY
        return Need(
            delta_z=wish.delta_z,
            zmp=zmp,
            weight=mass * (GRAVITY + height.acceleration),
            polygons=polygons,
            phantom=phantom,
        )

    def _reach_distance(self) -> Vector:
        """d (2, 2) per hand and axis [m]: what the reach's posture has between palm and CoM, never below REACH_FLOOR."""
        distance = np.full((len(SIDES), 2), 0.3)
        for contact in self._contacts:
            if contact.goal is not None:
                own = [c.posture.com for c in self._candidates.all if c.patch is contact.patch and c.hand == contact.side]
                d = np.abs(contact.goal[:2] - own[0][:2])
                if self._reaches:
                    d = np.maximum(d, np.abs(contact.goal[:2] - self._goal.com[:2]))
                distance[contact.side] = d
        for reach in self._reaches:
            if reach.phase != ReachPhase.DONE:
                distance[reach.side] = np.abs(reach.target[:2] - self._goal.com[:2]) - self._shrink
        return np.maximum(distance, REACH_FLOOR)

    def _posture_target(self) -> Vector:
        """Joint angles (nj,) that the joint reference is drawn to: standing, or the reach's posture by its progress."""
        sigma = max((r.sigma for r in self._reaches), default=0.0)
        nominal = self._robot_nominal[7:]
        return nominal + sigma * (self._goal.q[7:] - nominal)

    @property
    def _robot_nominal(self) -> Vector:
        return self._reference.start

    def _hand_taken(self, side: int) -> bool:
        return any(r.side == side and r.phase != ReachPhase.DONE for r in self._reaches)

    def _hand_targets(self) -> list[tuple[Vector, Vector, Vector, HandMode]]:
        """Position, velocity, acceleration and mode of each hand now."""
        targets = []
        for contact in self._contacts:
            zero = np.zeros(3)
            target = (self._palms[contact.side], zero, zero, HandMode.FREE)
            if contact.busy:
                target = (*contact.reference(), contact.mode)
            for reach in self._reaches:
                if reach.side == contact.side and reach.active:
                    target = (*reach.reference(), HandMode.MOVE)
            targets.append(target)
        return targets

    def _hand_of(self, task: ReachTask) -> int:
        if task.hand != "auto":
            return SIDES.index(task.hand)
        return int(np.argmin(np.linalg.norm(self._palms - np.array(task.target), axis=1)))

    def _patch_name(self, side: int) -> str:
        patch = self._contacts[side].patch
        return patch.name if patch else ""

    # ------------------------------------------------------------------ the plan

    def _make_plan(
        self,
        state: RobotState,
        motion: HorizontalPlan | None,
        height: HeightPlan,
        forces: Vector,
        times: Vector,
        report: PlanReport,
    ) -> Plan:
        if motion is None and self._last is not None:
            return replace(self._last, report=report)
        n = len(times)
        states = np.empty((n + 1, 3, 3))
        states[0] = self._com
        jerk = np.zeros((n, 3))
        jerk[:, 2] = height.jerk
        states[1:, 2] = np.column_stack([height.height, height.velocity, height.acceleration])
        velocity = np.zeros(self._robot.nv)
        if motion is not None:
            jerk[:, :2] = motion.jerk
            states[1:, :2] = np.stack([motion.com, motion.velocity, motion.acceleration], axis=2)
            velocity = motion.joint_velocity
        else:
            states[1:, :2] = self._com[:2]
        hands = self._hand_targets()
        palm_position, palm_velocity = self._reference.palms(velocity)
        contacts = self._contacts
        caps_now = np.array([c.caps(np.zeros(1))[0] for c in contacts])
        caps_next = np.array([c.caps(np.full(1, self._period))[0] for c in contacts])
        zero = np.zeros((len(SIDES), 3))
        normals = np.array([c.patch.normal if c.patch else [0.0, 0.0, 1.0] for c in contacts])
        return Plan(
            time=state.time,
            step=self._preview.step,
            com_states=states,
            com_jerk=jerk,
            q=self._reference.q,
            velocity=velocity,
            torso_rotation=self._reference.torso_rotation,
            torso_angular_velocity=self._reference.torso_velocity(velocity),
            foot_stance=np.ones(len(SIDES), dtype=bool),
            foot_position=self._soles,
            foot_yaw=self._yaws,
            foot_velocity=zero,
            foot_acceleration=zero,
            hand_mode=np.array([int(h[3]) for h in hands]),
            hand_position=palm_position,
            hand_velocity=palm_velocity,
            hand_acceleration=zero,
            hand_force=forces[:, 0],
            hand_force_cap=caps_now,
            hand_force_cap_rate=(caps_next - caps_now) / self._period,
            hand_force_cap_top=np.array([c.patch.force_cap if c.patch else 0.0 for c in contacts]),
            hand_normal=normals,
            hand_friction=np.array([c.patch.friction if c.patch else 0.5 for c in contacts]),
            report=report,
        )


def _stage_report(solution: QpSolution, start: float) -> StageReport:
    return StageReport(solution.status, perf_counter() - start, solution.iterations)


def _yaw(rotation: Vector) -> float:
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
