"""The estimator in numpy and Pinocchio: what the compiled one is held against."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbmpc.robot import Robot
from wbmpc.rotations import cross
from wbmpc.signals import GRAVITY, Measurement, RobotState, Vector

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PlainEstimator:
    """See wbmpc.estimator.Estimator."""

    VELOCITY_GAIN = 0.06  # share of the odometry's velocity per tick
    POSITION_GAIN = 0.1  # share of the odometry's position per tick
    JOINT_VELOCITY_GAIN = 0.4  # first-order filter of the joint speeds, per tick
    LOADED = 3.0  # [N] vertical force from which a foot counts as standing
    MASS_TIME = 0.8  # [s] time constant of the mass estimate

    def __init__(self, robot: Robot, *, q: Vector, step: float) -> None:
        """Start at rest at the known configuration `q` (nq,); `step` is the tick's length [s]."""
        self._robot, self._step = robot, step
        self._data = robot.pin_model.createData()
        self._q, self._v = q.copy(), np.zeros(robot.nv)
        self._position, self._imu_velocity = q[:3].copy(), np.zeros(3)
        self._relative_q = q.copy()
        self._relative_q[:7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
        self._relative_v = np.zeros(robot.nv)
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        self._forward(q[7:], np.zeros(robot.nj))
        self._anchor = [self._position + rotation @ self._data.oMf[f].translation for f in robot.sole_frames]
        self._standing = [True, True]
        self._mass_scale = 1.0

    def update(self, measurement: Measurement) -> RobotState:
        """The robot's state at the measurement's time."""
        robot, data, step = self._robot, self._data, self._step
        self._v[6:] += self.JOINT_VELOCITY_GAIN * (measurement.joint_velocity - self._v[6:])
        self._forward(measurement.joint_position, self._v[6:])
        imu = data.oMf[robot.imu_frame]
        imu_twist = pin.getFrameVelocity(robot.pin_model, data, robot.imu_frame, _ALIGNED)
        w, x, y, z = measurement.imu_quaternion
        world_imu = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
        R = world_imu @ imu.rotation.T  # base to world
        omega = imu.rotation @ measurement.imu_gyro - imu_twist.angular  # of the base, in base

        force = measurement.sole_wrench_in_world
        weight_sum, velocity, anchors, soles = 0.0, np.zeros(3), np.zeros(3), np.zeros(3)  # velocity, soles in base
        for side, frame in enumerate(robot.sole_frames):
            load = force[side, 2]
            sole = data.oMf[frame].translation
            if load < self.LOADED:
                self._standing[side] = False
                continue
            if not self._standing[side]:
                self._standing[side] = True
                self._anchor[side] = self._position + R @ sole
            # the point that stands still is the centre of pressure, not the sole's centre: a foot rolls over its edge
            twist = pin.getFrameVelocity(robot.pin_model, data, frame, _ALIGNED)
            pressure = R.T @ np.array([-force[side, 4] / load, force[side, 3] / load, 0.0])
            point = sole + pressure
            moving = twist.linear + cross(twist.angular, pressure) + cross(omega, point)
            velocity -= load * moving
            anchors += load * self._anchor[side]
            soles += load * sole
            weight_sum += load

        lever = R @ (cross(omega, imu.translation) + imu_twist.linear)  # IMU's velocity relative to the base's origin
        self._imu_velocity += step * (world_imu @ measurement.imu_accelerometer - np.array([0.0, 0.0, GRAVITY]))
        if weight_sum > 0.0:
            self._imu_velocity += self.VELOCITY_GAIN * (R @ velocity / weight_sum + lever - self._imu_velocity)
        base_velocity = self._imu_velocity - lever
        self._position += step * base_velocity
        if weight_sum > 0.0:
            self._position += self.POSITION_GAIN * ((anchors - R @ soles) / weight_sum - self._position)

        vertical = float(force[:, 2].sum() + measurement.palm_force_in_world[:, 2].sum())
        if weight_sum > 0.0:
            scale = min(max(vertical / (robot.mass * GRAVITY), 0.5), 1.5)
            self._mass_scale += step / self.MASS_TIME * (scale - self._mass_scale)

        q, v = np.empty(robot.nq), np.empty(robot.nv)
        q[:3], q[3:7], q[7:] = self._position, pin.Quaternion(R).coeffs(), measurement.joint_position
        v[:3], v[3:6], v[6:] = R.T @ base_velocity, omega, self._v[6:]
        return RobotState(
            time=measurement.time,
            q=q,
            v=v,
            sole_wrench_in_world=measurement.sole_wrench_in_world,
            palm_force_in_world=measurement.palm_force_in_world,
            mass_scale=self._mass_scale,
        )

    def _forward(self, joint_position: Vector, joint_velocity: Vector) -> None:
        """Poses and velocities of soles and IMU relative to the base."""
        model, data = self._robot.pin_model, self._data
        self._relative_q[7:], self._relative_v[6:] = joint_position, joint_velocity
        pin.forwardKinematics(model, data, self._relative_q, self._relative_v)
        for frame in (*self._robot.sole_frames, self._robot.imu_frame):
            pin.updateFramePlacement(model, data, frame)
