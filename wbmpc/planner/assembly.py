"""A plan out of what the stages, the gait and the hand contacts have decided."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbmpc.planner.footstep import SoleReferences
from wbmpc.planner.hand_contact import HandContact
from wbmpc.planner.joint_reference import JointReference
from wbmpc.planner.lift import Lift
from wbmpc.planner.plan import Plan
from wbmpc.qp import QpSolution
from wbmpc.rotations import UP
from wbmpc.signals import SIDES, HandMode, PlanReport, StageReport, Vector

NORMALS, FRICTIONS = np.array([UP] * len(SIDES)), np.full(len(SIDES), 0.5)  # of hands without a patch: nobody asks


def assemble(
    report: PlanReport,
    *,
    step: float,
    period: float,
    course: tuple[Vector, Vector],
    velocity: Vector,
    joints: JointReference,
    stance: tuple[bool, bool],
    soles: SoleReferences,
    modes: list[HandMode],
    contacts: list[HandContact],
    lift: Lift | None,
    arm_keep_out: Vector,
) -> Plan:
    """The plan of one snapshot.

    Args:
        step: T [s]; `period`: until the next plan [s].
        course: CoM states (N + 1, 3, 3) and jerks (N, 3), see `com_course`.
        velocity: stage 2's joint velocities (nv,).
        stance: which feet stand.
        modes: of both hands.
        lift: the one that moves them, if one does.
        arm_keep_out: (2, 3, 5) half-spaces of the arms' points; a braced or hurried arm has none.
    """
    palm_position, palm_velocity = joints.palms(velocity)
    palm_acceleration, palm_jerk = np.zeros((len(SIDES), 3)), np.zeros((len(SIDES), 3))
    urgency, friction, normal = np.zeros(len(SIDES)), FRICTIONS.copy(), NORMALS.copy()
    caps, top, ends = np.zeros((len(SIDES), 2)), np.zeros(len(SIDES)), np.array([0.0, period])
    for side, contact in enumerate(contacts):
        patch, hurried = contact.patch, contact.hurried
        if patch is not None:
            friction[side], normal[side], top[side] = patch.friction, patch.normal, patch.force_cap
            # a hurried palm may meet its surface before the next plan
            caps[side] = top[side] if hurried else contact.caps(ends)
        if hurried:  # straight from its path: stage 2's joint reference would come too late
            palm_position[side], palm_velocity[side], palm_acceleration[side] = contact.reference()
            urgency[side], palm_jerk[side] = 1.0, contact.jerk
        if hurried or modes[side] == HandMode.CONTACT:  # its way is planned, or the palm on its surface holds the arm
            arm_keep_out[side, :, 3] = -np.inf
    if lift is not None:
        lift.guard(arm_keep_out)
        urgency[:] = lift.urgency
    return Plan(
        time=report.time,
        step=step,
        com_states=course[0],
        com_jerk=course[1],
        q=joints.q,
        velocity=velocity,
        torso_rotation=joints.torso_rotation,
        torso_angular_velocity=joints.torso_velocity(velocity),
        foot_stance=np.array(stance),
        foot_position=soles.positions,
        foot_yaw=soles.yaws,
        foot_yaw_rate=soles.yaw_rates,
        foot_velocity=soles.velocities,
        foot_acceleration=soles.accelerations,
        hand_mode=np.array([int(mode) for mode in modes]),
        hand_position=palm_position,
        hand_velocity=palm_velocity,
        hand_acceleration=palm_acceleration,
        hand_jerk=palm_jerk,
        hand_urgency=urgency,
        hand_force=report.contact_force[:, 0].copy(),
        hand_force_cap=caps[:, 0],
        hand_force_cap_rate=(caps[:, 1] - caps[:, 0]) / period,
        hand_force_cap_top=top,
        hand_normal=normal,
        hand_friction=friction,
        arm_keep_out=arm_keep_out,
        report=report,
    )


def stage_report(solution: QpSolution, start: float) -> StageReport:
    """The report of a stage that began at perf_counter() = `start` [s] and ends now."""
    return StageReport(solution.status, perf_counter() - start, solution.iterations)
