"""The estimator: base pose and velocity from joint encoders, IMU and foot forces (contact-aided odometry)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbmpc.estimator_kernel import advance
from wbmpc.frame_terms import chains_of
from wbmpc.robot import Robot
from wbmpc.signals import Measurement, RobotState, Vector


class Estimator:
    """Complementary filter with fixed gains, one update a tick; see estimator_kernel.py for its equations.

    Attitude and angular velocity come from the IMU through the joints between it and the base. The loaded feet do not
    move, which gives the base's position and velocity; the accelerometer fills the time between. A foot is trusted by
    its share of the vertical force; a foot that touches down anew is anchored where it is believed to be.

    The mass is the filtered sum of all vertical contact forces over g: at rest it is exact, whatever the mass.
    """

    def __init__(self, robot: Robot, *, q: Vector, step: float) -> None:
        """Start at rest at the known configuration `q` (nq,); `step` is the tick's length [s]."""
        self._robot, self._step = robot, step
        self._data = data = robot.pin_model.createData()
        self._relative_q = q.copy()  # joints as they are, base at the world's origin
        self._relative_q[:7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
        self._forward()
        frames = (*robot.sole_frames, robot.imu_frame)
        poses = tuple(data.oMf[frame].translation for frame in frames)
        self._frames = (data.J, *chains_of(robot.pin_model, frames), poses, data.oMf[robot.imu_frame].rotation)
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        anchor = np.array([q[:3] + rotation @ sole for sole in poses[:2]])  # (2, 3) [m] where the soles stand
        joint_velocity, imu_velocity, mass_scale = np.zeros(robot.nv), np.zeros(3), np.ones(1)
        standing = np.ones(2, dtype=np.bool_)
        self._memory = (q[:3].copy(), imu_velocity, joint_velocity, anchor, standing, mass_scale)
        self._twist = np.zeros((3, 6))

    def update(self, measurement: Measurement) -> RobotState:
        """The robot's state at the measurement's time."""
        robot = self._robot
        self._relative_q[7:] = measurement.joint_position
        self._forward()
        q, v = np.empty(robot.nq), np.empty(robot.nv)
        seen = (
            *(measurement.joint_position, measurement.joint_velocity, measurement.imu_quaternion),
            *(measurement.imu_gyro, measurement.imu_accelerometer),
            *(measurement.sole_wrench_in_world, measurement.palm_force_in_world),
        )
        scale = advance(seen, self._frames, self._memory, self._twist, robot.mass, self._step, q, v)
        return RobotState(
            time=measurement.time,
            q=q,
            v=v,
            sole_wrench_in_world=measurement.sole_wrench_in_world,
            palm_force_in_world=measurement.palm_force_in_world,
            mass_scale=scale,
        )

    def _forward(self) -> None:
        """Poses and joint screws relative to the base."""
        model, data = self._robot.pin_model, self._data
        pin.computeJointJacobians(model, data, self._relative_q)
        for frame in (*self._robot.sole_frames, self._robot.imu_frame):
            pin.updateFramePlacement(model, data, frame)
