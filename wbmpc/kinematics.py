"""Kinematics and dynamics of the controller's model at one state, from Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbmpc.robot import Robot
from wbmpc.signals import GRAVITY, Vector

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Kinematics:
    """Everything the controller asks of the model at one state (q, v). One instance per thread: it owns a `pin.Data`.

    Call `update` (all terms, about 12 µs for 23 joints) or `update_kinematics` (no velocity, no dynamics, about 4 µs),
    then read. Every array handed out is a fresh C-contiguous copy: the next update does not change it.

    Frames are Pinocchio frame ids (`robot.sole_frames[side]`, ...). Spatial vectors are linear first, then angular, at
    the frame's origin in world axes (LOCAL_WORLD_ALIGNED); accelerations are d/dt of the velocity so defined.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._model = robot.pin_model
        self._data = robot.pin_model.createData()
        self._has_velocity = False

    def update(self, q: Vector, v: Vector) -> None:
        """Compute all terms at q (nq,), v (nv,), Pinocchio's conventions."""
        pin.computeAllTerms(self._model, self._data, q, v)
        pin.updateFramePlacements(self._model, self._data)
        self._has_velocity = True

    def update_kinematics(self, q: Vector) -> None:
        """Compute poses, Jacobians, CoM and its Jacobian at q (nq,); the rest raises RuntimeError until `update`."""
        pin.computeJointJacobians(self._model, self._data, q)
        pin.jacobianCenterOfMass(self._model, self._data, False)
        pin.updateFramePlacements(self._model, self._data)
        self._has_velocity = False

    @property
    def views(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Where Pinocchio keeps them, for kernels: read after any update, and never written.

        Joint screws about the world's origin (6, nv), the CoM's Jacobian (3, nv) and place (3,), and the poses of all
        frames (frames, 4, 3): the columns of a frame's rotation to world, then its origin. A `pin.Data` never moves its
        memory.
        """
        data = self._data
        first, last, count = data.oMf[0].rotation, data.oMf[len(data.oMf) - 1].translation, len(data.oMf)
        poses = np.lib.stride_tricks.as_strided(first, (count, 4, 3), (96, 24, 8))
        if poses[-1, 3].ctypes.data != last.ctypes.data:
            raise RuntimeError("this Pinocchio keeps the poses of frames in another order than expected")
        return data.J, data.Jcom, data.com[0], poses

    def position(self, frame: int) -> Vector:
        """Origin (3,) of the frame in world [m]."""
        return np.array(self._data.oMf[frame].translation)

    def rotation(self, frame: int) -> Vector:
        """Rotation (3, 3) from the frame to world."""
        return np.array(self._data.oMf[frame].rotation, order="C")

    def jacobian(self, frame: int) -> Vector:
        """Jacobian (6, nv) of the frame's velocity."""
        return np.ascontiguousarray(pin.getFrameJacobian(self._model, self._data, frame, _ALIGNED))

    def velocity(self, frame: int) -> Vector:
        """Velocity (6,) of the frame [m/s, rad/s]."""
        return np.array(pin.getFrameVelocity(self._model, self._dynamic_data, frame, _ALIGNED).vector)

    def drift(self, frame: int) -> Vector:
        """J̇ v (6,): the frame's acceleration at v̇ = 0 [m/s², rad/s²]."""
        return np.array(pin.getFrameClassicalAcceleration(self._model, self._dynamic_data, frame, _ALIGNED).vector)

    @property
    def com(self) -> Vector:
        """Centre of mass (3,) in world [m]."""
        return np.array(self._data.com[0])

    @property
    def com_jacobian(self) -> Vector:
        """Jacobian (3, nv) of the CoM's velocity."""
        return np.array(self._data.Jcom, order="C")

    @property
    def com_velocity(self) -> Vector:
        """Velocity (3,) of the CoM in world [m/s]."""
        return np.array(self._dynamic_data.vcom[0])

    @property
    def com_drift(self) -> Vector:
        """J̇ v (3,): the CoM's acceleration at v̇ = 0 [m/s²]."""
        drift = self._data.oMi[1].rotation @ self._dynamic_data.nle[:3] / self.robot.mass
        drift[2] -= GRAVITY
        return np.asarray(drift)

    @property
    def mass_matrix(self) -> Vector:
        """Joint-space inertia M (nv, nv), symmetric, armature included."""
        return np.array(self._dynamic_data.M, order="C")

    @property
    def bias(self) -> Vector:
        """h (nv,) of M v̇ + h = τ: Coriolis, centrifugal and gravity terms [N, N·m]; joint friction is not in it."""
        return np.array(self._dynamic_data.nle)

    @property
    def centroidal_momentum_matrix(self) -> Vector:
        """A (6, nv) of (m ċ, L) = A v: linear momentum, then angular momentum about the CoM, in world."""
        return np.array(self._dynamic_data.Ag, order="C")

    @property
    def centroidal_momentum_drift(self) -> Vector:
        """Ȧ v (6,) [N, N·m].

        Read off the base rows of the bias: at v̇ = 0 they are the wrench that gives the robot this momentum rate in
        gravity, and gravity has no moment about the CoM. Ȧ itself would cost another recursion over the joints.
        """
        base = self._data.oMi[1]
        about_com = pin.SE3(base.rotation, base.translation - self._data.com[0])
        wrench = about_com.act(pin.Force(self._dynamic_data.nle[:6])).vector
        wrench[2] -= self.robot.mass * GRAVITY
        return np.array(wrench)

    @property
    def _dynamic_data(self) -> pin.Data:
        if not self._has_velocity:
            raise RuntimeError(
                "velocities and dynamics need update(q, v); update_kinematics(q) computed positions only"
            )
        return self._data
