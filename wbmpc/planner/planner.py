"""The planner: a snapshot of the robot through stages 1, 2 and 3 to a plan, 100 times a second."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.bands import height_band
from wbmpc.planner.com_height import ComHeightStage, HeightPlan
from wbmpc.planner.com_state import ComState
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contacts import NOT_RUN, Contacts
from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import Feet, SoleReferences
from wbmpc.planner.gait import Gait, SupportPhase
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.plan import Plan
from wbmpc.planner.preview import Preview
from wbmpc.planner.references import References
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.whole_body import HorizontalPlan, WholeBodyStage, ZmpModel
from wbmpc.planner.zmp_model import free_model, loaded_model, need_at_rest, need_of
from wbmpc.qp import QpSolution
from wbmpc.robot import Robot
from wbmpc.rotations import heading_of
from wbmpc.scenario import Obstacle, PatchPose, Task
from wbmpc.signals import SIDES, CandidateReport, HandMode, PlanReport, RobotState, StageReport, Vector

GATE_TIME = 0.4  # [s] in which the steps' clock is stopped, and set going again
FIRST_ITERATIONS = 80  # of every posture, before the first plan
STRIDE_ITERATIONS = 50  # when a stride is asked for: half-finished postures would call for contacts


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
        obstacles: tuple[Obstacle, ...] = (),
        q: Vector,
        period: float,
    ) -> None:
        """Start from rest at configuration `q` (nq,); `period` is the time between two plans [s]."""
        self._robot, self._settings, self._period = robot, settings, period
        self._preview = Preview(steps=settings.horizon_steps, step=settings.horizon_step)
        self._height_stage = ComHeightStage(self._preview, settings.height, backend=settings.qp_backend)
        self._need_stage, self._motion_stage = (
            WholeBodyStage(self._preview, robot.nv, settings.whole_body, backend=settings.qp_backend, ask_shift=ask)
            for ask in (True, False)
        )
        measured = self._measured = Kinematics(robot)
        measured.update_kinematics(q)
        stepping = Stepping(tasks, settings.gait, Footholds(obstacles, robot.sole_half_extents))
        self._gait = Gait(settings.gait, stepping, soles=self._measured_soles(), yaws=self._measured_yaws())
        self._asked: Feet | None = None  # the feet from which the present stride goes
        self._gate, self._footstep_shift = 1.0, np.zeros((MAX_FOOTSTEPS, 2))
        self._palms = np.array([measured.position(f) for f in robot.palm_frames])
        self._palm_homes = self._in_torso(self._palms)  # where free hands hang
        self._com = ComState(settings, com=measured.com, period=period)
        times = self._preview.times
        self._contacts = Contacts(robot, settings, patches, nominal=q, times=times, period=period)
        self._references = References(robot, tasks, q=q, palms=self._palms, height=float(measured.com[2]), times=times)
        self._joints = JointReference(robot, settings.whole_body, q=q)
        self._improve_postures(iterations=FIRST_ITERATIONS, everyone=True)
        self._last: Plan | None = None
        self._time, self._elapsed = (
            0.0,
            period,
        )  # [s] of the last snapshot, and since it: longer when a plan was skipped

    def solve(self, state: RobotState) -> Plan:
        """Plan from a snapshot. A failed solve keeps the last plan (or stands still) and says so in the report."""
        start = perf_counter()
        events: list[str] = []
        settings, preview, contacts, references = self._settings, self._preview, self._contacts, self._references
        self._observe(state)
        self._advance(state, events)
        at_once, gated_support = self._supports(state.time)
        polygon = gated_support.polygons[0]
        plane = polygon.plane_height
        mass, exact = state.mass_scale * self._robot.mass, settings.formulation == "exact"

        stride, times = self._gait.stride, preview.times
        full_pace, full_sigma = references.palms(state.time, contacts, pace=1.0)
        gated, sigma = references.palms(state.time, contacts)
        foot, gated_foot = np.zeros(preview.steps), np.zeros(preview.steps)
        if stride is not None:
            foot, gated_foot = stride.shares(times, rate=1.0), stride.shares(times, rate=self._gate)
        begin = perf_counter()
        band = height_band(settings.height, gated, plane)
        height, solution = self._plan_height(
            references.wanted_height(state.time, contacts, np.maximum(sigma, gated_foot)), band, plane
        )
        stage1 = _stage_report(solution, begin)

        begin = perf_counter()
        hands = references.hand_targets(contacts, self._palms)
        soles = self._gait.soles(self._gate)
        tasks = self._joints.tasks(
            com=self._com.value[:, 0],
            vertical_velocity=float(height.velocity[0]),
            soles=soles,
            hands=hands,
            posture=references.posture(contacts),
            torso_up=references.torso_up(contacts),
            torso_heading=references.torso_heading(contacts, float(soles.yaws.mean())),
        )
        # a robot that steps is not to stop, its coming steps catch it
        alarm = self._com.alarm if self._gait.phase == SupportPhase.STAND else 0.0
        urgency = 1.0 + alarm * (settings.whole_body.alarm_urgency - 1.0)

        def stage_2(
            stage: WholeBodyStage, zmp: ZmpModel, support: SupportPreview, com_band: Vector
        ) -> tuple[HorizontalPlan | None, QpSolution]:
            return stage.solve(
                self._com.value[:2],
                zmp=zmp,
                support=support,
                com_band=com_band,
                tasks=tasks,
                velocity_time=self._period,
                urgency=urgency,
            )

        model = free_model(preview, height, plane=plane, mass=mass, exact=exact)
        delta_z = np.zeros((preview.steps, 2))
        candidates: tuple[CandidateReport, ...] = ()
        stage3 = NOT_RUN
        if settings.contact_stage:
            wish, _ = stage_2(
                self._need_stage, model, at_once, references.com_band(contacts, full_pace, full_sigma, foot)
            )
            if wish is not None:
                delta_z = wish.delta_z
                candidates, stage3 = contacts.plan(
                    need_of(wish, height, model, polygons=at_once.polygons, mass=mass, exact=exact),
                    goal=self._goal_need(mass),
                    binding=stride is not None,
                    palms=self._palms,
                    hand_taken=references.hands_taken(),
                    polygon=polygon,
                    events=events,
                )
        forces = contacts.forces
        if forces.any():
            model = loaded_model(preview, height, forces=forces, points=contacts.points, plane=plane, mass=mass)
        motion, solution = stage_2(
            self._motion_stage, model, gated_support, references.com_band(contacts, gated, sigma, gated_foot)
        )
        stage2 = _stage_report(solution, begin)
        if motion is not None:
            self._footstep_shift = motion.footstep_shift

        failed = np.full((preview.steps, 3), np.nan)
        report = PlanReport(
            time=state.time,
            com=np.column_stack([motion.com, height.height]) if motion else failed,
            com_height_band=band,
            zmp=motion.zmp if motion else failed[:, :2],
            support_polygon=polygon.vertices,
            delta_z=delta_z,
            hand_reference=gated,
            contact_force=forces,
            contact_phase=np.array([c.phase for c in contacts.hands]),
            contact_patch=(contacts.name(0), contacts.name(1)),
            progress=references.progress,
            stage1=stage1,
            stage2=stage2,
            stage3=stage3,
            candidates=candidates,
            plan_time=perf_counter() - start,
            events=tuple(events),
        )
        self._last = self._make_plan(motion, height, hands, soles, report)
        return self._last

    # ------------------------------------------------------------------ steps of one plan

    def _observe(self, state: RobotState) -> None:
        """Take in what was measured; continue the planned state to now."""
        self._measured.update(state.q, state.v)
        self._palms = np.array([self._measured.position(f) for f in self._robot.palm_frames])
        self._com.filter(self._measured.com_velocity)
        if self._last is not None:
            self._elapsed = state.time - self._time
            planned = self._last.com_state(state.time)
            plane = float(self._gait.feet.positions[:, 2].mean())
            self._com.update(planned, measured=self._measured.com, height=float(planned[2, 0]) - plane)
            self._joints.advance(self._last.velocity, self._elapsed)
        self._time = state.time

    def _in_torso(self, points: Vector) -> Vector:
        frame = self._robot.torso_frame
        return (points - self._measured.position(frame)) @ self._measured.rotation(frame)

    def _from_torso(self, points: Vector) -> Vector:
        frame = self._robot.torso_frame
        return self._measured.position(frame) + points @ self._measured.rotation(frame).T

    def _measured_soles(self) -> Vector:
        return np.array([self._measured.position(f) for f in self._robot.sole_frames])

    def _measured_yaws(self) -> Vector:
        rotations = (self._measured.rotation(f) for f in self._robot.sole_frames)
        return np.array([heading_of(R) for R in rotations])

    def _advance(self, state: RobotState, events: list[str]) -> None:
        """Steps, tasks, contacts and the postures behind them one plan further."""
        contacts, references, dt = self._contacts, self._references, self._elapsed
        gate_open = contacts.gate_open
        self._gate = float(np.clip(self._gate + (dt if gate_open else -dt) / GATE_TIME, 0.0, 1.0))
        self._gait.aim(self._footstep_shift[0], dt)
        self._gait.advance(
            state.time,
            dt,
            rate=self._gate,
            soles=self._measured_soles(),
            yaws=self._measured_yaws(),
            loads=state.sole_wrench_in_world[:, 2],
            events=events,
        )
        references.advance(
            state.time, dt, gate_open=gate_open, palms=self._palms, com=self._measured.com, events=events
        )
        contacts.advance(
            dt,
            palms=self._palms,
            palm_forces=state.palm_force_in_world,
            homes=self._from_torso(self._palm_homes),
            events=events,
        )
        asked, self._asked = self._asked, self._gait.feet if self._gait.stride is not None else None
        fresh = self._asked is not None and self._asked is not asked  # a stride from where the feet have not stood yet
        self._improve_postures(iterations=STRIDE_ITERATIONS if fresh else 2)

    def _improve_postures(self, *, iterations: int, everyone: bool = False) -> None:
        """Iterate the tasks' postures and the next candidate's (or everyone's)."""
        feet, stride = self._gait.feet, self._gait.stride
        centre = feet.positions[:, :2].mean(axis=0) if stride is None else stride.stance_centre
        if stride is not None or self._gait.phase == SupportPhase.STAND:  # walking keeps the standing posture
            self._references.update_postures(
                self._contacts,
                soles=feet.positions,
                yaws=feet.yaws,
                stride=stride,
                centre=centre,
                iterations=iterations,
            )
        self._contacts.improve_postures(
            soles=feet.positions, yaws=feet.yaws, centre=centre, iterations=iterations, everyone=everyone
        )

    def _goal_need(self, mass: float) -> Need | None:
        """The need where the current task ends, on the feet that will carry it; None without such a task."""
        com = self._references.goal_com
        if com is None:
            return None
        margin = self._settings.whole_body.zmp_margin
        polygon = self._gait.goal_polygon(half_extents=self._robot.sole_half_extents, margin=margin)
        return need_at_rest(com, polygon=polygon, mass=mass)

    def _supports(self, time: float) -> tuple[SupportPreview, SupportPreview]:
        """Support at full pace and at the gate's, its inset smaller the louder the alarm."""
        settings = self._settings.whole_body
        margin = settings.zmp_margin + self._com.alarm * (settings.zmp_margin_alarm - settings.zmp_margin)

        def preview(rate: float) -> SupportPreview:
            return self._gait.preview(
                time,
                self._preview.times,
                rate=rate,
                margin=margin,
                growth=settings.zmp_margin_growth,
                half_extents=self._robot.sole_half_extents,
            )

        at_once = preview(1.0)
        return at_once, at_once if self._gate >= 1.0 else preview(self._gate)

    def _plan_height(self, wanted: Vector, band: Vector, plane: float) -> tuple[HeightPlan, QpSolution]:
        """Stage 1; when it fails or is turned off the height stays where it is."""
        settings, steps = self._settings.height, self._preview.steps
        limits = np.tile([plane + settings.lowest, plane + settings.highest], (steps, 1))
        plan, solution = self._height_stage.solve(self._com.value[2], wanted=wanted, limits=limits, band=band)
        if plan is None or not settings.enabled:
            self._com.value[2, 1:] = 0.0
            zero = np.zeros(steps)
            plan = HeightPlan(zero, np.full(steps, self._com.value[2, 0]), zero, zero)
        return plan, solution

    def _make_plan(
        self,
        motion: HorizontalPlan | None,
        height: HeightPlan,
        hands: list[tuple[Vector, Vector, HandMode]],
        soles: SoleReferences,
        report: PlanReport,
    ) -> Plan:
        if motion is None and self._last is not None:
            return replace(self._last, report=report)
        n, com, contacts = self._preview.steps, self._com.value, self._contacts.hands
        states = np.empty((n + 1, 3, 3))
        states[0] = com
        jerk = np.zeros((n, 3))
        jerk[:, 2] = height.jerk
        states[1:, 2] = np.column_stack([height.height, height.velocity, height.acceleration])
        velocity = np.zeros(self._robot.nv)
        if motion is not None:
            jerk[:, :2] = motion.jerk
            states[1:, :2] = np.stack([motion.com, motion.velocity, motion.acceleration], axis=2)
            velocity = motion.joint_velocity
        else:
            states[1:, :2] = com[:2]
        palm_position, palm_velocity = self._joints.palms(velocity)
        caps = np.array([c.caps(np.array([0.0, self._period])) for c in contacts])  # now and one plan later
        zero = np.zeros((len(SIDES), 3))
        return Plan(
            time=report.time,
            step=self._preview.step,
            com_states=states,
            com_jerk=jerk,
            q=self._joints.q,
            velocity=velocity,
            torso_rotation=self._joints.torso_rotation,
            torso_angular_velocity=self._joints.torso_velocity(velocity),
            foot_stance=np.array(self._gait.stance),
            foot_position=soles.positions,
            foot_yaw=soles.yaws,
            foot_yaw_rate=soles.yaw_rates,
            foot_velocity=soles.velocities,
            foot_acceleration=soles.accelerations,
            hand_mode=np.array([int(mode) for _, _, mode in hands]),
            hand_position=palm_position,
            hand_velocity=palm_velocity,
            hand_acceleration=zero,
            hand_force=report.contact_force[:, 0],
            hand_force_cap=caps[:, 0],
            hand_force_cap_rate=(caps[:, 1] - caps[:, 0]) / self._period,
            hand_force_cap_top=np.array([c.patch.force_cap if c.patch else 0.0 for c in contacts]),
            hand_normal=np.array([c.patch.normal if c.patch else [0.0, 0.0, 1.0] for c in contacts]),
            hand_friction=np.array([c.patch.friction if c.patch else 0.5 for c in contacts]),
            report=report,
        )


def _stage_report(solution: QpSolution, start: float) -> StageReport:
    return StageReport(solution.status, perf_counter() - start, solution.iterations)
