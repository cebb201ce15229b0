"""The plant: MuJoCo's robot and world, its sensors, its servos' limits and the disturbances nobody is told of."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbmpc.physics import Physics
from wbmpc.plant_kernels import contact_sums, servo_torque
from wbmpc.robot import Robot
from wbmpc.scenario import Disturbance, Impulse, SensorSettings
from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.signals import CONTACT, MAX_CONTACTS, SIDES, Measurement, Truth, Vector

MOST_SEEN = 4 * MAX_CONTACTS  # of MuJoCo's contacts, many of which may carry no force


class _Push(NamedTuple):
    """A constant force for a while."""

    begin: float  # [s]
    end: float  # [s]
    body: int
    force: Vector  # (3,) [N] in world
    point: Vector  # (3,) [m] in the body's frame


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
        self._root = int(model.jnt_bodyid[0])
        self._pushes: list[_Push] = []
        self._held: tuple[_Push, ...] = ()
        for disturbance in disturbances:
            self.push(disturbance)
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
        self._kept = np.zeros(MAX_CONTACTS, CONTACT)
        self._kept_columns = tuple(self._kept[name] for name in ("geoms", "position", "force", "distance"))
        self._sole_wrench = np.zeros((2, 6))
        self._palm_force = np.zeros((2, 3))
        self.data.qpos[:] = qpos
        mujoco.mj_forward(model, self.data)  # the first measurement has an acceleration too
        mujoco.mj_step1(model, self.data)

    def change(self, model: mujoco.MjModel, *, sensors: SensorSettings, disturbances: tuple[Disturbance, ...]) -> None:
        """Go on in the world of `model`, of the same parts in the same places: other friction, other masses.

        The state, and the random numbers of the sensors' noise, go on.
        """
        self._sensors, self._noise = sensors, _noise_scales(sensors, self._robot.nj)
        self._pushes.clear()
        for disturbance in disturbances:
            self.push(disturbance)
        self.data.qfrc_applied[:] = 0.0  # of a push that is no more
        for name in dir(model):
            mine, other = getattr(self.model, name), getattr(model, name)
            if isinstance(other, np.ndarray) and not np.array_equal(mine, other, equal_nan=other.dtype.kind == "f"):
                mine[...] = other
        self.model.stat.meaninertia = model.stat.meaninertia
        self._physics.step1()  # what the masses say of the present state

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

    def push(self, impulse: Impulse) -> None:
        """Declare one more disturbance; one whose time is over does nothing."""
        force = np.array(impulse.impulse) / impulse.duration
        self._pushes.append(
            _Push(impulse.time, impulse.end, self.model.body(impulse.body).id, force, np.array(impulse.point))
        )

    def hold(self, body: int, force: Vector, point: Vector) -> None:
        """Declare a disturbance that lasts until `let_go`: a force on a point of a body.

        Args:
            force: (3,) [N] in world.
            point: (3,) [m] in the body's frame.

        Raises:
            ValueError: the body is not one of the robot's: a force on the world would not be one on the robot.
        """
        if self.model.body_rootid[body] != self._root:
            raise ValueError(f"{self.model.body(body).name or 'the world'} is no body of the robot")
        self._held = (_Push(0.0, np.inf, body, force.copy(), point.copy()),)

    def let_go(self) -> None:
        """End what `hold` began."""
        self._held = ()
        self.data.qfrc_applied[:] = 0.0

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
        angular_momentum = d.subtree_angmom[self._root].copy()
        sites = d.site_xpos.take(self._sites, axis=0)
        sole, palm = sites[:2], sites[2:]
        torso_up = float(d.xmat[self._torso, 8])
        self._physics.step2()
        contacts, zmp = self._contacts(sole)
        self._physics.step1()
        return Truth(
            time=time,
            qpos=qpos,
            qvel=qvel,
            torque=applied,
            torque_limit=limit,
            com=com,
            com_velocity=com_velocity,
            angular_momentum=angular_momentum,
            palm_position=palm,
            sole_position=sole,
            torso_up=torso_up,
            external_force=external,
            zmp=zmp,
            contacts=contacts,
        )

    def _push(self, time: float) -> Vector:
        """Set the forces of the disturbances that act in the coming step; returns their sum (3,) [N]."""
        total = np.zeros(3)
        if not self._pushes and not self._held:
            return total
        d = self.data
        d.qfrc_applied[:] = 0.0
        for begin, end, body, force, point in (*self._pushes, *self._held):
            share = min(time + self._step, end) - max(time, begin)
            if share > 1e-9:
                now = force * min(share / self._step, 1.0)
                where = d.xpos[body] + d.xmat[body].reshape(3, 3) @ point
                mujoco.mj_applyFT(self.model, d, now, np.zeros(3), where, body, d.qfrc_applied)
                total += now
        return total

    def _contacts(self, sole: Vector) -> tuple[NDArray[np.void], Vector]:
        """Contacts of the step just made, forces on the robot, and the ZMP; also the wrenches the force sensors see."""
        d, contact, seen, zmp = self.data, self.data.contact, self._seen, np.empty(2)
        count = min(d.ncon, len(seen[0]))
        if count:
            fields = (contact.geom, contact.efc_address, contact.frame, contact.pos, contact.dist, contact.dim)
            for cell, field in zip(seen, fields, strict=True):
                cell[:count] = field[:count]
        kept = contact_sums(
            *(count, seen, d.efc_force, self._is_robot, self._part, sole),
            *(self._kept_columns, self._sole_wrench, self._palm_force, zmp),
        )
        return self._kept[:kept].copy(), zmp


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
