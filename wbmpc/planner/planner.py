"""The planner: a snapshot of the robot through stages 1, 2 and 3 to a plan, 100 times a second."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.com_height import ComHeightStage, HeightPlan
from wbmpc.planner.com_state import ComState
from wbmpc.planner.contacts import NOT_RUN, Contacts
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.plan import Plan
from wbmpc.planner.preview import Preview
from wbmpc.planner.references import References, height_band
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.planner.whole_body import HorizontalPlan, WholeBodyStage, ZmpModel
from wbmpc.planner.zmp_model import free_model, loaded_model, need_of
from wbmpc.qp import QpSolution
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose, Task
from wbmpc.signals import SIDES, CandidateReport, HandMode, PlanReport, RobotState, StageReport, Vector

FREE_SHIFT = 1.0  # [m] bound on ΔZ when the need is asked for
FIRST_ITERATIONS = 80  # of every posture, before the first plan


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
        self._preview = Preview(steps=settings.horizon_steps, step=settings.horizon_step)
        self._height_stage = ComHeightStage(self._preview, settings.height, backend=settings.qp_backend)
        self._need_stage, self._motion_stage = (
            WholeBodyStage(self._preview, robot.nv, settings.whole_body, backend=settings.qp_backend) for _ in range(2)
        )
        measured = self._measured = Kinematics(robot)
        measured.update_kinematics(q)
        self._soles = np.array([measured.position(f) for f in robot.sole_frames])
        self._yaws = np.array([_yaw(measured.rotation(f)) for f in robot.sole_frames])
        self._palms = np.array([measured.position(f) for f in robot.palm_frames])
        self._palm_homes = self._palms.copy()
        self._com = ComState(settings, com=measured.com, period=period)
        times = self._preview.times
        self._contacts = Contacts(robot, settings, patches, nominal=q, times=times, period=period)
        self._references = References(robot, tasks, q=q, palms=self._palms, height=float(measured.com[2]), times=times)
        self._joints = JointReference(robot, settings.whole_body, q=q)
        self._improve_postures(self._polygon(alarm=0.0).centre, iterations=FIRST_ITERATIONS, everyone=True)
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
        polygon = self._polygon(alarm=self._com.alarm)
        growth = settings.whole_body.zmp_margin_growth
        polygons = tuple(polygon.shrunk(growth * t) for t in preview.times)
        # A hand takes its time: whether one is needed is judged by the usual inset, even when the feet use their edges.
        calm = self._polygon(alarm=0.0)
        calm_polygons = tuple(calm.shrunk(growth * t) for t in preview.times)
        self._advance(state, polygon, events)
        mass, plane, exact = state.mass_scale * self._robot.mass, polygon.plane_height, settings.formulation == "exact"

        full_pace, _ = references.palms(state.time, contacts, full_pace=True)
        gated, sigma = references.palms(state.time, contacts, full_pace=False)
        begin = perf_counter()
        band = height_band(settings.height, gated, polygon)
        height, solution = self._plan_height(references.wanted_height(state.time, sigma), band, polygon)
        stage1 = _stage_report(solution, begin)

        begin = perf_counter()
        hands = references.hand_targets(contacts, self._palms)
        com_reference = np.tile(polygon.centre, (preview.steps, 1))
        reach_distance = references.reach_distance(contacts)
        tasks = self._joints.tasks(
            com=self._com.value[:, 0],
            vertical_velocity=float(height.velocity[0]),
            soles=self._soles,
            yaws=self._yaws,
            hands=hands,
            posture=references.posture(),
        )
        urgency = 1.0 + self._com.alarm * (settings.whole_body.alarm_urgency - 1.0)

        def stage_2(
            stage: WholeBodyStage,
            state: Vector,
            zmp: ZmpModel,
            reach: Vector,
            shift: float,
            polygons: tuple[SupportPolygon, ...],
        ) -> tuple[HorizontalPlan | None, QpSolution]:
            return stage.solve(
                state[:2],
                zmp=zmp,
                polygons=polygons,
                com_reference=com_reference,
                reach=reach[:, :, :2],
                reach_distance=reach_distance,
                delta_z_limit=shift,
                tasks=tasks,
                velocity_time=self._period,
                urgency=urgency,
            )

        model = free_model(preview, height, plane=plane, mass=mass, exact=exact)
        delta_z = np.zeros((preview.steps, 2))
        candidates: tuple[CandidateReport, ...] = ()
        stage3 = NOT_RUN
        if settings.contact_stage:
            wish, _ = stage_2(self._need_stage, self._com.anticipated, model, full_pace, FREE_SHIFT, calm_polygons)
            if wish is not None:
                delta_z = wish.delta_z
                candidates, stage3 = contacts.plan(
                    need_of(wish, height, model, polygons=calm_polygons, mass=mass, exact=exact),
                    goal=references.goal_com,
                    palms=self._palms,
                    hand_taken=references.hands_taken(),
                    polygon=calm_polygons[-1],
                    events=events,
                )
        forces = contacts.forces
        if forces.any():
            model = loaded_model(preview, height, forces=forces, points=contacts.points, plane=plane, mass=mass)
        motion, solution = stage_2(self._motion_stage, self._com.value, model, gated, 0.0, polygons)
        stage2 = _stage_report(solution, begin)

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
        self._last = self._make_plan(motion, height, hands, report)
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
            plane = float(self._soles[:, 2].mean())
            self._com.update(planned, measured=self._measured.com, height=float(planned[2, 0]) - plane)
            self._joints.advance(self._last.velocity, self._elapsed)
        self._time = state.time

    def _advance(self, state: RobotState, polygon: SupportPolygon, events: list[str]) -> None:
        """Tasks, contacts and the postures behind them one plan further."""
        contacts, references = self._contacts, self._references
        gate_open = contacts.gate_open
        references.advance(state.time, self._elapsed, gate_open=gate_open, palms=self._palms, events=events)
        contacts.advance(
            self._elapsed,
            palms=self._palms,
            palm_velocities=np.array([self._measured.jacobian(f)[:3] @ state.v for f in self._robot.palm_frames]),
            palm_forces=state.palm_force_in_world,
            homes=self._palm_homes,
            urgency=self._com.alarm,
            events=events,
        )
        self._improve_postures(polygon.centre, iterations=2)

    def _improve_postures(self, centre: Vector, *, iterations: int, everyone: bool = False) -> None:
        """Iterate the reach's posture and the next candidate's (or everyone's); `centre` (2,) is the support's [m]."""
        soles, yaws = self._soles, self._yaws
        self._references.update_goal(self._contacts, soles=soles, yaws=yaws, centre=centre, iterations=iterations)
        self._contacts.candidates.refresh(
            soles=soles, yaws=yaws, centre=centre, iterations=iterations, everyone=everyone
        )

    def _polygon(self, *, alarm: float) -> SupportPolygon:
        """Support polygon of the soles, its inset smaller the louder the alarm."""
        settings, half_extents = self._settings.whole_body, self._robot.sole_half_extents
        corners = np.vstack(
            [
                foot_corners(position=sole, yaw=yaw, half_extents=half_extents)
                for sole, yaw in zip(self._soles, self._yaws, strict=True)
            ]
        )
        margin = settings.zmp_margin + alarm * (settings.zmp_margin_alarm - settings.zmp_margin)
        return SupportPolygon.of_corners(corners, margin=margin, plane_height=float(self._soles[:, 2].mean()))

    def _plan_height(self, wanted: Vector, band: Vector, polygon: SupportPolygon) -> tuple[HeightPlan, QpSolution]:
        """Stage 1; when it fails or is turned off the height stays where it is."""
        settings, steps = self._settings.height, self._preview.steps
        limits = np.tile([polygon.plane_height + settings.lowest, polygon.plane_height + settings.highest], (steps, 1))
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
        palm_acceleration = np.zeros((len(SIDES), 3))
        for contact in contacts:
            if contact.hurried:  # straight from its path: stage 2's joint reference would come too late
                side = contact.side
                palm_position[side], palm_velocity[side], palm_acceleration[side] = contact.reference()
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
            foot_stance=np.ones(len(SIDES), dtype=bool),
            foot_position=self._soles,
            foot_yaw=self._yaws,
            foot_velocity=zero,
            foot_acceleration=zero,
            hand_mode=np.array([int(mode) for _, _, mode in hands]),
            hand_position=palm_position,
            hand_velocity=palm_velocity,
            hand_acceleration=palm_acceleration,
            hand_urgency=np.array([float(c.hurried) for c in contacts]),
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


def _yaw(rotation: Vector) -> float:
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))
