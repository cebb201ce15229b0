"""The robot: the contract that its MJCF meets, and the only conversions between MuJoCo and Pinocchio.

One MJCF is the source of both models (`models/README.md` lists what it must contain). MuJoCo simulates it as the plant,
Pinocchio gives the controller its kinematics and dynamics (`wbmpc.kinematics.Kinematics`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbmpc import model_contract
from wbmpc.errors import RobotError
from wbmpc.signals import SIDES, Vector


@dataclass(frozen=True, eq=False)
class Robot:
    """Immutable facts of one robot, shared by all threads. Joint vectors have one order in Pinocchio and in MuJoCo.

    Nothing here changes after `load`: arrays are read-only, and `pin_model` must not be modified. Each thread owns its
    own `Kinematics`, because Pinocchio writes its results into a `pin.Data`.
    """

    path: Path
    pin_model: pin.Model
    nq: int  # 7 + nj
    nv: int  # 6 + nj
    nj: int
    mass: float  # [kg]
    joint_names: tuple[str, ...]  # (nj,)
    joint_lower: Vector  # (nj,) [rad]
    joint_upper: Vector  # (nj,) [rad]
    joint_speed: Vector  # (nj,) [rad/s] no-load speed of the servo
    torque_limit: Vector  # (nj,) [N·m] stall torque of the servo
    armature: Vector  # (nj,) [kg·m²] rotor inertia seen at the joint
    damping: Vector  # (nj,) [N·m·s/rad]
    frictionloss: Vector  # (nj,) [N·m] dry friction
    home_q: Vector  # (nq,) the `home` keyframe: standing, soles on z = 0, x = 0 midway between the sole centres
    sole_frames: tuple[int, int]  # Pinocchio frame ids: x forward, z up, centre of the sole rectangle
    palm_frames: tuple[int, int]  # centre of the palm sphere
    shoulder_frames: tuple[int, int]  # the first joint after the torso on the way to the palm
    elbow_frames: tuple[int, int]  # the last joint before the palm
    leg_frames: tuple[tuple[int, int, int], tuple[int, int, int]]  # hip, knee and ankle: ends of thigh and shank
    torso_frame: int
    imu_frame: int
    leg_joints: tuple[NDArray[np.int64], NDArray[np.int64]]  # joint indices that move each sole, from the base out
    arm_joints: tuple[NDArray[np.int64], NDArray[np.int64]]  # joint indices from shoulder to palm
    sole_half_extents: Vector  # (2,) [m] half length (x) and half width (y)
    palm_radius: float  # [m]
    forearm_radius: float  # [m]
    leg_radius: float  # [m] of the thicker of thigh and shank
    arm_length: float  # [m] from the shoulder to the palm centre, arm stretched

    @classmethod
    def load(cls, path: Path) -> Robot:
        """Read the MJCF at `path` into Pinocchio and check the contract against MuJoCo's reading of the same file.

        Raises:
            RobotError: the file is absent, a library refuses it, or it misses something; the message says what.
        """
        mj_model, pin_model = model_contract.read(path)
        first_joint = 1  # joint 0 is the free joint
        joint_names = tuple(mj_model.joint(i).name for i in range(first_joint, mj_model.njnt))
        palm_frames = _frames(pin_model, "palm")
        torso_frame = pin_model.getFrameId("torso")
        torso_joint = pin_model.frames[torso_frame].parentJoint
        arms = [_chain(pin_model, frame, torso_joint) for frame in palm_frames]
        legs = [_chain(pin_model, frame, 1) for frame in _frames(pin_model, "sole")]
        return cls(
            path=path,
            pin_model=pin_model,
            nq=pin_model.nq,
            nv=pin_model.nv,
            nj=pin_model.nv - 6,
            mass=pin.computeTotalMass(pin_model),
            joint_names=joint_names,
            joint_lower=_frozen(mj_model.jnt_range[first_joint:, 0]),
            joint_upper=_frozen(mj_model.jnt_range[first_joint:, 1]),
            joint_speed=_frozen(mj_model.jnt_user[first_joint:, 0]),
            torque_limit=_frozen(mj_model.jnt_actfrcrange[first_joint:, 1]),
            armature=_frozen(mj_model.dof_armature[6:]),
            damping=_frozen(mj_model.dof_damping[6:]),
            frictionloss=_frozen(mj_model.dof_frictionloss[6:]),
            home_q=_frozen(cls.q_from_qpos(mj_model.key("home").qpos)),
            sole_frames=_frames(pin_model, "sole"),
            palm_frames=palm_frames,
            shoulder_frames=(_joint_frame(pin_model, arms[0][0]), _joint_frame(pin_model, arms[1][0])),
            elbow_frames=(_joint_frame(pin_model, arms[0][-1]), _joint_frame(pin_model, arms[1][-1])),
            leg_frames=(_leg_frames(pin_model, legs[0]), _leg_frames(pin_model, legs[1])),
            torso_frame=torso_frame,
            imu_frame=pin_model.getFrameId("imu"),
            leg_joints=(_joint_indices(legs[0]), _joint_indices(legs[1])),
            arm_joints=(_joint_indices(arms[0]), _joint_indices(arms[1])),
            sole_half_extents=_frozen(mj_model.geom("left_foot").size[:2]),
            palm_radius=float(mj_model.geom("left_palm_geom").size[0]),
            forearm_radius=float(mj_model.geom("left_forearm").size[0]),
            leg_radius=max(float(mj_model.geom(f"left_{link}").size[0]) for link in ("thigh", "shank")),
            arm_length=_stretched_length(pin_model, arms[0], palm_frames[0]),
        )

    def joint_index(self, name: str) -> int:
        """Index of joint `name` in the (nj,) vectors. Raises RobotError that lists the joints."""
        try:
            return self.joint_names.index(name)
        except ValueError:
            raise RobotError(f"{self.path}: no joint {name!r}; joints: {', '.join(self.joint_names)}") from None

    def integrate(self, q: Vector, displacement: Vector) -> Vector:
        """Configuration (nq,) reached from `q` by the tangent `displacement` (nv,): velocity times time."""
        return np.asarray(pin.integrate(self.pin_model, q, displacement))

    def difference(self, *, start: Vector, end: Vector) -> Vector:
        """Tangent displacement (nv,) with `integrate(start, displacement) == end`."""
        return np.asarray(pin.difference(self.pin_model, start, end))

    @staticmethod
    def q_from_qpos(qpos: Vector) -> Vector:
        """Pinocchio configuration (nq,) of MuJoCo's: the base quaternion turns from wxyz to xyzw."""
        q = np.array(qpos, dtype=np.float64)
        q[3:6], q[6] = qpos[4:7], qpos[3]
        return q

    @staticmethod
    def qpos_from_q(q: Vector) -> Vector:
        """MuJoCo configuration (nq,) of Pinocchio's: the base quaternion turns from xyzw to wxyz."""
        qpos = np.array(q, dtype=np.float64)
        qpos[3], qpos[4:7] = q[6], q[3:6]
        return qpos

    @staticmethod
    def v_from_qvel(qpos: Vector, qvel: Vector) -> Vector:
        """Pinocchio velocity (nv,) of MuJoCo's: v = blkdiag(Rᵀ, I, I) qvel.

        Both have the base's angular velocity in the base; the linear one is in the world in MuJoCo, in the base in
        Pinocchio.
        """
        v = np.array(qvel, dtype=np.float64)
        v[:3] = Robot.base_rotation(qpos).T @ qvel[:3]
        return v

    @staticmethod
    def qvel_from_v(qpos: Vector, v: Vector) -> Vector:
        """MuJoCo velocity (nv,) of Pinocchio's, see `v_from_qvel`."""
        qvel = np.array(v, dtype=np.float64)
        qvel[:3] = Robot.base_rotation(qpos) @ v[:3]
        return qvel

    @staticmethod
    def a_from_qacc(qpos: Vector, qvel: Vector, qacc: Vector) -> Vector:
        """Pinocchio acceleration v̇ (nv,) of MuJoCo's: the base frame turns under the velocity, hence −ω × (Rᵀ ṗ)."""
        a = np.array(qacc, dtype=np.float64)
        world_to_base = Robot.base_rotation(qpos).T
        a[:3] = world_to_base @ qacc[:3] - pin.skew(qvel[3:6]) @ world_to_base @ qvel[:3]
        return a

    @staticmethod
    def qacc_from_a(qpos: Vector, v: Vector, a: Vector) -> Vector:
        """MuJoCo acceleration (nv,) of Pinocchio's velocity and acceleration, see `a_from_qacc`."""
        qacc = np.array(a, dtype=np.float64)
        qacc[:3] = Robot.base_rotation(qpos) @ (a[:3] + pin.skew(v[3:6]) @ v[:3])
        return qacc

    @staticmethod
    def base_rotation(qpos: Vector) -> Vector:
        """Rotation (3, 3) from base to world of a MuJoCo configuration."""
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, qpos[3:7])
        return rotation.reshape(3, 3)


def _frozen(values: Vector) -> Vector:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _frames(model: pin.Model, site: str) -> tuple[int, int]:
    left, right = (model.getFrameId(f"{side}_{site}") for side in SIDES)
    return left, right


def _leg_frames(model: pin.Model, leg: list[int]) -> tuple[int, int, int]:
    """Frames of the last hip joint, the knee and the last ankle joint of a leg with three hip and two ankle joints."""
    return _joint_frame(model, leg[2]), _joint_frame(model, leg[-3]), _joint_frame(model, leg[-1])


def _joint_frame(model: pin.Model, joint: int) -> int:
    return int(model.getFrameId(model.names[joint], pin.FrameType.JOINT))


def _chain(model: pin.Model, frame: int, base_joint: int) -> list[int]:
    """Pinocchio joints after `base_joint` on the way to `frame`."""
    supports = list(model.supports[model.frames[frame].parentJoint])
    return supports[supports.index(base_joint) + 1 :]


def _joint_indices(joints: list[int]) -> NDArray[np.int64]:
    indices = np.array(
        [joint - 2 for joint in joints], dtype=np.int64
    )  # joint 0 is the universe, joint 1 the free joint
    indices.setflags(write=False)
    return indices


def _stretched_length(model: pin.Model, joints: list[int], frame: int) -> float:
    offsets = [model.jointPlacements[joint].translation for joint in joints[1:]]
    offsets.append(model.frames[frame].placement.translation)
    return float(sum(np.linalg.norm(offset) for offset in offsets))
