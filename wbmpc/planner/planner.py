"""The planner: a snapshot of the robot through stages 1, 2 and 3 to a plan, 100 times a second."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np

from wbmpc.planner.assembly import assemble, stage_report
from wbmpc.planner.bands import height_band
from wbmpc.planner.com_height import ComHeightStage
from wbmpc.planner.com_state import ComState
from wbmpc.planner.contacts import Contacts
from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import Feet
from wbmpc.planner.gait import Gait, SupportPhase
from wbmpc.planner.horizontal_motion import ZmpModel
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.joint_velocities import JointVelocities
from wbmpc.planner.judge import Judge
from wbmpc.planner.keep_out import KeepOut
from wbmpc.planner.plan import Plan, com_course
from wbmpc.planner.preview import Preview
from wbmpc.planner.references import References
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.snapshot import Snapshot
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.tasks import Tasks
from wbmpc.planner.whole_body import HorizontalPlan, WholeBodyStage
from wbmpc.planner.zmp_model import free_model, held, loaded_model
from wbmpc.qp import QpSolution
from wbmpc.robot import Robot
from wbmpc.scenario import Load, Obstacle, PatchPose, Task, Tread
from wbmpc.signals import HandMode, PlanReport, RobotState, Vector

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
        ground: tuple[Tread, ...] = (),
        loads: tuple[Load, ...] = (),
        q: Vector,
        period: float,
    ) -> None:
        """Start from rest at configuration `q` (nq,); `period` is the time between two plans [s]."""
        self._robot, self._settings, self._period = robot, settings, period
        keep_out = self._keep_out = KeepOut(obstacles, forearm_radius=robot.forearm_radius, leg_radius=robot.leg_radius)
        self._preview = Preview(steps=settings.horizon_steps, step=settings.horizon_step)
        self._height_stage = ComHeightStage(self._preview, settings.height, backend=settings.qp_backend)
        joints = JointVelocities(robot.nv, settings.whole_body, backend=settings.qp_backend)
        self._need_stage, self._motion_stage = (
            WholeBodyStage(self._preview, settings.whole_body, joints, backend=settings.qp_backend, ask_shift=ask)
            for ask in (True, False)
        )
        measured = self._measured = Snapshot(robot, q)
        stepping = Stepping(tasks, settings.gait, Footholds(obstacles, robot.sole_half_extents, ground=ground))
        self._gait = Gait(settings.gait, stepping, feet=measured.feet, half_extents=robot.sole_half_extents)
        self._asked: Feet | None = None  # the feet from which the present stride goes
        self._gate, self._footstep_shift = 1.0, np.zeros((MAX_FOOTSTEPS, 2))
        self._com = ComState(settings, com=measured.com, period=period)
        times = self._preview.times
        self._contacts = Contacts(robot, settings, patches, keep_out=keep_out, nominal=q, times=times, period=period)
        self._tasks = Tasks(robot, tasks, loads, palms=measured.palms, heading=float(measured.sole_yaws.mean()))
        self.order = self._tasks.order  # takes a TargetMove, for the next plan
        self._references = References(robot, self._tasks, q=q, height=float(measured.com[2]), times=times)
        self._judge = Judge(
            settings, gait=self._gait, references=self._references, contacts=self._contacts, tasks=self._tasks
        )
        self._joints = JointReference(robot, settings.whole_body, q=q)
        self._improve_postures(iterations=FIRST_ITERATIONS, everyone=True)
        self._last: Plan | None = None
        self._time, self._elapsed = 0.0, period  # [s] of the last snapshot, since it: longer after a skipped plan

    def solve(self, state: RobotState) -> Plan:
        """Plan from a snapshot. A failed solve keeps the last plan (or stands still) and says so in the report."""
        start = perf_counter()
        events: list[str] = []
        settings, preview, contacts, references = self._settings, self._preview, self._contacts, self._references
        self._observe(state)
        self._advance(state, events)
        judged, gated_support = self._supports(state.time)
        plane = gated_support.polygons[0].plane_height
        mass = state.mass_scale * self._robot.mass

        gated, full = references.paths(state.time, contacts)
        foot = self._gait.shares(preview.times, self._gate)
        begin = perf_counter()
        band = height_band(settings.height, gated.palms, references.height_distance(settings.height.reach), plane)
        wanted = references.wanted_height(state.time, contacts, np.maximum(gated.sigma, foot)) - self._gait.crouch
        height, solution = self._height_stage.plan(self._com.value[2], wanted=wanted, band=band, plane=plane)
        stage1 = stage_report(solution, begin)

        begin = perf_counter()
        hands = references.hand_targets(contacts, self._measured.palms)
        soles = self._gait.soles(self._gate)
        tasks = self._joints.tasks(
            *references.attitude(contacts, soles.heading),
            com=self._com.value[:, 0],
            vertical_velocity=float(height.velocity[0]),
            soles=soles,
            hands=hands,
        )

        def stage_2(
            stage: WholeBodyStage, com: Vector, zmp: ZmpModel, support: SupportPreview, com_band: Vector
        ) -> tuple[HorizontalPlan | None, QpSolution]:
            return stage.solve(
                com[:2],
                zmp=zmp,
                support=support,
                com_band=com_band,
                tasks=tasks,
                velocity_time=self._period,
                urgency=1.0 + self._haste * (settings.whole_body.alarm_urgency - 1.0),
            )

        carried = references.carried(preview.times)
        model = free_model(height, plane=plane, mass=mass, exact=settings.formulation == "exact")
        if carried.any():
            model = loaded_model(height, forces=carried, points=gated.palms, plane=plane, mass=mass)
        judgement = self._judge.judge(
            *(state.time, preview.times),
            full,
            lambda com_band: stage_2(self._need_stage, self._com.anticipated, model, judged, com_band)[0],
            height=height,
            model=model,
            carried=carried,
            support=judged,
            palms=self._measured.palms,
            mass=mass,
            events=events,
        )
        forces = contacts.forces + carried
        if contacts.forces.any():  # hands that brace carry nothing: either force is all there is
            points = held(contacts.points, preview.steps)
            model = loaded_model(height, forces=forces, points=points, plane=plane, mass=mass)
        com_band = references.com_band(contacts, gated, foot)
        motion, solution = stage_2(self._motion_stage, self._com.value, model, gated_support, com_band)
        stage2 = stage_report(solution, begin)
        if motion is not None:
            self._footstep_shift = motion.footstep_shift

        course = com_course(self._com.value, motion, height)
        planned = course[0][1:] if motion is not None else np.full((preview.steps, 3, 3), np.nan)
        report = PlanReport(
            time=state.time,
            mass=mass,
            com=planned[:, :, 0].copy(),
            com_acceleration=planned[:, :, 2].copy(),
            com_height_band=band,
            zmp=motion.zmp.copy() if motion is not None else planned[:, :2, 0],  # a report outlives its motion
            support_polygon=gated_support.polygons[0].vertices,
            delta_z=judgement.delta_z,
            hand_reference=gated.palms,
            contact_force=forces,
            contact_phase=np.array([int(c.phase) for c in contacts.hands]),
            contact_patch=(contacts.name(0), contacts.name(1)),
            progress=self._tasks.rate,
            stage1=stage1,
            stage2=stage2,
            stage3=judgement.stage3,
            firing=judgement.firing,
            plan_time=perf_counter() - start,
            events=tuple(events),
        )
        if motion is None and self._last is not None:
            self._last = replace(self._last, report=report)
            return self._last
        modes = [mode for _, _, mode in hands]
        self._last = assemble(
            report,
            step=preview.step,
            period=self._period,
            course=course,
            velocity=motion.joint_velocity if motion is not None else np.zeros(self._robot.nv),
            joints=self._joints,
            stance=self._gait.stance,
            soles=soles,
            modes=modes,
            contacts=contacts.hands,
            lift=self._tasks.lifting,
            arm_keep_out=self._keep_out.of_arms(*self._measured.limbs, free=[m == HandMode.FREE for m in modes]),
        )
        return self._last

    # ------------------------------------------------------------------ steps of one plan

    def _observe(self, state: RobotState) -> None:
        """Take in what was measured; continue the planned state to now."""
        self._measured.update(state)
        self._com.filter(self._measured.com_velocity)
        if self._last is not None:
            self._elapsed = state.time - self._time
            planned = self._last.com_state(state.time)
            height = float(planned[2, 0]) - self._gait.feet.height
            self._com.update(planned, measured=self._measured.com, height=height)
            self._joints.advance(self._last.velocity, self._elapsed)
        self._time = state.time

    def _advance(self, state: RobotState, events: list[str]) -> None:
        """Steps, tasks, contacts and the postures behind them one plan further."""
        contacts, dt = self._contacts, self._elapsed
        gate_open = contacts.gate_open
        go_on = gate_open and not (self._gait.phase == SupportPhase.DOUBLE and contacts.leaving)
        self._gate = min(max(self._gate + (dt if go_on else -dt) / GATE_TIME, 0.0), 1.0)
        self._gait.aim(self._footstep_shift[0], dt)
        self._gait.advance(
            state.time,
            dt,
            rate=self._gate,
            stay=self._tasks.hold_feet,
            soles=self._measured.soles,
            yaws=self._measured.sole_yaws,
            loads=state.sole_wrench_in_world[:, 2],
            zmp=self._measured.feet_zmp,
            events=events,
        )
        self._tasks.advance(
            state.time,
            dt,
            gate_open=gate_open,
            palms=self._measured.palms,
            palm_forces=state.palm_force_in_world,
            homes=self._measured.palm_homes,
            com=self._measured.com,
            events=events,
        )
        if self._tasks.takes_along(stepping=self._gait.stride is not None):
            self._tasks.go_along(self._com.value, self._course, self._gait.soles(self._gate))
        contacts.advance(
            dt,
            palms=self._measured.palms,
            palm_velocities=self._measured.palm_velocities,
            palm_forces=state.palm_force_in_world,
            homes=self._measured.palm_homes,
            urgency=self._haste,
            events=events,
        )
        asked, self._asked = self._asked, self._gait.feet if self._gait.stride is not None else None
        fresh = self._asked is not None and self._asked is not asked  # a stride from where the feet have not stood yet
        self._improve_postures(iterations=STRIDE_ITERATIONS if fresh else 2)

    def _improve_postures(self, *, iterations: int, everyone: bool = False) -> None:
        """Iterate the tasks' postures and the next candidate's (or everyone's)."""
        feet, stride = self._gait.feet, self._gait.stride
        centre = feet.centre if stride is None else stride.stance_centre
        if stride is not None or self._gait.phase == SupportPhase.STAND:  # walking keeps the standing posture
            self._references.update_postures(
                self._contacts, feet=feet, stride=stride, centre=centre, iterations=iterations
            )
        self._contacts.improve_postures(
            soles=feet.positions, yaws=feet.yaws, centre=centre, iterations=iterations, everyone=everyone
        )

    @property
    def _haste(self) -> float:
        """The alarm of a robot that stands; one that steps is not to stop, its coming steps catch it."""
        return self._com.alarm if self._gait.phase == SupportPhase.STAND else 0.0

    @property
    def _course(self) -> Vector:
        """(N, 3) [m] where the CoM will be: the last plan's."""
        if self._last is None or not np.isfinite(self._last.report.com[-1, 0]):  # without an answer of stage 2
            return np.tile(self._com.value[:, 0], (self._preview.steps, 1))
        return self._last.report.com

    def _supports(self, time: float) -> tuple[SupportPreview, SupportPreview]:
        """Support to judge the need for a contact by, at full pace, and to move in, at the gate's.

        The feet may use their edges the louder the alarm; a hand takes its time, and is called by the usual inset.
        """
        settings, alarm, gait = self._settings.whole_body, self._com.alarm, self._gait
        margin = self._com.inset(walking=gait.walking)
        times, growth, com = self._preview.times, settings.zmp_margin_growth, self._course
        preview = partial(gait.preview, time, times, growth=growth, com=com)
        judged = preview(rate=1.0, margin=settings.zmp_margin)
        return judged, judged if self._gate >= 1.0 and not alarm else preview(rate=self._gate, margin=margin)
