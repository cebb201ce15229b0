"""The plant: MuJoCo's robot and world, its sensors, its servos' limits and the disturbances nobody is told of."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbmpc.physics import Physics
from wbmpc.plant_kernels import contact_sums, servo_torque
from wbmpc.robot import Robot
from wbmpc.scenario import Disturbance, SensorSettings
from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.signals import MAX_CONTACTS, SIDES, Measurement, Truth, Vector

MOST_SEEN = 4 * MAX_CONTACTS  # of MuJoCo's contacts, many of which may carry no force


class Plant:
    """One physics step at a time: `measure`, then `step` with the torques for the coming step.

    Between two steps everything that depends on position and velocity is up to date (`mj_step1`), so a measurement
    belongs to one instant. `step` returns the truth of the step it made: the state at its start, the forces during it.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: Robot,
        *,
        disturbances: tuple[Disturbance, ...],
        sensors: SensorSettings,
        qpos: Vector,
        seed: int,
    ) -> None:
        """Place robot, then free objects at `qpos` (nq,), at rest; `seed` fixes all sensor noise."""
        self.model, self._robot, self._sensors = model, robot, sensors
        self.data = mujoco.MjData(model)
        self._physics = Physics(model, self.data)
        self._step = model.opt.timestep
        self._rng = generator(seed, Stream.SENSOR_NOISE)
        self._noise = _noise_scales(sensors, robot.nj)
        self._pushes = [
            (d, model.body(d.body).id, np.array(d.impulse) / d.duration, np.array(d.point)) for d in disturbances
        ]
        self._root = int(model.jnt_bodyid[0])
        self._sites = np.array([model.site(f"{side}_{name}").id for name in ("sole", "palm") for side in SIDES])
        self._torso = model.body("torso").id
        geom_body = model.geom_bodyid
        self._is_robot = model.body_rootid[geom_body] == self._root
        self._part = np.full(model.ngeom, -1)  # 0, 1: the soles; 2, 3: the palms
        for part, name in enumerate([f"{side}_foot" for side in SIDES] + [f"{side}_palm_geom" for side in SIDES]):
            self._part[model.geom(name).id] = part
        self._sensor = {
            name: slice(int(model.sensor(name).adr[0]), int(model.sensor(name).adr[0] + model.sensor(name).dim[0]))
            for name in ("imu_quaternion", "imu_gyro", "imu_accelerometer")
        }
        kinds = (((2,), int), ((), int), ((9,), float), ((3,), float), ((), float), ((), int))
        self._seen = tuple(np.zeros((MOST_SEEN, *shape), dtype=kind) for shape, kind in kinds)  # see contact_sums
        self._sole_wrench = np.zeros((2, 6))
        self._palm_force = np.zeros((2, 3))
        self.data.qpos[:] = qpos
        mujoco.mj_forward(model, self.data)  # the first measurement has an acceleration too
        mujoco.mj_step1(model, self.data)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

    def measure(self) -> Measurement:
        """What the sensors say now. Contact forces are those of the last step: a force sensor integrates over one."""
        d, nj = self.data, self._robot.nj
        noise = self._noise * self._rng.standard_normal(self._noise.size) if self._sensors.noise_scale else None
        joint_position, joint_velocity = d.qpos[7 : 7 + nj].copy(), d.qvel[6 : 6 + nj].copy()
        quaternion = d.sensordata[self._sensor["imu_quaternion"]].copy()
        gyro = d.sensordata[self._sensor["imu_gyro"]].copy()
        accelerometer = d.sensordata[self._sensor["imu_accelerometer"]].copy()
        sole, palm = self._sole_wrench.copy(), self._palm_force.copy()
        if noise is not None:
            joint_position += noise[:nj]
            joint_velocity += noise[nj : 2 * nj]
            rest = noise[2 * nj :]
            gyro += rest[:3]
            accelerometer += rest[3:6]
            turn = np.empty(4)
            mujoco.mju_axisAngle2Quat(turn, rest[6:9] / (np.linalg.norm(rest[6:9]) + 1e-12), np.linalg.norm(rest[6:9]))
            mujoco.mju_mulQuat(quaternion, quaternion.copy(), turn)
            sole += rest[9:21].reshape(2, 6)
            palm += rest[21:27].reshape(2, 3)
        return Measurement(
            time=float(d.time),
            joint_position=joint_position,
            joint_velocity=joint_velocity,
            imu_quaternion=quaternion,
            imu_gyro=gyro,
            imu_accelerometer=accelerometer,
            sole_wrench_in_world=sole,
            palm_force_in_world=palm,
        )

    def step(self, torque: Vector) -> Truth:
        """Apply `torque` (nj,) [N·m], clipped to the servo's torque-speed line, for one step; returns what happened."""
        d, robot = self.data, self._robot
        time, qpos, qvel = float(d.time), d.qpos.copy(), d.qvel.copy()
        applied, limit = np.empty(robot.nj), np.empty(robot.nj)
        servo_torque(torque, qvel, robot.joint_speed, robot.torque_limit, applied, limit)
        d.ctrl[:] = applied
        external = self._push(time)
        self._physics.subtree_velocity()
        com, com_velocity = d.subtree_com[self._root].copy(), d.subtree_linvel[self._root].copy()
        sites = d.site_xpos.take(self._sites, axis=0)
        sole, palm = sites[:2], sites[2:]
        torso_up = float(d.xmat[self._torso, 8])
        self._physics.step2()
        contacts = self._contacts(sole)
        self._physics.step1()
        return Truth(
            time=time,
            qpos=qpos,
            qvel=qvel,
            torque=applied,
            torque_limit=limit,
            com=com,
            com_velocity=com_velocity,
            palm_position=palm,
            sole_position=sole,
            torso_up=torso_up,
            external_force=external,
            zmp=contacts[5],
            contact_count=contacts[0],
            contact_geoms=contacts[1],
            contact_position=contacts[2],
            contact_force=contacts[3],
            contact_distance=contacts[4],
        )

    def _push(self, time: float) -> Vector:
        """Set the forces of the disturbances that act in the coming step; returns their sum (3,) [N]."""
        total = np.zeros(3)
        if not self._pushes:
            return total
        d = self.data
        d.qfrc_applied[:] = 0.0
        for push, body, force, point in self._pushes:
            share = min(time + self._step, push.end) - max(time, push.time)
            if share > 1e-9:
                now = force * min(share / self._step, 1.0)
                where = d.xpos[body] + d.xmat[body].reshape(3, 3) @ point
                mujoco.mj_applyFT(self.model, d, now, np.zeros(3), where, body, d.qfrc_applied)
                total += now
        return total

    def _contacts(self, sole: Vector) -> tuple[int, NDArray[np.int64], Vector, Vector, Vector, Vector]:
        """Contacts of the step just made, forces on the robot, and the ZMP; also the wrenches the force sensors see."""
        d, contact, seen = self.data, self.data.contact, self._seen
        geoms, zmp = np.full((MAX_CONTACTS, 2), -1, dtype=np.int64), np.empty(2)
        position, force = np.zeros((MAX_CONTACTS, 3)), np.zeros((MAX_CONTACTS, 3))
        distance = np.zeros(MAX_CONTACTS)
        count = min(d.ncon, len(seen[0]))
        if count:
            fields = (contact.geom, contact.efc_address, contact.frame, contact.pos, contact.dist, contact.dim)
            for cell, field in zip(seen, fields, strict=True):
                cell[:count] = field[:count]
        kept = contact_sums(
            *(count, seen, d.efc_force, self._is_robot, self._part, sole),
            *((geoms, position, force, distance), self._sole_wrench, self._palm_force, zmp),
        )
        return kept, geoms, position, force, distance, zmp


def _noise_scales(sensors: SensorSettings, joints: int) -> Vector:
    """Standard deviations (2 nj + 27,) in the order in which `measure` uses them."""
    wrench = [sensors.force_noise] * 3 + [sensors.moment_noise] * 3
    return sensors.noise_scale * np.concatenate(
        [
            np.full(joints, sensors.joint_position_noise),
            np.full(joints, sensors.joint_velocity_noise),
            np.full(3, sensors.gyro_noise),
            np.full(3, sensors.accelerometer_noise),
            np.full(3, sensors.orientation_noise),
            wrench + wrench,
            np.full(6, sensors.force_noise),
        ]
    )
