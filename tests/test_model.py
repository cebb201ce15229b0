"""MuJoCo and Pinocchio read the same robot from models/surena_mini.xml, and the robot is what README.md says."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from settled import settled

from wbmpc.kinematics import Kinematics
from wbmpc.robot import Robot
from wbmpc.signals import GRAVITY, SIDES, Vector

MODEL = Path(__file__).parents[1] / "models" / "surena_mini.xml"
TOLERANCE = 1e-10
SITES = ("left_sole", "right_sole", "left_palm", "right_palm", "imu")
SEEDS = range(12)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load(MODEL)


@pytest.fixture(scope="module")
def mj_model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MODEL))


@pytest.fixture(scope="module")
def home(mj_model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(mj_model)
    mujoco.mj_resetDataKeyframe(mj_model, data, mj_model.key("home").id)
    mujoco.mj_forward(mj_model, data)
    return data


class State:
    """One random state in both libraries: `kinematics` at (q, v), `mj_data` at (qpos, qvel), forward pass done."""

    def __init__(self, robot: Robot, mj_model: mujoco.MjModel, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.robot, self.mj_model, self.mj_data = robot, mj_model, mujoco.MjData(mj_model)
        self.qpos = np.empty(robot.nq)
        self.qpos[:3] = random.uniform(-1, 1, 3)
        self.qpos[3:7] = random.standard_normal(4)
        self.qpos[3:7] /= np.linalg.norm(self.qpos[3:7])
        self.qpos[7:] = random.uniform(robot.joint_lower, robot.joint_upper)
        self.qvel = random.standard_normal(robot.nv) * 3
        self.qacc = random.standard_normal(robot.nv) * 10
        self.mj_data.qpos[:], self.mj_data.qvel[:] = self.qpos, self.qvel
        mujoco.mj_forward(mj_model, self.mj_data)
        mujoco.mj_subtreeVel(mj_model, self.mj_data)
        self.q = robot.q_from_qpos(self.qpos)
        self.v = robot.v_from_qvel(self.qpos, self.qvel)
        self.kinematics = Kinematics(robot)
        self.kinematics.update(self.q, self.v)
        # qvel = to_mujoco @ v, and by duality a generalized force f of Pinocchio is to_mujoco @ f in MuJoCo.
        self.to_mujoco = np.eye(robot.nv)
        self.to_mujoco[:3, :3] = self.mj_data.xmat[1].reshape(3, 3)

    def mass_matrix(self) -> Vector:
        dense = np.zeros((self.robot.nv, self.robot.nv))
        mujoco.mj_fullM(self.mj_model, self.mj_data, dense)
        return dense

    def site_jacobian(self, site: str, rate: bool = False) -> Vector:
        """MuJoCo's (6, nv) Jacobian of a site, or its time derivative, for qvel."""
        jacobian = np.zeros((6, self.robot.nv))
        data = self.mj_data.site(site)
        body = self.mj_model.site(site).bodyid[0]
        if rate:
            mujoco.mj_jacDot(self.mj_model, self.mj_data, jacobian[:3], jacobian[3:], data.xpos, body)
        else:
            mujoco.mj_jac(self.mj_model, self.mj_data, jacobian[:3], jacobian[3:], data.xpos, body)
        return jacobian


@pytest.fixture(params=SEEDS)
def state(request: pytest.FixtureRequest, robot: Robot, mj_model: mujoco.MjModel) -> State:
    return State(robot, mj_model, request.param)


def test_joints_have_one_order(robot: Robot, mj_model: mujoco.MjModel) -> None:
    assert tuple(robot.pin_model.names)[2:] == robot.joint_names
    assert tuple(mj_model.joint(i).name for i in range(1, mj_model.njnt)) == robot.joint_names
    assert [mj_model.joint(int(i)).name for i in mj_model.actuator_trnid[:, 0]] == list(robot.joint_names)


def test_pinocchio_reads_the_same_limits(robot: Robot) -> None:
    model = robot.pin_model
    assert_allclose(model.upperEffortLimit[6:], robot.torque_limit)
    assert_allclose(model.lowerPositionLimit[7:], robot.joint_lower)
    assert_allclose(model.upperPositionLimit[7:], robot.joint_upper)
    assert_allclose(model.armature[6:], robot.armature)
    assert_allclose(model.damping[6:], robot.damping)
    assert_allclose(model.referenceConfigurations["home"], robot.home_q, atol=1e-9)


def test_gravity_is_the_projects(robot: Robot, mj_model: mujoco.MjModel) -> None:
    assert_allclose(mj_model.opt.gravity, [0, 0, -GRAVITY], rtol=0, atol=0)
    assert_allclose(robot.pin_model.gravity.linear, [0, 0, -GRAVITY], rtol=0, atol=0)


def test_frame_poses(state: State) -> None:
    frames = (*state.robot.sole_frames, *state.robot.palm_frames, state.robot.imu_frame)
    for site, frame in zip(SITES, frames, strict=True):
        data = state.mj_data.site(site)
        assert_allclose(state.kinematics.position(frame), data.xpos, atol=TOLERANCE)
        assert_allclose(state.kinematics.rotation(frame), data.xmat.reshape(3, 3), atol=TOLERANCE)
    torso = state.kinematics.position(state.robot.torso_frame)
    assert_allclose(torso, state.mj_data.body("torso").xpos, atol=TOLERANCE)
    for side, frame in zip(SIDES, state.robot.shoulder_frames, strict=True):
        anchor = state.mj_data.joint(f"{side}_shoulder_pitch").xanchor
        assert_allclose(state.kinematics.position(frame), anchor, atol=TOLERANCE)


def test_site_jacobians(state: State) -> None:
    for site, frame in zip(SITES[:4], (*state.robot.sole_frames, *state.robot.palm_frames), strict=True):
        expected = state.site_jacobian(site)
        assert_allclose(state.kinematics.jacobian(frame), expected @ state.to_mujoco, atol=TOLERANCE)
        assert_allclose(state.kinematics.velocity(frame), expected @ state.qvel, atol=TOLERANCE)


def test_site_accelerations(state: State) -> None:
    """J v̇ + J̇ v of Pinocchio is J qacc + J̇ qvel of MuJoCo: J̇ v and the acceleration conversion together."""
    a = state.robot.a_from_qacc(state.qpos, state.qvel, state.qacc)
    for site, frame in zip(SITES[:4], (*state.robot.sole_frames, *state.robot.palm_frames), strict=True):
        expected = state.site_jacobian(site) @ state.qacc + state.site_jacobian(site, rate=True) @ state.qvel
        got = state.kinematics.jacobian(frame) @ a + state.kinematics.drift(frame)
        assert_allclose(got, expected, atol=1e-9)


def test_mass_matrix(state: State) -> None:
    M = state.kinematics.mass_matrix
    assert_allclose(M, M.T, rtol=0, atol=0)
    assert_allclose(M, state.to_mujoco.T @ state.mass_matrix() @ state.to_mujoco, atol=TOLERANCE)


def test_inverse_dynamics(state: State) -> None:
    """M v̇ + h of both, with the acceleration conversion; at v = v̇ = 0 this is gravity alone (next test)."""
    a = state.robot.a_from_qacc(state.qpos, state.qvel, state.qacc)
    got = state.kinematics.mass_matrix @ a + state.kinematics.bias
    expected = state.mass_matrix() @ state.qacc + state.mj_data.qfrc_bias
    assert_allclose(state.to_mujoco @ got, expected, atol=1e-9)


def test_bias(state: State) -> None:
    a_without_qacc = state.robot.a_from_qacc(state.qpos, state.qvel, np.zeros(state.robot.nv))
    got = state.kinematics.bias + state.kinematics.mass_matrix @ a_without_qacc
    assert_allclose(state.to_mujoco @ got, state.mj_data.qfrc_bias, atol=TOLERANCE)


def test_gravity_force(state: State) -> None:
    state.kinematics.update(state.q, np.zeros(state.robot.nv))
    state.mj_data.qvel[:] = 0
    mujoco.mj_forward(state.mj_model, state.mj_data)
    assert_allclose(state.to_mujoco @ state.kinematics.bias, state.mj_data.qfrc_bias, atol=TOLERANCE)
    weight = [0, 0, state.robot.mass * GRAVITY]
    assert_allclose((state.to_mujoco @ state.kinematics.bias)[:3], weight, atol=TOLERANCE)
    assert_allclose(state.kinematics.com_drift, 0, atol=TOLERANCE)


def test_com(state: State) -> None:
    jacobian = np.zeros((3, state.robot.nv))
    mujoco.mj_jacSubtreeCom(state.mj_model, state.mj_data, jacobian, 1)
    assert_allclose(state.kinematics.com, state.mj_data.subtree_com[1], atol=TOLERANCE)
    assert_allclose(state.kinematics.com_jacobian, jacobian @ state.to_mujoco, atol=TOLERANCE)
    assert_allclose(state.kinematics.com_velocity, state.mj_data.subtree_linvel[1], atol=TOLERANCE)


def test_centroidal_momentum(state: State) -> None:
    momentum = state.kinematics.centroidal_momentum_matrix @ state.v
    assert_allclose(momentum[:3], state.robot.mass * state.mj_data.subtree_linvel[1], atol=TOLERANCE)
    assert_allclose(momentum[3:], state.mj_data.subtree_angmom[1], atol=TOLERANCE)


def _central_difference(state: State, quantity: str, frame: int | None = None) -> Vector:
    """d/dt of a quantity of the kinematics along v with v̇ = 0."""
    step, values = 1e-6, []
    kinematics = Kinematics(state.robot)
    for sign in (1, -1):
        kinematics.update(state.robot.integrate(state.q, sign * step * state.v), state.v)
        values.append(getattr(kinematics, quantity) if frame is None else getattr(kinematics, quantity)(frame))
    return (values[0] - values[1]) / (2 * step)


def test_drifts_against_finite_differences(state: State) -> None:
    """J̇ v by differentiating J v numerically, with nothing of Pinocchio's acceleration recursion in it."""
    for frame in (*state.robot.sole_frames, *state.robot.palm_frames, state.robot.torso_frame):
        assert_allclose(state.kinematics.drift(frame), _central_difference(state, "velocity", frame), atol=1e-5)
    assert_allclose(state.kinematics.com_drift, _central_difference(state, "com_velocity"), atol=1e-6)
    matrix_rate = _central_difference(state, "centroidal_momentum_matrix")
    assert_allclose(state.kinematics.centroidal_momentum_drift, matrix_rate @ state.v, atol=1e-6)


# The robot itself


def _mirrored(robot: Robot, joints: Vector) -> Vector:
    """Joint vector of the posture mirrored in the x-z plane: sides swap, roll and yaw change sign."""
    mirrored = np.empty_like(joints)
    for index, name in enumerate(robot.joint_names):
        twin = name.replace("left", "*").replace("right", "left").replace("*", "right")
        sign = -1.0 if name.endswith(("roll", "yaw")) else 1.0
        mirrored[robot.joint_index(twin)] = sign * joints[index]
    return mirrored


@pytest.mark.parametrize("seed", SEEDS)
def test_mirror_symmetry(robot: Robot, seed: int) -> None:
    """A mirrored posture has mirrored soles, palms, CoM and centroidal inertia."""
    random = np.random.default_rng(seed)
    joints, kinematics, mirror = (
        random.uniform(robot.joint_lower, robot.joint_upper),
        Kinematics(robot),
        Kinematics(robot),
    )
    base = np.array([0, 0, 0.3, 0, 0, 0, 1.0])
    still = np.zeros(robot.nv)
    kinematics.update(np.concatenate((base, joints)), still)
    mirror.update(np.concatenate((base, _mirrored(robot, joints))), still)
    flip = np.array([1.0, -1.0, 1.0])
    assert_allclose(mirror.com, flip * kinematics.com, atol=TOLERANCE)
    for frames in (robot.sole_frames, robot.palm_frames, robot.shoulder_frames):
        assert_allclose(mirror.position(frames[0]), flip * kinematics.position(frames[1]), atol=TOLERANCE)
    signs = np.outer([-1, 1, -1], [-1, 1, -1])  # angular momentum is a pseudovector
    inertia = mirror.centroidal_momentum_matrix[3:, 3:6], kinematics.centroidal_momentum_matrix[3:, 3:6]
    assert_allclose(inertia[0], signs * inertia[1], atol=TOLERANCE)


def test_limits_are_mirror_symmetric(robot: Robot) -> None:
    mirrored_lower, mirrored_upper = _mirrored(robot, robot.joint_lower), _mirrored(robot, robot.joint_upper)
    assert_allclose(np.minimum(mirrored_lower, mirrored_upper), robot.joint_lower)
    assert_allclose(np.maximum(mirrored_lower, mirrored_upper), robot.joint_upper)
    for values in (robot.torque_limit, robot.joint_speed, robot.armature):
        assert_allclose(np.abs(_mirrored(robot, values)), values)


def test_size_is_the_readmes(robot: Robot, mj_model: mujoco.MjModel) -> None:
    assert robot.nj == 23
    assert robot.mass == pytest.approx(3.43, abs=1e-9)
    assert robot.arm_length == pytest.approx(0.2)
    data = mujoco.MjData(mj_model)  # qpos0: knees straight
    mujoco.mj_kinematics(mj_model, data)
    head = data.body("head_link").xpos[2] + 0.033 + 0.035  # centre of the skull and its half height
    assert head == pytest.approx(0.53, abs=1e-3)
    assert_allclose([data.site("left_sole").xpos[2], data.site("right_sole").xpos[2]], 0, atol=1e-12)


def test_home_stands(robot: Robot, home: mujoco.MjData) -> None:
    """Soles flat on z = 0, x = 0 midway between them, CoM over their centre at the README's height, torso upright."""
    soles = np.array([home.site(f"{side}_sole").xpos for side in SIDES])
    assert_allclose(soles[:, 2], 0, atol=1e-9)
    assert_allclose(soles.mean(axis=0)[:2], 0, atol=1e-9)
    for side in SIDES:
        assert_allclose(home.site(f"{side}_sole").xmat.reshape(3, 3), np.eye(3), atol=1e-9)
    assert_allclose(home.subtree_com[1], [0, 0, 0.264], atol=1e-4)
    assert np.all(robot.home_q[7:] >= robot.joint_lower)
    assert np.all(robot.home_q[7:] <= robot.joint_upper)
    assert_allclose(_mirrored(robot, robot.home_q[7:]), robot.home_q[7:])


def test_home_holds_on_a_floor() -> None:
    """With the joints held stiffly at `home` on a floor, the robot stays; the soles, and nothing else, carry it."""
    model, data = settled(MODEL, ticks=1000, stiffness=30.0, damping=0.5)
    assert data.body("torso").xmat[8] > 0.999
    touching = {name for pair in data.contact.geom for name in (model.geom(int(i)).name for i in pair)}
    assert touching == {"floor", "left_foot", "right_foot"}
    assert data.contact.dist.min() > -1e-3
    force, total = np.zeros(6), 0.0
    for contact in range(data.ncon):
        mujoco.mj_contactForce(model, data, contact, force)
        total += force[0]
    assert total == pytest.approx(3.43 * GRAVITY, rel=0.02)


def test_feet_do_not_touch_when_hips_are_straight(mj_model: mujoco.MjModel, home: mujoco.MjData) -> None:
    gap = home.site("left_sole").xpos[1] - home.site("right_sole").xpos[1] - 2 * mj_model.geom("left_foot").size[1]
    assert gap == pytest.approx(0.01, abs=1e-9)


def _contacts(mj_model: mujoco.MjModel, robot: Robot, joints: Vector) -> list[tuple[str, str]]:
    data = mujoco.MjData(mj_model)
    data.qpos[:] = robot.qpos_from_q(robot.home_q)
    data.qpos[7:] = joints
    mujoco.mj_forward(mj_model, data)
    return [(mj_model.geom(int(a)).name, mj_model.geom(int(b)).name) for a, b in data.contact.geom]


def _posture(robot: Robot, **angles: float) -> Vector:
    joints = robot.home_q[7:].copy()
    for name, angle in angles.items():
        joints[robot.joint_index(name)] = angle
    return joints


def test_home_is_free_of_self_collision(mj_model: mujoco.MjModel, robot: Robot) -> None:
    assert _contacts(mj_model, robot, robot.home_q[7:]) == []


@pytest.mark.parametrize("crouch", np.linspace(0, 1, 6))
def test_squat_is_free_of_self_collision(mj_model: mujoco.MjModel, robot: Robot, crouch: float) -> None:
    angles = {}
    for side in SIDES:
        angles[f"{side}_hip_pitch"] = -0.28 - 1.0 * crouch
        angles[f"{side}_knee"] = 0.6 + 1.5 * crouch
        angles[f"{side}_ankle_pitch"] = -0.32 - 0.5 * crouch
    assert _contacts(mj_model, robot, _posture(robot, **angles)) == []


@pytest.mark.parametrize("pitch", np.linspace(-2.2, -1.0, 7))
@pytest.mark.parametrize("inward", [0.0, 0.2, 0.4])
def test_stretched_arm_is_free_of_self_collision(
    mj_model: mujoco.MjModel, robot: Robot, pitch: float, inward: float
) -> None:
    angles = {"right_shoulder_pitch": pitch, "right_shoulder_roll": inward, "right_elbow": -0.02}
    assert _contacts(mj_model, robot, _posture(robot, **angles)) == []


def test_bodies_do_collide(mj_model: mujoco.MjModel, robot: Robot) -> None:
    """The tests above could not fail if the collision geoms were switched off: a hand in the chest must show."""
    angles = {"right_shoulder_pitch": -0.6, "right_shoulder_yaw": 1.5, "right_elbow": -2.2}
    pairs = _contacts(mj_model, robot, _posture(robot, **angles))
    assert {"chest", "right_palm_geom"} in [set(pair) for pair in pairs]


def test_every_limb_has_a_geom_that_collides(mj_model: mujoco.MjModel) -> None:
    collides = {mj_model.geom(i).name for i in np.flatnonzero(mj_model.geom_contype & mj_model.geom_conaffinity)}
    per_side = ("thigh", "shank", "foot", "shoulder", "upper_arm", "forearm", "palm_geom")
    limbs = {f"{side}_{limb}" for side in SIDES for limb in per_side}
    assert collides == limbs | {"pelvis_hull", "belly", "chest", "backpack", "head"}


def test_only_neighbours_are_excluded_from_collision(mj_model: mujoco.MjModel) -> None:
    """An excluded pair is one below the other in the tree, joined by no more than a joint's cluster of small links."""
    for signature in mj_model.exclude_signature:
        ancestor, body = sorted((int(signature) >> 16, int(signature) & 0xFFFF))
        links_between = -1
        while body > ancestor:
            body, links_between = int(mj_model.body_parentid[body]), links_between + 1
        assert body == ancestor
        assert links_between <= 2
