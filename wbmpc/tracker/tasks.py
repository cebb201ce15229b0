"""The tracker's tasks: each writes its rows  J v̇ = a_wanted − J̇v  and their weights into the stack."""

from __future__ import annotations

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.robot import Robot
from wbmpc.rotations import level_frame, rotation_error
from wbmpc.signals import HandMode, Setpoint, Vector
from wbmpc.tracker.settings import TrackerSettings

COM, MOMENTUM, TORSO, FEET, HANDS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 21), slice(21, 27)
TASK_ROWS = 27
FREE, CONTACT, CARRY = (
    int(mode) for mode in (HandMode.FREE, HandMode.CONTACT, HandMode.CARRY)
)  # plain numbers: enum look-ups cost microseconds


class TaskStack:
    """All tasks of one tick as  matrix (27, nv) v̇ = target (27,)  with weights (27,), written in place.

    Rows: CoM, angular momentum about the CoM, torso rotation, left and right sole, left and right palm. The posture
    task is diagonal and lives in the tracker.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings, *, step: float) -> None:
        """`step` is the tick's length [s], for the integrals."""
        self._robot, self._settings, self._step = robot, settings, step
        self.matrix = np.zeros((TASK_ROWS, robot.nv))
        self.target = np.zeros(TASK_ROWS)
        self.weight = np.zeros(TASK_ROWS)
        self.weight[COM] = settings.com_weight, settings.com_weight, settings.com_height_weight
        self.weight[MOMENTUM] = settings.momentum_weight
        self.weight[TORSO] = settings.torso_weight
        self._v = np.zeros(robot.nv)
        self._com_integral = np.zeros(3)  # [m s]
        self._hand_integral = np.zeros((2, 3))  # [m s]

    def build(self, kinematics: Kinematics, v: Vector, setpoint: Setpoint) -> None:
        """Write the rows for the state that `kinematics` was updated with; `v` (nv,) is its velocity."""
        self._v = v
        self._com(kinematics, setpoint)
        momentum = kinematics.centroidal_momentum_matrix[3:]
        self.matrix[MOMENTUM] = momentum
        self.target[MOMENTUM] = (
            -self._settings.momentum_damping * (momentum @ self._v) - kinematics.centroidal_momentum_drift[3:]
        )
        self._torso(kinematics, setpoint)
        for side in range(2):
            self._foot(kinematics, setpoint, side)
            self._hand(kinematics, setpoint, side)

    @property
    def integrals(self) -> tuple[Vector, Vector]:
        """Of CoM (3,) and palms (2, 3) [m s]."""
        return self._com_integral, self._hand_integral

    def forget(self) -> None:
        """Clear the integrals: after a failed solve their content is not to be trusted (it may not be finite)."""
        self._com_integral[:], self._hand_integral[:] = 0.0, 0.0

    def _com(self, kinematics: Kinematics, setpoint: Setpoint) -> None:
        s = self._settings
        error = setpoint.com_position - kinematics.com
        self._com_integral[2] += self._step * error[2]
        bound = s.com_integral_limit / max(s.com_integral, 1e-9)
        self._com_integral[2] = min(max(self._com_integral[2], -bound), bound)
        self.matrix[COM] = kinematics.com_jacobian
        self.target[COM] = (
            setpoint.com_acceleration
            + s.com_stiffness * error
            + s.com_damping * (setpoint.com_velocity - kinematics.com_velocity)
            + s.com_integral * self._com_integral
            - kinematics.com_drift
        )

    def _torso(self, kinematics: Kinematics, setpoint: Setpoint) -> None:
        s, frame = self._settings, self._robot.torso_frame
        jacobian = kinematics.jacobian(frame)[3:]
        error = rotation_error(desired=setpoint.torso_rotation, measured=kinematics.rotation(frame))
        self.matrix[TORSO] = jacobian
        self.target[TORSO] = (
            s.torso_stiffness * error
            + s.torso_damping * (setpoint.torso_angular_velocity - jacobian @ self._v)
            - kinematics.drift(frame)[3:]
        )

    def _foot(self, kinematics: Kinematics, setpoint: Setpoint, side: int) -> None:
        s, frame = self._settings, self._robot.sole_frames[side]
        rows = slice(FEET.start + 6 * side, FEET.start + 6 * side + 6)
        jacobian = kinematics.jacobian(frame)
        velocity = jacobian @ self._v
        self.matrix[rows] = jacobian
        if setpoint.foot_stance[side]:
            self.weight[rows] = s.stance_weight
            self.target[rows] = -s.stance_damping * velocity - kinematics.drift(frame)
            # a push may lift a stance foot; damping alone lets it drift, into the other foot
            away = setpoint.foot_position[side] - kinematics.position(frame)
            self.target[rows][:2] += s.stance_stiffness * away[:2]
            return
        self.weight[rows] = s.swing_weight
        level = level_frame(setpoint.foot_yaw[side])
        target = self.target[rows]
        target[:3] = setpoint.foot_acceleration[side] + s.swing_stiffness * (
            setpoint.foot_position[side] - kinematics.position(frame)
        )
        target[:3] += s.swing_damping * setpoint.foot_velocity[side]
        target[3:] = s.swing_stiffness * rotation_error(desired=level, measured=kinematics.rotation(frame))
        target[5] += s.swing_damping * setpoint.foot_yaw_rate[side]
        target -= s.swing_damping * velocity + kinematics.drift(frame)

    def _hand(self, kinematics: Kinematics, setpoint: Setpoint, side: int) -> None:
        s, frame = self._settings, self._robot.palm_frames[side]
        rows = slice(HANDS.start + 3 * side, HANDS.start + 3 * side + 3)
        mode = int(setpoint.hand_mode[side])
        if mode == FREE:
            self.weight[rows] = 0.0
            self._hand_integral[side] = 0.0
            return
        jacobian = kinematics.jacobian(frame)[:3]
        velocity = jacobian @ self._v
        self.matrix[rows] = jacobian
        if mode == CONTACT:
            self.weight[rows] = s.braced_weight
            self.target[rows] = -s.stance_damping * velocity - kinematics.drift(frame)[:3]
            self._hand_integral[side] = 0.0
            return
        if mode == CARRY:
            self._carry(kinematics, setpoint, side, velocity)
            return
        urgency = float(setpoint.hand_urgency[side])
        self.weight[rows] = s.hand_weight + urgency * (s.urgent_hand_weight - s.hand_weight)
        limit = s.hand_acceleration_limit
        limit += urgency * (s.urgent_hand_acceleration_limit - limit)
        error = setpoint.hand_position[side] - kinematics.position(frame)
        integral = self._hand_integral[side]
        if abs(setpoint.hand_velocity[side]).max() < 0.02:  # a moving hand's lag is not a steady error
            integral += self._step * error
            bound = s.hand_integral_limit / max(s.hand_integral, 1e-9)
            np.clip(integral, -bound, bound, out=integral)
        wanted = s.hand_stiffness * error + s.hand_damping * (setpoint.hand_velocity[side] - velocity)
        wanted += s.hand_integral * integral
        norm = float(np.sqrt(wanted @ wanted))
        if norm > limit:
            wanted *= limit / norm
        self.target[rows] = setpoint.hand_acceleration[side] + wanted - kinematics.drift(frame)[:3]

    def _carry(self, kinematics: Kinematics, setpoint: Setpoint, side: int, velocity: Vector) -> None:
        """Both palms follow their paths, but for how far they are apart: that is the held thing's to say."""
        s, frames = self._settings, self._robot.palm_frames
        rows = slice(HANDS.start + 3 * side, HANDS.start + 3 * side + 3)
        own, other = kinematics.position(frames[side]), kinematics.position(frames[1 - side])
        across = own - other
        error = setpoint.hand_position[side] - own
        apart = error - setpoint.hand_position[1 - side] + other
        error -= (0.5 * float(apart @ across) / float(across @ across)) * across
        self.weight[rows] = s.carry_weight
        self.target[rows] = s.hand_stiffness * error + s.hand_damping * (setpoint.hand_velocity[side] - velocity)
        self.target[rows] += setpoint.hand_acceleration[side] - kinematics.drift(frames[side])[:3]
        self._hand_integral[side] = 0.0
