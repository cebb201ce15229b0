"""The estimator against the plant's truth, and against motions whose base pose is known by construction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from plain_estimator import PlainEstimator
from short_run import ROBOT, new_plant, stand

from wbmpc.estimator import Estimator
from wbmpc.signals import GRAVITY, Measurement, RobotState, Vector

STEP = 1e-3  # [s]
SETTLED = 100  # ticks after which the start has worn off
WEIGHT = ROBOT.mass * GRAVITY


@dataclass
class Errors:
    position: Vector  # (n, 3) [m]
    velocity: Vector  # (n, 3) [m/s] in world
    rotation: Vector  # (n,) [rad]
    angular: Vector  # (n, 3) [rad/s]
    joint_velocity: Vector  # (n, nj) [rad/s]
    true_velocity: Vector  # (n, 3) [m/s]
    mass_scale: Vector  # (n,)


def squat(*, ticks: int, depth: float, noise: float, mass_scale: float = 1.0, seed: int = 0) -> Errors:
    """Servos alone move knees, hips and ankles together by `depth` [rad] at 0.8 Hz; the estimator looks on."""
    scenario = stand(sensors__noise_scale=noise, plant__mass_scale=mass_scale)
    plant = new_plant(scenario, seed=seed)
    bend = np.zeros(ROBOT.nj)
    for side in ("left", "right"):
        for joint, share in (("hip_pitch", -1.0), ("knee", 2.0), ("ankle_pitch", -1.0)):
            bend[ROBOT.joint_index(f"{side}_{joint}")] = share
    home = ROBOT.home_q[7:]
    estimator = Estimator(ROBOT, q=ROBOT.q_from_qpos(plant.data.qpos), step=STEP)
    rows = []
    for tick in range(ticks):
        state = estimator.update(plant.measure())
        qpos, qvel = plant.data.qpos, plant.data.qvel
        R, estimated = ROBOT.base_rotation(qpos), pin.Quaternion(state.q[3:7]).matrix()
        rows.append(
            (
                state.q[:3] - qpos[:3],
                estimated @ state.v[:3] - qvel[:3],
                np.linalg.norm(pin.log3(R.T @ estimated)),
                state.v[3:6] - qvel[3:6],
                state.v[6:] - qvel[6:],
                qvel[:3].copy(),
                state.mass_scale,
            )
        )
        goal = home + 0.5 * depth * (1 - np.cos(2 * np.pi * 0.8 * STEP * tick)) * bend
        plant.step(60.0 * (goal - qpos[7:]) - 0.6 * qvel[6:])
    assert plant.data.site("left_sole").xpos[2] < 2e-3  # the feet never left the floor
    return Errors(*(np.array(column) for column in zip(*rows, strict=True)))


def rms(values: Vector) -> float:
    return float(np.sqrt((values[SETTLED:] ** 2).mean()))


def test_squat_with_perfect_sensors() -> None:
    errors = squat(ticks=1300, depth=0.3, noise=0.0)
    assert np.abs(errors.true_velocity[:, 2]).max() > 0.04  # there was something to follow
    assert np.abs(errors.position).max() < 2e-4
    assert rms(errors.velocity) < 2e-3
    assert errors.rotation.max() < 1e-6
    assert np.abs(errors.angular).max() < 0.02
    assert rms(errors.joint_velocity) < 0.02


@pytest.mark.parametrize("seed", [1, 2])
def test_squat_with_noisy_sensors(seed: int) -> None:
    """Standard sensors, 1.3 s: the base to a millimetre and its velocity to 5 mm/s."""
    errors = squat(ticks=1300, depth=0.3, noise=1.0, seed=seed)
    assert np.abs(errors.position).max() < 1.5e-3
    assert rms(errors.velocity) < 3e-3
    assert np.abs(errors.velocity[SETTLED:]).max() < 0.015
    assert errors.rotation.max() < 5 * np.sqrt(3) * 0.001
    # filtered: less than the 0.02 rad/s of the raw encoders
    assert rms(errors.joint_velocity) < 0.016


@pytest.mark.parametrize("scale", [0.9, 1.0, 1.1])
def test_mass_converges(scale: float) -> None:
    """At rest; a time constant of 0.8 s leaves e⁻³ of the error after 2.4 s."""
    mass_scale = squat(ticks=2400, depth=0.0, noise=0.5, mass_scale=scale).mass_scale
    assert mass_scale[0] == pytest.approx(1.0, abs=0.01)
    assert mass_scale[-1] == pytest.approx(scale, abs=0.05 * abs(scale - 1.0) + 0.003)
    assert np.abs(mass_scale - 1.0).max() <= abs(scale - 1.0) + 0.01  # it does not overshoot


# Motions made here: the base pose follows from a sole that stands still


LEFT, RIGHT = 0, 1
PHASE = 400  # ticks


def smooth(x: float) -> float:
    """0 … 1 with zero velocity and acceleration at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def leg(side: int, amount: float) -> Vector:
    """Joint displacement (nj,) of one leg: the sole goes 3 cm forward and a little up, and turns."""
    pattern = {"hip_pitch": -0.35, "knee": 0.25, "ankle_pitch": 0.05, "hip_yaw": 0.08 if side else -0.08}
    out = np.zeros(ROBOT.nj)
    for joint, share in pattern.items():
        out[ROBOT.joint_index(f"{('left', 'right')[side]}_{joint}")] = amount * share
    return out


def relative(joints: Vector, frame: int) -> pin.SE3:
    """Pose of a frame relative to the base."""
    q = np.concatenate([np.zeros(6), [1.0], joints])
    data = ROBOT.pin_model.createData()
    pin.framesForwardKinematics(ROBOT.pin_model, data, q)
    return data.oMf[frame].copy()


class Steps:
    """The left leg swings while the right sole stands, then the right leg while the left sole stands, and so on."""

    def __init__(self, phases: int) -> None:
        self.stances: list[tuple[int, pin.SE3]] = []  # the sole that stands, and where
        base = pin.SE3(np.eye(3), ROBOT.home_q[:3].copy())
        for phase in range(phases):
            stance = RIGHT if phase % 2 == 0 else LEFT
            joints = self.joints(phase * PHASE)
            if self.stances:
                side, pose = self.stances[-1]
                base = pose * relative(joints, ROBOT.sole_frames[side]).inverse()
            self.stances.append((stance, base * relative(joints, ROBOT.sole_frames[stance])))

    def joints(self, tick: float) -> Vector:
        """(nj,): each swing moves its leg from behind to before the other, or to the front from the middle at first."""
        angles = ROBOT.home_q[7:].copy()
        phase = min(int(tick // PHASE), 99)
        for side in (LEFT, RIGHT):
            amount = 0.0
            for p in range(phase + 1):
                if (RIGHT if p % 2 == 0 else LEFT) != side:
                    amount += smooth((tick - p * PHASE) / PHASE)
                elif p > 0 or side == LEFT:
                    amount -= smooth((tick - p * PHASE) / PHASE)  # the stance leg goes back under the body
            angles += leg(side, amount)
        angles[ROBOT.joint_index("waist_yaw")] += 0.3 * smooth(tick / 300) * np.sin(2 * np.pi * tick / 700)
        return angles

    def stance(self, tick: float) -> tuple[int, pin.SE3]:
        return self.stances[min(int(tick // PHASE), len(self.stances) - 1)]

    def base(self, tick: float, phase_of: float | None = None) -> pin.SE3:
        side, pose = self.stance(tick if phase_of is None else phase_of)
        return pose * relative(self.joints(tick), ROBOT.sole_frames[side]).inverse()

    def measure(self, tick: int) -> Measurement:
        """Exact sensors; velocities and accelerations from differences within the tick's own phase."""
        side, _ = self.stance(tick)
        h = 0.5
        imu = [self.base(t, tick) * relative(self.joints(t), ROBOT.imu_frame) for t in (tick - h, tick, tick + h)]
        dt = h * STEP
        gyro = pin.log3(imu[0].rotation.T @ imu[2].rotation) / (2 * dt)
        acceleration = (imu[0].translation - 2 * imu[1].translation + imu[2].translation) / dt**2
        x, y, z, w = pin.Quaternion(imu[1].rotation).coeffs()
        wrench = np.zeros((2, 6))
        wrench[side, 2] = WEIGHT
        return Measurement(
            time=tick * STEP,
            joint_position=self.joints(tick),
            joint_velocity=(self.joints(tick + h) - self.joints(tick - h)) / (2 * dt),
            imu_quaternion=np.array([w, x, y, z]),
            imu_gyro=gyro,
            imu_accelerometer=imu[1].rotation.T @ (acceleration + np.array([0.0, 0.0, GRAVITY])),
            sole_wrench_in_world=wrench,
            palm_force_in_world=np.zeros((2, 3)),
        )


def walk(steps: Steps, phases: int, seen: Callable[[int, RobotState], None]) -> None:
    q = np.concatenate([steps.base(0).translation, [0.0, 0.0, 0.0, 1.0], steps.joints(0)])
    estimator = Estimator(ROBOT, q=q, step=STEP)
    for tick in range(phases * PHASE):
        seen(tick, estimator.update(steps.measure(tick)))


def test_a_foot_is_anchored_anew_where_it_touches_down() -> None:
    """Four steps: an old anchor would pull the base back by a whole step at every touch-down.

    The waist turns all the while, and the IMU above it with it: the base's own velocity must not.
    """
    steps, errors, path = Steps(4), [], []

    def seen(tick: int, state: RobotState) -> None:
        before, here, after = (steps.base(t, tick) for t in (tick - 0.5, tick, tick + 0.5))
        errors.append(state.q[:3] - here.translation)
        path.append(here.translation)
        linear = here.rotation.T @ (after.translation - before.translation) / STEP
        assert_allclose(state.v[:3], linear, atol=0.02)
        assert_allclose(state.v[3:6], pin.log3(before.rotation.T @ after.rotation) / STEP, atol=0.1)

    walk(steps, 4, seen)
    left = relative(steps.joints(0), ROBOT.sole_frames[LEFT]).translation
    swung = relative(steps.joints(PHASE), ROBOT.sole_frames[LEFT]).translation
    assert np.linalg.norm(swung - left) > 0.02  # the foot does come down elsewhere
    assert np.ptp([p[0] for p in path]) > 0.02  # and the base does travel
    assert np.abs(errors).max() < 1.5e-3


@pytest.mark.parametrize(("side", "edge"), [(LEFT, 0.05), (RIGHT, -0.05)])
def test_velocity_of_a_foot_that_rolls_over_its_edge(side: int, edge: float) -> None:
    """The stiff robot tips about a line under one sole: all its weight is there, and only that line stands still."""
    joints, rate = ROBOT.home_q[7:], 0.8  # [rad/s]
    base = pin.SE3(np.eye(3), ROBOT.home_q[:3].copy())
    axis = (base * relative(joints, ROBOT.sole_frames[side])).translation + np.array([edge, 0.0, 0.0])
    imu = relative(joints, ROBOT.imu_frame)
    estimator = Estimator(ROBOT, q=ROBOT.home_q.copy(), step=STEP)
    omega = np.array([0.0, rate, 0.0])
    for tick in range(150):
        tipped = pin.SE3(pin.exp3(omega * tick * STEP), axis) * pin.SE3(np.eye(3), -axis) * base
        pose = tipped * imu
        centripetal = np.cross(omega, np.cross(omega, pose.translation - axis))
        x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
        wrench = np.zeros((2, 6))
        sole = (tipped * relative(joints, ROBOT.sole_frames[side])).translation
        wrench[side, 2], wrench[side, 4] = WEIGHT, -(axis - sole)[0] * WEIGHT  # m_y = -x f_z
        state = estimator.update(
            Measurement(
                time=tick * STEP,
                joint_position=joints,
                joint_velocity=np.zeros(ROBOT.nj),
                imu_quaternion=np.array([w, x, y, z]),
                imu_gyro=pose.rotation.T @ omega,
                imu_accelerometer=pose.rotation.T @ (centripetal + np.array([0.0, 0.0, GRAVITY])),
                sole_wrench_in_world=wrench,
                palm_force_in_world=np.zeros((2, 3)),
            )
        )
    velocity = np.cross(omega, tipped.translation - axis)
    assert np.linalg.norm(velocity) > 0.1
    assert_allclose(tipped.rotation @ state.v[:3], velocity, atol=0.01)


def test_signals_do_not_change_after_they_were_handed_out() -> None:
    """The real-time loop hands a state to another thread while the next one is estimated."""
    steps, kept = Steps(1), []
    walk(steps, 1, lambda tick, state: kept.append((state, state.q.copy(), state.v.copy())))
    for state, q, v in kept:
        assert_allclose(state.q, q, rtol=0, atol=0)
        assert_allclose(state.v, v, rtol=0, atol=0)


def test_without_feet_the_accelerometer_carries_on() -> None:
    """A jump: 0.2 m/s upwards in the air, nothing but the IMU to tell."""
    plant = new_plant(stand(), height=0.3, velocity=np.r_[0.1, 0.0, 0.2, np.zeros(ROBOT.nj + 3)])
    estimator = Estimator(ROBOT, q=ROBOT.q_from_qpos(plant.data.qpos), step=STEP)
    mujoco.mj_forward(plant.model, plant.data)  # an accelerometer reading for the first measurement
    states = []
    for _ in range(50):
        states.append(estimator.update(plant.measure()))
        plant.step(np.zeros(ROBOT.nj))
    first, last = states[1], states[-1]
    fall = np.array([0.0, 0.0, -GRAVITY * (last.time - first.time)])
    R = pin.Quaternion(last.q[3:7]).matrix()
    assert_allclose(R @ last.v[:3] - first.v[:3], fall, atol=0.03)
    assert last.mass_scale == 1.0  # no feet, no news of the mass


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), upside=st.sampled_from([0.1, 1.0, 3.0]))
def test_the_plain_estimator_says_the_same(seed: int, upside: float) -> None:
    """Anything the sensors may say, for 20 ticks: feet land and lift, the base turns over."""
    rng = np.random.default_rng(seed)
    estimators = [make(ROBOT, q=ROBOT.home_q, step=STEP) for make in (Estimator, PlainEstimator)]
    for tick in range(20):
        wrench = rng.normal(scale=3.0, size=(2, 6))
        wrench[:, 2] = rng.choice([0.0, 2.9, 3.1, 20.0], size=2)
        measurement = Measurement(
            time=STEP * tick,
            joint_position=rng.uniform(ROBOT.joint_lower, ROBOT.joint_upper),
            joint_velocity=rng.normal(size=ROBOT.nj),
            imu_quaternion=np.array([1.0, 0.0, 0.0, 0.0]) + upside * rng.normal(size=4),
            imu_gyro=rng.normal(size=3),
            imu_accelerometer=rng.normal(scale=10.0, size=3),
            sole_wrench_in_world=wrench,
            palm_force_in_world=rng.normal(size=(2, 3)),
        )
        one, other = (estimator.update(measurement) for estimator in estimators)
        same_sign = np.sign(one.q[3:7] @ other.q[3:7])
        assert_allclose(one.q[3:7], same_sign * other.q[3:7], atol=1e-12)
        assert_allclose(np.delete(one.q, slice(3, 7)), np.delete(other.q, slice(3, 7)), atol=1e-11)
        assert_allclose(one.v, other.v, atol=1e-10)
        assert one.mass_scale == pytest.approx(other.mass_scale, abs=1e-13)
