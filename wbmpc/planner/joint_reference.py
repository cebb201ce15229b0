"""The joint reference: a kinematic copy of the robot that stage 2's joint velocities move."""

from __future__ import annotations

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import SoleReferences
from wbmpc.planner.joint_velocities import VelocityTasks
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.robot import Robot
from wbmpc.rotations import angle_difference, cross, heading_of, level_frame, rotation_error
from wbmpc.signals import SIDES, HandMode, Vector

LIMIT_TIME = 0.1  # [s] within which a joint may come to its end
SPEED_SHARE = 0.6  # of the servo's no-load speed that a plan may use


class JointReference:
    """A configuration q that integrates q̇, and stage 2's velocity tasks linearised at it.

    Each task's velocity has a pull `tracking_rate` · (reference − position at q) that keeps q on its references; the
    reference never takes in measured joint angles, so it is a steady posture to return to after a disturbance.
    """

    def __init__(self, robot: Robot, settings: WholeBodySettings, *, q: Vector) -> None:
        self._robot, self._settings = robot, settings
        self._kinematics = Kinematics(robot)
        self._upper_body = np.setdiff1d(np.arange(robot.nj), np.concatenate(robot.leg_joints))
        self._trunk = np.setdiff1d(self._upper_body, np.concatenate(robot.arm_joints))
        self.q = q.copy()  # (nq,)
        self._kinematics.update_kinematics(self.q)

    @property
    def torso_rotation(self) -> Vector:
        """(3, 3) torso to world at the reference."""
        return self._kinematics.rotation(self._robot.torso_frame)

    def torso_velocity(self, velocity: Vector) -> Vector:
        """Angular velocity (3,) of the torso in world for joint velocities (nv,) [rad/s]."""
        return self._kinematics.jacobian(self._robot.torso_frame)[3:] @ velocity

    def palms(self, velocity: Vector) -> tuple[Vector, Vector]:
        """Palm positions (2, 3) [m] at the reference and their velocities (2, 3) [m/s] for joint velocities (nv,).

        The tracker follows these and not the task's own path: stage 2 has already weighed the palm against the CoM, so
        that a target beyond reach never pulls the robot off its balance.
        """
        frames = self._robot.palm_frames
        return (
            np.array([self._kinematics.position(f) for f in frames]),
            np.array([self._kinematics.jacobian(f)[:3] @ velocity for f in frames]),
        )

    def advance(self, velocity: Vector, dt: float) -> None:
        """Integrate q̇ (nv,) over dt [s]."""
        self.q = self._robot.integrate(self.q, dt * velocity)
        np.clip(self.q[7:], self._robot.joint_lower, self._robot.joint_upper, out=self.q[7:])

    def tasks(
        self,
        *,
        com: Vector,
        vertical_velocity: float,
        soles: SoleReferences,
        hands: list[tuple[Vector, Vector, HandMode]],
        posture: Vector,
        torso_up: Vector,
        torso_heading: float,
    ) -> VelocityTasks:
        """Stage 2's velocity tasks at the reference.

        Args:
            com: planned CoM (3,) now [m].
            vertical_velocity: stage 1's ċ_z [m/s].
            soles: where the feet are or should be in their swing.
            hands: position [m], velocity [m/s] (3,) and mode of each hand.
            posture: (nj,) joint angles to be drawn to [rad].
            torso_up: (3,) where the torso's own vertical should point, in world.
            torso_heading: its yaw [rad].
        """
        robot, settings, kinematics, nv = self._robot, self._settings, self._kinematics, self._robot.nv
        kinematics.update_kinematics(self.q)
        rate = settings.tracking_rate
        foot_jacobian, foot_velocity = np.empty((12, nv)), np.empty(12)
        hand_jacobian, hand_velocity = np.empty((6, nv)), np.zeros(6)
        active = np.zeros(2)
        for side in range(len(SIDES)):
            frame = robot.sole_frames[side]
            level = level_frame(soles.yaws[side])
            rows = slice(6 * side, 6 * side + 6)
            foot_jacobian[rows] = kinematics.jacobian(frame)
            foot_velocity[6 * side : 6 * side + 3] = soles.velocities[side] + rate * (
                soles.positions[side] - kinematics.position(frame)
            )
            foot_velocity[6 * side + 3 : 6 * side + 6] = rate * rotation_error(
                desired=level, measured=kinematics.rotation(frame)
            )
            foot_velocity[6 * side + 5] += soles.yaw_rates[side]
            frame = robot.palm_frames[side]
            hand_jacobian[3 * side : 3 * side + 3] = kinematics.jacobian(frame)[:3]
            position, velocity, mode = hands[side]
            if mode != HandMode.FREE:
                active[side] = 1.0
                pull = rate * (position - kinematics.position(frame))
                norm = float(np.linalg.norm(pull))
                hand_velocity[3 * side : 3 * side + 3] = velocity + pull * min(1.0, 0.4 / max(norm, 1e-9))
        torso = kinematics.rotation(robot.torso_frame)
        torso_error = cross(torso[:, 2], torso_up)
        torso_error[2] += angle_difference(torso_heading, heading_of(torso))
        weight = np.ones(nv)  # the legs carry the CoM about: arms and waist have better things to do
        weight[6 + self._upper_body] = settings.upper_body_share
        for side in range(len(SIDES)):
            if active[side]:
                weight[6 + robot.arm_joints[side]] = weight[6 + self._trunk] = 1.0
        posture_velocity = np.zeros(nv)
        posture_velocity[6:] = settings.posture_rate * (posture - self.q[7:])
        speed = SPEED_SHARE * robot.joint_speed
        lower, upper = np.full(nv, -5.0), np.full(nv, 5.0)
        lower[6:] = np.clip((robot.joint_lower - self.q[7:]) / LIMIT_TIME, -speed, 0.0)
        upper[6:] = np.clip((robot.joint_upper - self.q[7:]) / LIMIT_TIME, 0.0, speed)
        return VelocityTasks(
            com_jacobian=kinematics.com_jacobian,
            com_correction=rate * (com - kinematics.com),
            com_vertical_velocity=vertical_velocity,
            foot_jacobian=foot_jacobian,
            foot_velocity=foot_velocity,
            hand_jacobian=hand_jacobian,
            hand_velocity=hand_velocity,
            hand_active=active,
            torso_jacobian=kinematics.jacobian(robot.torso_frame)[3:],
            torso_velocity=settings.torso_rate * torso_error,
            posture_velocity=posture_velocity,
            posture_weight=weight,
            lower=lower,
            upper=upper,
        )
