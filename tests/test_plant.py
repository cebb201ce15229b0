"""The plant against Newton and MuJoCo's own answers: forces, pushes, servos, sensors."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from short_run import ROBOT, new_plant, stand

from wbmpc.kinematics import Kinematics
from wbmpc.plant import Plant
from wbmpc.signals import GRAVITY, Truth, Vector

STEP = 1e-3  # [s]
WEIGHT = ROBOT.mass * GRAVITY  # [N]
HOME = ROBOT.home_q[7:]


def hold(plant: Plant) -> Vector:
    """Torques of a stiff servo that keeps the home posture; enough for a second or so on two feet."""
    return 40.0 * (HOME - plant.data.qpos[7:]) - 0.4 * plant.data.qvel[6:]


def run(plant: Plant, ticks: int) -> list[Truth]:
    return [plant.step(hold(plant)) for _ in range(ticks)]


def contact_wrench(plant: Plant, geom: int, point: Vector) -> Vector:
    """Force and moment (6,) about `point` that the world puts on a geom, from `mj_contactForce`."""
    model, data, total, local = plant.model, plant.data, np.zeros(6), np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        if geom not in contact.geom:
            continue
        mujoco.mj_contactForce(model, data, index, local)
        frame = contact.frame.reshape(3, 3)
        sign = 1.0 if contact.geom[1] == geom else -1.0  # the normal points from the first geom to the second
        force = sign * frame.T @ local[:3]
        total[:3] += force
        total[3:] += np.cross(contact.pos - point, force) + sign * frame.T @ local[3:]
    return total


def table_under_the_right_palm() -> dict[str, Any]:
    """A palm is a sphere, the table a box: MuJoCo lists the robot first here, and second on the floor."""
    kinematics = Kinematics(ROBOT)
    kinematics.update_kinematics(ROBOT.home_q)
    x, y, z = kinematics.position(ROBOT.palm_frames[1])
    top = z - ROBOT.palm_radius
    return {"table": {"kind": "box", "size": [0.06, 0.06, 0.04], "position": [x, y], "bottom": top - 0.04}}


@pytest.mark.parametrize("table", [False, True])
def test_momentum_balances_with_the_contact_forces(table: bool) -> None:
    """m (J_c v̇ + J̇_c v) = Σ f + m g at every tick of a landing: Pinocchio's Jacobian, MuJoCo's accelerations."""
    scenario = stand(world__objects=table_under_the_right_palm()) if table else stand()
    plant, kinematics = new_plant(scenario, height=0.02), Kinematics(ROBOT)
    truths, palm = [], []
    for _ in range(150):
        truths += run(plant, 1)
        palm.append(plant.measure().palm_force_in_world[1, 2])
    touched = 0
    for now, following in pairwise(truths):
        qacc = (following.qvel - now.qvel) / STEP
        kinematics.update(ROBOT.q_from_qpos(now.qpos), ROBOT.v_from_qvel(now.qpos, now.qvel))
        acceleration = ROBOT.a_from_qacc(now.qpos, now.qvel, qacc)
        rate = ROBOT.mass * (kinematics.com_jacobian @ acceleration + kinematics.com_drift)
        force = now.contacts["force"].sum(axis=0) - [0.0, 0.0, WEIGHT]
        assert_allclose(rate, force, atol=1e-6 * WEIGHT)
        touched += now.contact_count > 0
    assert 50 < touched < 149  # in the air, then on the floor
    assert min(palm) >= 0.0
    assert (max(palm) > 1.0) == table


def test_truth_is_of_the_start_of_its_step() -> None:
    plant = new_plant(stand())
    run(plant, 20)
    time, qpos, qvel = plant.time, plant.data.qpos.copy(), plant.data.qvel.copy()
    truth = plant.step(hold(plant))
    assert truth.time == time == pytest.approx(0.020)
    assert_allclose(truth.qpos, qpos, rtol=0, atol=0)
    assert_allclose(truth.qvel, qvel, rtol=0, atol=0)
    fresh = mujoco.MjData(plant.model)
    fresh.qpos[:], fresh.qvel[:] = qpos, qvel
    mujoco.mj_forward(plant.model, fresh)
    mujoco.mj_subtreeVel(plant.model, fresh)
    assert_allclose(truth.com, fresh.subtree_com[1], atol=1e-14)
    assert_allclose(truth.com_velocity, fresh.subtree_linvel[1], atol=1e-14)
    for side, name in enumerate(("left", "right")):
        assert_allclose(truth.palm_position[side], fresh.site(f"{name}_palm").xpos, atol=1e-14)
        assert_allclose(truth.sole_position[side], fresh.site(f"{name}_sole").xpos, atol=1e-14)
    assert truth.torso_up == pytest.approx(fresh.body("torso").xmat[8], abs=1e-14)
    assert plant.time == pytest.approx(0.021)


torques = st.lists(st.floats(-6, 6), min_size=ROBOT.nj, max_size=ROBOT.nj).map(np.array)
speeds = st.lists(st.floats(-9, 9), min_size=ROBOT.nj, max_size=ROBOT.nj).map(np.array)


@settings(max_examples=40, deadline=None)
@given(torque=torques, speed=speeds)
def test_torques_stay_under_the_servos_line(torque: Vector, speed: Vector) -> None:
    """Stall torque, falling to nothing at the no-load speed in the direction of motion; written out joint by joint."""
    plant = new_plant(stand(), height=0.5, velocity=np.concatenate([np.zeros(6), speed]))
    truth = plant.step(torque)
    for j in range(ROBOT.nj):
        stall, ratio = ROBOT.torque_limit[j], speed[j] / ROBOT.joint_speed[j]
        driving = ratio if torque[j] >= 0 else -ratio
        limit = stall * min(max(1.0 - driving, 0.0), 1.0)
        expected = min(abs(torque[j]), limit) * np.sign(torque[j])
        assert truth.torque[j] == pytest.approx(expected, abs=1e-12)
        assert abs(truth.torque[j]) <= truth.torque_limit[j] + 1e-12
    assert_allclose(plant.data.qfrc_actuator[6:], truth.torque, atol=1e-12)  # what MuJoCo really applied


pushes = st.tuples(*[st.floats(-1, 1)] * 3)


@settings(max_examples=20, deadline=None)
@given(
    time=st.floats(0, 0.02),
    duration=st.floats(2e-4, 0.02),
    impulse=pushes,
    point=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
)
def test_a_push_delivers_its_impulse(time: float, duration: float, impulse: Any, point: Any) -> None:
    """In free flight the CoM's velocity changes by impulse / m, wherever the push begins and ends between two steps."""
    push = {"kind": "impulse", "body": "torso", "time": time, "duration": duration, "impulse": impulse, "point": point}
    plant = new_plant(stand(disturbances=[push]), height=1.0)
    truths = [plant.step(np.zeros(ROBOT.nj)) for _ in range(50)]
    assert all(truth.contact_count == 0 for truth in truths)
    assert_allclose(STEP * sum(truth.external_force for truth in truths), impulse, atol=1e-9)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    fallen = np.array([0.0, 0.0, -GRAVITY * plant.time])
    gained = ROBOT.mass * (plant.data.subtree_linvel[1] - fallen)
    # MuJoCo takes M at the start of each step: the CoM's velocity is exact to the step times the speed of the limbs
    assert_allclose(gained, impulse, atol=0.02 * max(np.linalg.norm(impulse), 0.1))


def test_a_push_turns_the_robot_about_its_point() -> None:
    """Angular momentum about the CoM after a short push: (point - CoM) × impulse."""
    point, impulse = np.array([0.03, 0.08, 0.05]), np.array([0.2, -0.1, 0.15])
    push = {"kind": "impulse", "body": "torso", "time": 0.0, "duration": 0.002}
    push |= {"impulse": impulse.tolist(), "point": point.tolist()}
    plant = new_plant(stand(disturbances=[push]), height=1.0)
    torso = plant.data.body("torso")
    arm = torso.xpos + torso.xmat.reshape(3, 3) @ point - plant.data.subtree_com[1]
    for _ in range(2):
        plant.step(np.zeros(ROBOT.nj))
    mujoco.mj_subtreeVel(plant.model, plant.data)
    assert_allclose(plant.data.subtree_angmom[1], np.cross(arm, impulse), rtol=0.05, atol=3e-4)


def test_pushes_add_up_and_act_on_their_body() -> None:
    pair = [
        {"kind": "impulse", "body": body, "time": 0.001, "duration": 0.004, "impulse": impulse}
        for body, impulse in (("torso", (0.3, 0.0, 0.0)), ("left_foot_link", (0.0, 0.1, 0.0)))
    ]
    scenario = stand(disturbances=pair)
    plant = new_plant(scenario, height=1.0)
    forces = [plant.step(np.zeros(ROBOT.nj)).external_force for _ in range(8)]
    assert_allclose(forces[0], 0.0)
    assert_allclose(forces[2], [75.0, 25.0, 0.0], atol=1e-9)
    assert_allclose(forces[6], 0.0)
    assert_allclose(plant.data.qfrc_applied, 0.0)  # and nothing is left of it


def test_soles_and_centre_of_pressure() -> None:
    """Against `mj_contactForce`, which knows of the cone, the frames and the contacts' torsion by itself."""
    plant = new_plant(stand(), velocity=np.r_[0.1, 0.2, 0.0, 0.0, 0.0, 1.5, np.zeros(ROBOT.nj)])
    model, data = plant.model, plant.data
    for _ in range(40):
        torque = hold(plant)
        sole = data.site_xpos[[model.site("left_sole").id, model.site("right_sole").id]].copy()
        # the step's own contacts are gone after it: make the same step in a copy and stop before the next positions
        copy = mujoco.MjData(model)
        mujoco.mj_copyData(copy, model, data)
        truth = plant.step(torque)
        copy.ctrl[:] = truth.torque
        mujoco.mj_step2(model, copy)
        measured = plant.measure().sole_wrench_in_world
        twin = type("Twin", (), {"model": model, "data": copy})
        wrench = np.array(
            [contact_wrench(twin, model.geom(f"{s}_foot").id, sole[i]) for i, s in enumerate(("left", "right"))]
        )
        assert_allclose(measured[:, :5], wrench[:, :5], atol=1e-9)  # the yaw moment leaves the contacts' torsion out
        if wrench[:, 2].sum() > 1.0:
            force, position = truth.contacts["force"], truth.contacts["position"]
            expected = force[:, 2] @ position[:, :2] / force[:, 2].sum()
            assert_allclose(truth.zmp, expected, atol=1e-4)  # contacts lie within 0.1 mm of the soles' plane
    assert wrench[:, 2].sum() == pytest.approx(WEIGHT, rel=0.5)


def test_nothing_pushes_in_the_air() -> None:
    plant = new_plant(stand(), height=0.3)
    truth = run(plant, 3)[-1]
    measurement = plant.measure()
    assert truth.contact_count == 0
    assert np.isnan(truth.zmp).all()
    assert_allclose(measurement.sole_wrench_in_world, 0.0)
    assert_allclose(measurement.imu_accelerometer, 0.0, atol=0.5)  # free fall


@pytest.mark.parametrize("scale", [0.9, 1.0, 1.1])
def test_mass_scale_acts(scale: float) -> None:
    plant = new_plant(stand(plant__mass_scale=scale))
    truths = run(plant, 400)
    force = np.mean([t.contacts["force"][:, 2].sum() for t in truths[250:]])
    assert force == pytest.approx(scale * WEIGHT, rel=0.01)


@pytest.mark.parametrize("friction", [0.2, 0.9])
def test_a_sliding_sole_meets_the_true_friction(friction: float) -> None:
    plant = new_plant(stand(plant__friction=friction), velocity=np.r_[1.0, np.zeros(ROBOT.nv - 1)])
    force = np.concatenate([truth.contacts["force"] for truth in run(plant, 40)])
    loaded = force[force[:, 2] > 1.0]
    assert len(loaded) > 20
    ratio = np.linalg.norm(loaded[:, :2], axis=1) / loaded[:, 2]
    assert_allclose(ratio[:10], friction, rtol=0.02)  # sliding: on the cone
    assert (ratio < 1.001 * friction).all()  # and never outside it
    assert (loaded[:10, 0] < 0.0).all()  # against the motion


def readings(plant: Plant) -> Vector:
    m = plant.measure()
    fields = (
        m.joint_position, m.joint_velocity, m.imu_quaternion, m.imu_gyro, m.imu_accelerometer,
        m.sole_wrench_in_world.ravel(), m.palm_force_in_world.ravel(),
    )  # fmt: skip
    return np.concatenate(fields)


def test_noise_follows_the_seed_and_is_zero_at_scale_zero() -> None:
    noisy = stand(sensors__noise_scale=1.0)
    first, second, other = (readings(new_plant(noisy, seed=seed)) for seed in (1, 1, 2))
    assert_allclose(first, second, rtol=0, atol=0)
    assert (first != other).all()
    plant = new_plant(stand(), seed=1)
    run(plant, 5)
    measurement = plant.measure()
    assert_allclose(measurement.joint_position, plant.data.qpos[7:], rtol=0, atol=0)
    assert_allclose(measurement.joint_velocity, plant.data.qvel[6:], rtol=0, atol=0)
    assert_allclose(readings(plant), readings(plant), rtol=0, atol=0)


def test_noise_has_the_declared_size() -> None:
    scenario = stand(sensors__noise_scale=2.0)
    sensors, plant = scenario.sensors, new_plant(scenario)
    clean = plant.data.sensor("imu_quaternion").data.copy()
    samples = [plant.measure() for _ in range(1500)]

    def spread(name: str) -> Vector:
        return np.std([getattr(m, name) for m in samples], axis=0)

    turns = []
    for m in samples:
        turn, back = np.empty(4), np.empty(4)
        mujoco.mju_negQuat(back, clean)
        mujoco.mju_mulQuat(turn, back, m.imu_quaternion)
        turns.append(2.0 * turn[1:] * np.sign(turn[0]))
    # 1500 samples give a standard deviation to 1.8 %; the largest of some eighty channels stays within five of these
    tolerance = {"rtol": 0.1}
    assert_allclose(spread("joint_position"), 2 * sensors.joint_position_noise, **tolerance)
    assert_allclose(spread("joint_velocity"), 2 * sensors.joint_velocity_noise, **tolerance)
    assert_allclose(spread("imu_gyro"), 2 * sensors.gyro_noise, **tolerance)
    assert_allclose(spread("imu_accelerometer"), 2 * sensors.accelerometer_noise, **tolerance)
    assert_allclose(np.std(turns, axis=0), 2 * sensors.orientation_noise, **tolerance)
    assert_allclose(spread("sole_wrench_in_world")[:, :3], 2 * sensors.force_noise, **tolerance)
    assert_allclose(spread("sole_wrench_in_world")[:, 3:], 2 * sensors.moment_noise, **tolerance)
    assert_allclose(spread("palm_force_in_world"), 2 * sensors.force_noise, **tolerance)
    assert_allclose(np.linalg.norm([m.imu_quaternion for m in samples], axis=1), 1.0, atol=1e-9)
