"""The conversions between MuJoCo and Pinocchio, the contract's errors, and what Kinematics promises."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from wbmpc.errors import RobotError
from wbmpc.kinematics import Kinematics
from wbmpc.robot import Robot
from wbmpc.signals import Vector

MODEL = Path(__file__).parents[1] / "models" / "surena_mini.xml"
ROBOT = Robot.load(MODEL)
MJ_MODEL = mujoco.MjModel.from_xml_path(str(MODEL))

rates = arrays(np.float64, ROBOT.nv, elements=st.floats(-20, 20))


@st.composite
def configurations(draw: st.DrawFn) -> Vector:
    """MuJoCo configurations: any base pose, any joint angles."""
    qpos = draw(arrays(np.float64, ROBOT.nq, elements=st.floats(-3, 3)))
    norm = np.linalg.norm(qpos[3:7])
    qpos[3:7] = qpos[3:7] / norm if norm > 0.1 else [1, 0, 0, 0]
    return qpos


# Conversions


@given(qpos=configurations())
def test_configuration_round_trip(qpos: Vector) -> None:
    q = ROBOT.q_from_qpos(qpos)
    assert_allclose(ROBOT.qpos_from_q(q), qpos, rtol=0, atol=0)
    assert_allclose(pin.Quaternion(q[3:7]).matrix(), ROBOT.base_rotation(qpos), atol=1e-12)


@given(qpos=configurations(), qvel=rates)
def test_velocity_round_trip(qpos: Vector, qvel: Vector) -> None:
    assert_allclose(ROBOT.qvel_from_v(qpos, ROBOT.v_from_qvel(qpos, qvel)), qvel, atol=1e-12)


@given(qpos=configurations(), qvel=rates, qacc=rates)
def test_acceleration_round_trip(qpos: Vector, qvel: Vector, qacc: Vector) -> None:
    v, a = ROBOT.v_from_qvel(qpos, qvel), ROBOT.a_from_qacc(qpos, qvel, qacc)
    assert_allclose(ROBOT.qacc_from_a(qpos, v, a), qacc, atol=1e-11)


@given(qpos=configurations(), qvel=rates)
def test_both_libraries_integrate_the_same_motion(qpos: Vector, qvel: Vector) -> None:
    """One step of each: MuJoCo moves the base straight in the world, Pinocchio on a screw; they differ by O(step²)."""
    step = 1e-5
    moved = qpos.copy()
    mujoco.mj_integratePos(MJ_MODEL, moved, qvel, step)
    q = ROBOT.integrate(ROBOT.q_from_qpos(qpos), step * ROBOT.v_from_qvel(qpos, qvel))
    assert_allclose(q, ROBOT.q_from_qpos(moved), atol=2e3 * step**2)


@given(qpos=configurations(), qvel=rates, qacc=rates)
def test_acceleration_is_the_velocitys_derivative(qpos: Vector, qvel: Vector, qacc: Vector) -> None:
    step, v = 1e-6, []
    for sign in (1, -1):
        moved = qpos.copy()
        mujoco.mj_integratePos(MJ_MODEL, moved, qvel, sign * step)
        v.append(ROBOT.v_from_qvel(moved, qvel + sign * step * qacc))
    assert_allclose(ROBOT.a_from_qacc(qpos, qvel, qacc), (v[0] - v[1]) / (2 * step), atol=1e-5)


@given(qpos=configurations(), displacement=arrays(np.float64, ROBOT.nv, elements=st.floats(-1, 1)))
def test_difference_undoes_integrate(qpos: Vector, displacement: Vector) -> None:
    start = ROBOT.q_from_qpos(qpos)
    end = ROBOT.integrate(start, displacement)
    assert_allclose(ROBOT.difference(start=start, end=end), displacement, atol=1e-6)


# Robot


def test_chains_and_extents() -> None:
    legs, arms = ROBOT.leg_joints, ROBOT.arm_joints
    assert [ROBOT.joint_names[i] for i in legs[1]] == [
        f"right_{joint}" for joint in ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
    ]
    assert [ROBOT.joint_names[i] for i in arms[0]] == [
        f"left_{joint}" for joint in ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
    ]
    assert_allclose(ROBOT.sole_half_extents, [0.06, 0.035])
    assert ROBOT.palm_radius == 0.015


def test_arm_length_bounds_the_shoulder_to_palm_distance() -> None:
    random, kinematics, longest = np.random.default_rng(0), Kinematics(ROBOT), 0.0
    q = ROBOT.home_q.copy()
    for elbow in (0.0, *random.uniform(-2.4, 0, 20)):
        q[7:] = random.uniform(ROBOT.joint_lower, ROBOT.joint_upper)
        q[7 + ROBOT.joint_index("left_elbow")] = elbow
        kinematics.update_kinematics(q)
        offset = kinematics.position(ROBOT.palm_frames[0]) - kinematics.position(ROBOT.shoulder_frames[0])
        longest = max(longest, float(np.linalg.norm(offset)))
    assert longest == pytest.approx(ROBOT.arm_length, abs=1e-12)


def test_arrays_are_read_only() -> None:
    for array in (ROBOT.home_q, ROBOT.torque_limit, ROBOT.joint_lower, ROBOT.arm_joints[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_unknown_joint_lists_the_choices() -> None:
    with pytest.raises(RobotError, match=r"no joint 'left_kne'; joints: left_hip_yaw, .*left_knee"):
        ROBOT.joint_index("left_kne")


# Kinematics


def test_kinematic_update_agrees_with_the_full_one() -> None:
    random = np.random.default_rng(1)
    full, light = Kinematics(ROBOT), Kinematics(ROBOT)
    for _ in range(5):
        q = ROBOT.integrate(ROBOT.home_q, random.standard_normal(ROBOT.nv))
        full.update(q, random.standard_normal(ROBOT.nv))
        light.update_kinematics(q)
        for frame in (*ROBOT.sole_frames, *ROBOT.palm_frames, ROBOT.torso_frame):
            assert_allclose(light.position(frame), full.position(frame), atol=1e-12)
            assert_allclose(light.rotation(frame), full.rotation(frame), atol=1e-12)
            assert_allclose(light.jacobian(frame), full.jacobian(frame), atol=1e-12)
        assert_allclose(light.com, full.com, atol=1e-12)
        assert_allclose(light.com_jacobian, full.com_jacobian, atol=1e-12)


def test_stale_dynamics_are_refused() -> None:
    kinematics = Kinematics(ROBOT)
    kinematics.update(ROBOT.home_q, np.zeros(ROBOT.nv))
    kinematics.update_kinematics(ROBOT.home_q)
    readings: list[Callable[[], object]] = [
        lambda: kinematics.mass_matrix,
        lambda: kinematics.bias,
        lambda: kinematics.com_velocity,
        lambda: kinematics.com_drift,
        lambda: kinematics.centroidal_momentum_matrix,
        lambda: kinematics.centroidal_momentum_drift,
        lambda: kinematics.velocity(ROBOT.torso_frame),
        lambda: kinematics.drift(ROBOT.torso_frame),
    ]
    for read in readings:
        with pytest.raises(RuntimeError, match="update"):
            read()


def test_results_survive_the_next_update() -> None:
    kinematics = Kinematics(ROBOT)
    kinematics.update(ROBOT.home_q, np.zeros(ROBOT.nv))
    sole = ROBOT.sole_frames[0]

    def read() -> list[Vector]:
        return [
            kinematics.mass_matrix, kinematics.bias, kinematics.com, kinematics.com_jacobian, kinematics.com_velocity,
            kinematics.centroidal_momentum_matrix, kinematics.position(sole), kinematics.rotation(sole),
            kinematics.jacobian(sole), kinematics.velocity(sole), kinematics.drift(sole),
        ]  # fmt: skip

    before = read()
    copies = [array.copy() for array in before]
    kinematics.update(ROBOT.integrate(ROBOT.home_q, np.full(ROBOT.nv, 0.1)), np.ones(ROBOT.nv))
    for array, copy, after in zip(before, copies, read(), strict=True):
        assert array.flags.c_contiguous
        assert_allclose(array, copy, rtol=0, atol=0)
        assert np.abs(after - copy).max() > 1e-6  # the update did change the answer


# The contract


def _edit(tmp_path: Path, change: Callable[[ElementTree.Element], None]) -> Path:
    tree = ElementTree.parse(MODEL)
    change(tree.getroot())
    path = tmp_path / "broken.xml"
    tree.write(path)
    return path


def _remove(tag: str, name: str) -> Callable[[ElementTree.Element], None]:
    def change(root: ElementTree.Element) -> None:
        for parent in root.iter():
            for child in list(parent):
                if child.tag == tag and child.get("name") == name:
                    parent.remove(child)

    return change


def _set(tag: str, name: str, **attributes: str) -> Callable[[ElementTree.Element], None]:
    def change(root: ElementTree.Element) -> None:
        (element,) = (e for e in root.iter(tag) if e.get("name") == name)
        element.attrib.update(attributes)

    return change


def _without_default(attribute: str) -> Callable[[ElementTree.Element], None]:
    def change(root: ElementTree.Element) -> None:
        for default in root.iter("default"):
            for joint in default.findall("joint"):
                joint.attrib.pop(attribute, None)

    return change


def _reverse_motors(root: ElementTree.Element) -> None:
    actuator = root.find("actuator")
    assert actuator is not None
    actuator[:] = reversed(list(actuator))


def _mass_from_geom(root: ElementTree.Element) -> None:
    """Take a body's explicit inertial away and give a visual geom a mass: Pinocchio does not count it."""
    (head,) = (body for body in root.iter("body") if body.get("name") == "head_link")
    inertial = head.find("inertial")
    assert inertial is not None
    head.remove(inertial)
    head.append(ElementTree.Element("geom", {"class": "visual", "type": "sphere", "size": "0.03", "mass": "0.17"}))


def _rename_root(root: ElementTree.Element) -> None:
    for joint in root.iter("freejoint"):
        joint.set("name", "base")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param(_remove("site", "left_sole"), "no site 'left_sole'", id="no sole"),
        pytest.param(_remove("site", "right_palm"), "no site 'right_palm'", id="no palm"),
        pytest.param(_remove("key", "home"), "no keyframe 'home'", id="no keyframe"),
        pytest.param(_remove("geom", "left_forearm"), "no capsule geom 'left_forearm'", id="no forearm"),
        pytest.param(_set("geom", "right_shank", type="box"), "geom 'right_shank' is not a capsule", id="shank a box"),
        pytest.param(_remove("geom", "left_foot"), "no box geom 'left_foot'", id="no foot"),
        pytest.param(_set("geom", "left_foot", type="capsule"), "geom 'left_foot' is not a box", id="foot not a box"),
        pytest.param(
            _set("site", "left_sole", pos="0 0 -0.02"), "site 'left_sole' is not the centre", id="sole inside"
        ),
        pytest.param(_set("site", "left_palm", pos="0 0 0"), "site 'left_palm' is not the centre", id="palm away"),
        pytest.param(_rename_root, "first joint must be <freejoint name='root'/>", id="root unnamed"),
        pytest.param(_without_default("user"), "joint 'left_knee' has no no-load speed", id="no speed"),
        pytest.param(_without_default("actuatorfrcrange"), "'left_knee' has no symmetric torque limit", id="no torque"),
        pytest.param(_remove("motor", "left_knee_servo"), "23 motors needed, one per hinge", id="motor missing"),
        pytest.param(_reverse_motors, "23 motors needed, one per hinge in joint order", id="motor order"),
        pytest.param(_set("motor", "left_knee_servo", gear="50"), "must be <motor> with gear 1", id="gear"),
        pytest.param(_mass_from_geom, "give every body an explicit <inertial>", id="mass of a geom"),
        pytest.param(lambda root: root.find("option").set("gravity", "0 0 -1.62"), "gravity must be", id="moon"),
        pytest.param(lambda root: root.find("worldbody").clear(), "MuJoCo refuses it", id="empty"),
    ],
)
def test_broken_models_are_named(tmp_path: Path, change: Callable[[ElementTree.Element], None], message: str) -> None:
    path = _edit(tmp_path, change)
    with pytest.raises(RobotError) as raised:
        Robot.load(path)
    text = str(raised.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert "\n" not in text


def test_everything_missing_is_told_at_once(tmp_path: Path) -> None:
    def change(root: ElementTree.Element) -> None:
        _remove("site", "left_sole")(root)
        _remove("key", "home")(root)

    with pytest.raises(RobotError, match="no site 'left_sole'; no keyframe 'home'"):
        Robot.load(_edit(tmp_path, change))


@pytest.mark.parametrize(
    "content", [b"", b"not xml", b"<mujoco><worldbody>", b"\x00\xff\xfe\x80", b"<robot name='u'/>"]
)
def test_unreadable_files_give_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "robot.xml"
    path.write_bytes(content)
    with pytest.raises(RobotError) as raised:
        Robot.load(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_absent_file(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="no such robot model"):
        Robot.load(tmp_path / "nothing.xml")
