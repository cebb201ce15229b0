"""The plant: MuJoCo's robot and world, its sensors, its servos' limits and the disturbances nobody is told of."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbmpc.robot import Robot
from wbmpc.rotations import cross
from wbmpc.scenario import Disturbance, SensorSettings
from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.signals import MAX_CONTACTS, SIDES, Measurement, Truth, Vector

PARTS = np.arange(4)[:, None]  # left and right sole, left and right palm


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
        self._step = model.opt.timestep
        self._rng = generator(seed, Stream.SENSOR_NOISE)
        self._noise = _noise_scales(sensors, robot.nj)
        self._pushes = [
            (d, model.body(d.body).id, np.array(d.impulse) / d.duration, np.array(d.point)) for d in disturbances
        ]
        self._root = int(model.jnt_bodyid[0])
        self._soles = [model.site(f"{side}_sole").id for side in SIDES]
        self._palms = [model.site(f"{side}_palm").id for side in SIDES]
        self._torso = model.body("torso").id
        geom_body = model.geom_bodyid
        self._is_robot = model.body_rootid[geom_body] == self._root
        self._part = np.full(model.ngeom, -1)  # which of PARTS a geom is
        for part, name in enumerate([f"{side}_foot" for side in SIDES] + [f"{side}_palm_geom" for side in SIDES]):
            self._part[model.geom(name).id] = part
        self._sensor = {
            name: slice(int(model.sensor(name).adr[0]), int(model.sensor(name).adr[0] + model.sensor(name).dim[0]))
            for name in ("imu_quaternion", "imu_gyro", "imu_accelerometer")
        }
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
        m, d, robot = self.model, self.data, self._robot
        time, qpos, qvel = float(d.time), d.qpos.copy(), d.qvel.copy()
        speed = qvel[6 : 6 + robot.nj] / robot.joint_speed
        upper = robot.torque_limit * np.minimum(np.maximum(1.0 - speed, 0.0), 1.0)
        lower = robot.torque_limit * np.maximum(np.minimum(-1.0 - speed, 0.0), -1.0)
        applied = np.minimum(np.maximum(torque, lower), upper)
        d.ctrl[:] = applied
        external = self._push(time)
        mujoco.mj_subtreeVel(m, d)
        com, com_velocity = d.subtree_com[self._root].copy(), d.subtree_linvel[self._root].copy()
        palm, sole = d.site_xpos[self._palms], d.site_xpos[self._soles]
        torso_up = float(d.xmat[self._torso, 8])
        mujoco.mj_step2(m, d)
        contacts = self._contacts(sole)
        mujoco.mj_step1(m, d)
        return Truth(
            time=time,
            qpos=qpos,
            qvel=qvel,
            torque=applied,
            torque_limit=np.where(applied >= 0.0, upper, -lower),
            com=com,
            com_velocity=com_velocity,
            palm_position=palm,
            sole_position=sole,
            torso_up=torso_up,
            external_force=external,
            zmp=self._centre_of_pressure(sole),
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

    def _contacts(self, sole: Vector) -> tuple[int, NDArray[np.int64], Vector, Vector, Vector]:
        """Contacts of the step just made, forces on the robot; also the wrenches the force sensors see."""
        d = self.data
        contact, count = d.contact, d.ncon
        geoms = np.full((MAX_CONTACTS, 2), -1, dtype=np.int64)
        position, force = np.zeros((MAX_CONTACTS, 3)), np.zeros((MAX_CONTACTS, 3))
        distance = np.zeros(MAX_CONTACTS)
        self._sole_wrench[:], self._palm_force[:] = 0.0, 0.0
        if count == 0:
            return 0, geoms, position, force, distance
        pairs, address = contact.geom, contact.efc_address
        keep = address >= 0
        if not keep.all():
            pairs, address = pairs[keep], address[keep]
            frame, where, gap = contact.frame[keep], contact.pos[keep], contact.dist[keep]
        else:
            frame, where, gap = contact.frame, contact.pos, contact.dist
        count = min(len(address), MAX_CONTACTS)
        if count == 0:
            return 0, geoms, position, force, distance
        pairs, address, frame = pairs[:count], address[:count], frame[:count].reshape(count, 3, 3)
        local = d.efc_force[address[:, None] + np.arange(3)]  # normal, two tangents (elliptic cone)
        on_second = np.einsum("ci,cij->cj", local, frame)  # the normal points from the first geom to the second
        spin = np.where(contact.dim[keep][:count] >= 4, d.efc_force[np.minimum(address + 3, d.nefc - 1)], 0.0)
        second_is_robot = self._is_robot[pairs[:, 1]]
        torsion = np.where(second_is_robot, spin, -spin)[:, None] * frame[:, 0]  # condim 4: moment about the normal
        world = np.where(second_is_robot[:, None], on_second, -on_second)
        geoms[:count], position[:count], force[:count], distance[:count] = pairs, where[:count], world, gap[:count]
        part = np.maximum(self._part[pairs[:, 0]], self._part[pairs[:, 1]])
        select = (part == PARTS).astype(np.float64)  # (4, count): soles, then palms
        sums = select @ world
        point = where[:count]
        moment = torsion  # about the world's origin, then about the sole
        moment[:, 0] += point[:, 1] * world[:, 2] - point[:, 2] * world[:, 1]
        moment[:, 1] += point[:, 2] * world[:, 0] - point[:, 0] * world[:, 2]
        moment[:, 2] += point[:, 0] * world[:, 1] - point[:, 1] * world[:, 0]
        self._sole_wrench[:, :3] = sums[:2]
        self._sole_wrench[:, 3:] = select[:2] @ moment
        for side in range(2):
            self._sole_wrench[side, 3:] -= cross(sole[side], sums[side])
        self._palm_force[:] = sums[2:]
        return count, geoms, position, force, distance

    def _centre_of_pressure(self, sole: Vector) -> Vector:
        """Centre of pressure (2,) of both feet [m], on the plane of the mean sole height; nan without foot force."""
        f = self._sole_wrench[:, :3]
        if f[:, 2].sum() < 1e-6:
            return np.full(2, np.nan)
        m = self._sole_wrench[:, 3:]
        x = sole[:, 0] * f[:, 2] - m[:, 1]
        y = sole[:, 1] * f[:, 2] + m[:, 0]
        return np.array([x.sum(), y.sum()]) / f[:, 2].sum()


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
