"""The plan: what one run of the three stages hands to the tracker, sampled at any later tick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.horizontal_motion import Motion
from wbmpc.planner.plan_kernel import com_at, continue_plan, join_courses
from wbmpc.record import record
from wbmpc.signals import PlanReport, Setpoint, Vector


@record
class Plan:
    """References from the snapshot's time on. Interpolation lives here and nowhere else.

    The CoM follows its constant jerks exactly; joints, feet and hands are continued with their velocity (and
    acceleration) from the snapshot's time, for at most one knot: a late plan's tail holds still after that.
    """

    time: float  # [s] of the snapshot
    step: float  # [s] T
    com_states: Vector  # (N + 1, 3 axes, 3) c, ċ, c̈ at the snapshot and at every knot, in world
    com_jerk: Vector  # (N, 3) [m/s³]
    q: Vector  # (nq,) posture reference at the snapshot
    velocity: Vector  # (nv,) q̇ of stage 2
    torso_rotation: Vector  # (3, 3) of the posture reference, in world
    torso_angular_velocity: Vector  # (3,) [rad/s]
    foot_stance: NDArray[np.bool_]  # (2,)
    foot_position: Vector  # (2, 3) [m]
    foot_yaw: Vector  # (2,) [rad]
    foot_yaw_rate: Vector  # (2,) [rad/s]
    foot_velocity: Vector  # (2, 3) [m/s]
    foot_acceleration: Vector  # (2, 3) [m/s²]
    hand_mode: NDArray[np.int64]  # (2,)
    hand_position: Vector  # (2, 3) [m]
    hand_velocity: Vector  # (2, 3) [m/s]
    hand_acceleration: Vector  # (2, 3) [m/s²]
    hand_jerk: Vector  # (2, 3) [m/s³]
    hand_urgency: Vector  # (2,) 0 … 1
    hand_force: Vector  # (2, 3) [N]
    hand_force_cap: Vector  # (2,) [N] at the snapshot
    hand_force_cap_rate: Vector  # (2,) [N/s]
    hand_force_cap_top: Vector  # (2,) [N]
    hand_normal: Vector  # (2, 3)
    hand_friction: Vector  # (2,)
    arm_keep_out: Vector  # (2, 3, 5)
    report: PlanReport

    def com_state(self, time: float) -> Vector:
        """CoM state (3 axes, 3) = c, ċ, c̈ at `time` [m, m/s, m/s²]; it stays at the last knot after the horizon."""
        out = np.empty((3, 3))
        com_at(max(time - self.time, 0.0), self.step, self.com_states, self.com_jerk, out)
        return out.T

    def sample(self, time: float) -> Setpoint:
        """The setpoint at `time` ≥ the snapshot's."""
        elapsed = max(time - self.time, 0.0)
        com = np.empty((3, 3))
        com_at(elapsed, self.step, self.com_states, self.com_jerk, com)
        nj, foot, hand = len(self.velocity) - 6, np.empty((3, 2, 3)), np.empty((3, 2, 3))
        joint, torso, pairs = np.empty((2, nj)), np.empty((4, 3)), np.empty((3, 2))
        continue_plan(
            min(elapsed, self.step),
            1.0 if elapsed <= self.step + 1e-9 else 0.0,  # a late plan's tail holds still
            (self.q, self.velocity),
            (self.torso_rotation, self.torso_angular_velocity),
            (self.foot_position, self.foot_velocity, self.foot_acceleration, self.foot_yaw, self.foot_yaw_rate),
            (
                *(self.hand_position, self.hand_velocity, self.hand_acceleration, self.hand_jerk),
                *(self.hand_force_cap, self.hand_force_cap_rate, self.hand_force_cap_top),
            ),
            (*joint, torso[:3], torso[3], *foot, *pairs[:2], *hand, pairs[2]),
        )
        return Setpoint(
            time=time,
            com_position=com[0],
            com_velocity=com[1],
            com_acceleration=com[2],
            joint_position=joint[0],
            joint_velocity=joint[1],
            torso_rotation=torso[:3],
            torso_angular_velocity=torso[3],
            foot_stance=self.foot_stance,
            foot_position=foot[0],
            foot_yaw=pairs[0],
            foot_yaw_rate=pairs[1],
            foot_velocity=foot[1],
            foot_acceleration=foot[2],
            hand_mode=self.hand_mode,
            hand_position=hand[0],
            hand_velocity=hand[1],
            hand_acceleration=hand[2],
            hand_urgency=self.hand_urgency,
            hand_force=self.hand_force,
            hand_force_cap=pairs[2],
            hand_normal=self.hand_normal,
            hand_friction=self.hand_friction,
            arm_keep_out=self.arm_keep_out,
        )


def com_course(now: Vector, motion: Motion | None, height: HeightPlan) -> tuple[Vector, Vector]:
    """CoM states (N + 1, 3 axes, 3) now and at every knot, and jerks (N, 3), of what stages 1 and 2 have planned.

    Args:
        now: (3, 3) c, ċ, c̈ per axis [m, m/s, m/s²].
        motion: None when stage 2 has failed: the CoM stays where it is, with its velocity as reference.
        height: stage 1's answer.
    """
    n = len(height.jerk)
    if motion is None:
        jerk, (com, velocity, acceleration) = np.zeros((n, 2)), np.tile(now[:2].T[:, None], (1, n, 1))
    else:
        jerk, com, velocity, acceleration = motion.jerk, motion.com, motion.velocity, motion.acceleration
    states, jerks = join_courses(
        *(np.ascontiguousarray(now), jerk, com, velocity, acceleration),
        *(height.jerk, height.height, height.velocity, height.acceleration),
    )
    return states, jerks
