"""The joint reference: a kinematic copy of the robot that stage 2's joint velocities move."""

from __future__ import annotations

from itertools import product

import numpy as np

from wbmpc.frame_terms import chains_of
from wbmpc.kinematics import Kinematics
from wbmpc.planner.footstep import SoleReferences
from wbmpc.planner.joint_reference_kernel import COM, FEET, HANDS, TORSO, Pulls, Wanted, linearise
from wbmpc.planner.joint_velocities import VelocityTasks
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.robot import Robot
from wbmpc.signals import SIDES, HandMode, Vector

SPEED_SHARE = 0.6  # of the servo's no-load speed that a plan may use


class JointReference:
    """A configuration q that integrates q̇, and stage 2's velocity tasks linearised at it.

    Each task's velocity has a pull `tracking_rate` · (reference − position at q) that keeps q on its references; the
    reference never takes in measured joint angles, so it is a steady posture to return to after a disturbance.
    """

    def __init__(self, robot: Robot, settings: WholeBodySettings, *, q: Vector) -> None:
        self._robot, self._settings = robot, settings
        self._kinematics = Kinematics(robot)
        frames = (*robot.sole_frames, *robot.palm_frames, robot.torso_frame)
        self._views, self._frames = self._kinematics.views, np.array(frames)
        self._chains = chains_of(robot.pin_model, frames)
        self._pulls = Pulls(settings.tracking_rate, settings.torso_rate, settings.posture_rate)
        self._limits = np.array([robot.joint_lower, robot.joint_upper, SPEED_SHARE * robot.joint_speed])
        self._weights = {(left, right): self._weight((left, right)) for left, right in product((False, True), repeat=2)}
        self._palms, self._palm_velocities = np.zeros((2, 3)), np.zeros((2, 3))  # of the references
        self._palm_jacobian, self._torso_jacobian = np.zeros((6, robot.nv)), np.zeros((3, robot.nv))
        self._poses = np.zeros((5, 3))  # [m] palms; the torso's rotation
        self.q = q.copy()  # (nq,)
        self._kinematics.update_kinematics(self.q)

    @property
    def torso_rotation(self) -> Vector:
        """(3, 3) torso to world, where `tasks` looked last."""
        return self._poses[2:]

    def torso_velocity(self, velocity: Vector) -> Vector:
        """Angular velocity (3,) of the torso in world for joint velocities (nv,) [rad/s], where `tasks` looked last."""
        return np.asarray(self._torso_jacobian @ velocity)

    def palms(self, velocity: Vector) -> tuple[Vector, Vector]:
        """Palm positions (2, 3) [m] and their velocities (2, 3) [m/s] for q̇ (nv,), where `tasks` looked last.

        The tracker follows these and not the task's own path: stage 2 has already weighed the palm against the CoM, so
        that a target beyond reach never pulls the robot off its balance.
        """
        return self._poses[:2].copy(), (self._palm_jacobian @ velocity).reshape(2, 3)

    def advance(self, velocity: Vector, dt: float) -> None:
        """Integrate q̇ (nv,) over dt [s]."""
        self.q = self._robot.integrate(self.q, dt * velocity)
        joints = self.q[7:]
        np.maximum(joints, self._robot.joint_lower, out=joints)
        np.minimum(joints, self._robot.joint_upper, out=joints)

    def tasks(
        self,
        posture: Vector,
        torso_up: Vector,
        torso_heading: float,
        *,
        com: Vector,
        vertical_velocity: float,
        soles: SoleReferences,
        hands: list[tuple[Vector, Vector, HandMode]],
    ) -> VelocityTasks:
        """Stage 2's velocity tasks at the reference.

        Args:
            posture: (nj,) joint angles to be drawn to [rad].
            torso_up: (3,) where the torso's own vertical should point, in world.
            torso_heading: its yaw [rad].
            com: planned CoM (3,) now [m].
            vertical_velocity: stage 1's ċ_z [m/s].
            soles: where the feet are or should be in their swing.
            hands: position [m], velocity [m/s] (3,) and mode of each hand.
        """
        palms, velocities, active = self._palms, self._palm_velocities, np.zeros(2)
        for side, (position, velocity, mode) in enumerate(hands):
            palms[side], velocities[side] = position, velocity
            active[side] = 0.0 if mode == HandMode.FREE else 1.0
        self._kinematics.update_kinematics(self.q)
        wanted = Wanted(
            com=np.ascontiguousarray(com),
            soles=soles.positions,
            sole_velocities=soles.velocities,
            sole_yaws=soles.yaws,
            sole_yaw_rates=soles.yaw_rates,
            palms=palms,
            palm_velocities=velocities,
            active=active,
            posture=posture,
            torso_up=torso_up,
            torso_heading=torso_heading,
        )
        J, velocity, joints, self._poses = linearise(
            *(self._views, self._frames, *self._chains, self._pulls, self.q, self._limits, wanted)
        )
        self._palm_jacobian, self._torso_jacobian = J[HANDS], J[TORSO]
        return VelocityTasks(
            com_jacobian=J[COM],
            com_correction=velocity[COM],
            com_vertical_velocity=vertical_velocity,
            foot_jacobian=J[FEET],
            foot_velocity=velocity[FEET],
            hand_jacobian=self._palm_jacobian,
            hand_velocity=velocity[HANDS],
            hand_active=active,
            torso_jacobian=self._torso_jacobian,
            torso_velocity=velocity[TORSO],
            posture_velocity=joints[0],
            posture_weight=self._weights[bool(active[0]), bool(active[1])],
            lower=joints[1],
            upper=joints[2],
        )

    def _weight(self, active: tuple[bool, bool]) -> Vector:
        """(nv,) of the posture: the legs carry the CoM about, arms and waist have better things to do."""
        robot = self._robot
        upper_body = np.setdiff1d(np.arange(robot.nj), np.concatenate(robot.leg_joints))
        weight = np.ones(robot.nv)
        weight[6 + upper_body] = self._settings.upper_body_share
        for side in range(len(SIDES)):
            if active[side]:
                weight[6 + robot.arm_joints[side]] = 1.0
                weight[6 + np.setdiff1d(upper_body, np.concatenate(robot.arm_joints))] = 1.0
        return weight
