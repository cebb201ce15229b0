"""Each check of a robot's MJCF: silent about the shipped one, and alone in speaking up when its matter is spoilt."""

from __future__ import annotations

import random
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from settled import settled

from wbmpc.doctor.check import Answer, Check, Finding, Missing, Status, examine
from wbmpc.doctor.robot import reach
from wbmpc.doctor.robot.checks import CHECKS, examine_robot
from wbmpc.doctor.robot.subject import RobotFile
from wbmpc.signals import GRAVITY

MODEL = Path(__file__).parents[2] / "models" / "surena_mini.xml"
Root = ElementTree.Element


def tree() -> Root:
    return ElementTree.parse(MODEL).getroot()


def spoilt(folder: Path, change: Callable[[Root], Any]) -> dict[str, Finding]:
    """Findings about a changed copy of the shipped robot, by check."""
    root = tree()
    change(root)
    path = folder / "robot.xml"
    ElementTree.ElementTree(root).write(path)
    return {finding.name: finding for finding in examine_robot(path)}


def one(root: Root, tag: str, name: str) -> Root:
    found = root.find(f".//{tag}[@name='{name}']")
    assert found is not None, name
    return found


def set_of(tag: str, name: str, /, **values: str) -> Callable[[Root], None]:
    return lambda root: one(root, tag, name).attrib.update(values)


def inertial(body: str, **values: str) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        found = one(root, "body", body).find("inertial")
        assert found is not None
        found.attrib.update(values)

    return change


def default(name: str, tag: str, **values: str) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        found = root.find(f".//default[@class='{name}']/{tag}")
        assert found is not None
        found.attrib.update(values)

    return change


def option(**values: str) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        found = root.find("option")
        assert found is not None
        found.attrib.update(values)

    return change


def both(*changes: Callable[[Root], Any]) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        for each in changes:
            each(root)

    return change


def sides(tag: str, name: str, **values: str) -> Callable[[Root], None]:
    return both(*(set_of(tag, f"{side}_{name}", **values) for side in ("left", "right")))


def home(index: int, value: float, *, add: bool = False) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        key = one(root, "key", "home")
        qpos = [float(word) for word in key.attrib["qpos"].split()]
        qpos[index] = value + (qpos[index] if add else 0.0)
        key.attrib["qpos"] = " ".join(map(str, qpos))

    return change


def lighter(root: Root) -> None:
    for found in root.iter("inertial"):
        found.attrib["mass"] = str(0.1 * float(found.attrib["mass"]))
        found.attrib["diaginertia"] = " ".join(str(0.1 * float(x)) for x in found.attrib["diaginertia"].split())


def without(tag: str, name: str) -> Callable[[Root], None]:
    def change(root: Root) -> None:
        (parent,) = [parent for parent in root.iter() if one(root, tag, name) in parent]
        parent.remove(one(root, tag, name))

    return change


def flag(root: Root) -> None:
    found = root.find("option")
    assert found is not None
    ElementTree.SubElement(found, "flag", frictionloss="disable")


def hand_in_chest(root: Root) -> None:
    for index, value in ((24, -0.6), (26, 1.5), (27, -2.2)):  # right shoulder pitch and yaw, elbow
        home(index, value)(root)


SPOILT = [
    ("mujoco", Status.FAIL, "A + B >= C", inertial("head_link", diaginertia="1e-5 1e-5 1e-3")),
    ("mujoco", Status.FAIL, "mass", inertial("head_link", mass="0")),
    ("tree", Status.FAIL, "joint 'neck_yaw' is not a hinge", set_of("joint", "neck_yaw", type="slide")),
    ("names", Status.FAIL, "no site 'left_palm'", without("site", "left_palm")),
    ("names", Status.FAIL, "'left_forearm' is not a capsule", set_of("geom", "left_forearm", type="cylinder")),
    ("names", Status.FAIL, "no keyframe 'home'", set_of("key", "home", name="standing")),
    ("servos", Status.FAIL, "'neck_yaw' has no symmetric", set_of("joint", "neck_yaw", actuatorfrcrange="-1 2")),
    ("servos", Status.FAIL, "'neck_yaw' has no no-load speed", set_of("joint", "neck_yaw", user="0")),
    ("servos", Status.FAIL, "23 motors needed", without("motor", "neck_yaw_servo")),
    (
        "motor ranges",
        Status.FAIL,
        "ctrlrange of left_knee's motor ends at 1 N·m",
        set_of("motor", "left_knee_servo", ctrllimited="true", ctrlrange="-1 1"),
    ),
    ("joint ranges", Status.WARN, "neck_yaw: 180 rad", set_of("joint", "neck_yaw", range="-90 90")),
    ("rotors", Status.WARN, "neck_yaw: no armature", set_of("joint", "neck_yaw", armature="0")),
    ("rotors", Status.WARN, "neck_yaw: dry friction 0.5", set_of("joint", "neck_yaw", frictionloss="0.5")),
    ("speeds", Status.WARN, "neck_yaw: 55 rad/s", set_of("joint", "neck_yaw", user="55")),
    ("masses", Status.WARN, "neck_link weighs 0.0005 kg", inertial("neck_link", mass="0.0005")),
    ("inertias", Status.FAIL, "head_link: radius of gyration", inertial("head_link", diaginertia="0.134 0.124 0.149")),
    ("total mass", Status.WARN, "0.343 kg at 0.53 m", lighter),
    ("one robot", Status.FAIL, "gravity must be", option(gravity="0 0 -9.8")),
    (
        "contact sites",
        Status.FAIL,
        "'left_sole' is not the centre",
        both(*(set_of("site", f"{side}_sole", pos="0.0055 0 -0.03") for side in ("left", "right"))),
    ),
    ("imu", Status.FAIL, "no <gyro> sensor 'imu_gyro'", without("gyro", "imu_gyro")),
    ("imu", Status.FAIL, "'imu_gyro' is not a <gyro> of site 'imu'", set_of("gyro", "imu_gyro", site="left_palm")),
    ("imu", Status.WARN, "tilted by 11.5° at home", set_of("site", "imu", euler="0.2 0 0")),
    ("feet", Status.WARN, "falls from 0.9° on", default("foot", "geom", size="0.06 0.004 0.01")),
    ("feet", Status.FAIL, "left 0.1 × 0.07 m, right 0.12", set_of("geom", "left_foot", size="0.05 0.035 0.01")),
    ("limb sizes", Status.FAIL, "palm_geom: left 15 mm, right 20 mm", set_of("geom", "right_palm_geom", size="0.02")),
    ("collisions", Status.FAIL, "'left_shank' goes", set_of("geom", "left_shank", contype="0", conaffinity="0")),
    ("friction", Status.FAIL, "left_foot: condim 1", set_of("geom", "left_foot", condim="1")),
    ("friction", Status.FAIL, "friction 0.1", set_of("geom", "left_foot", friction="0.1 0.005 0.0001")),
    ("symmetric legs", Status.WARN, "0.07 / 0.08 kg", inertial("right_shank_link", mass="0.08")),
    ("symmetric legs", Status.WARN, "-0.6 … 1 / -0.6 … 1 rad", set_of("joint", "right_hip_yaw", range="-0.6 1")),
    ("symmetric legs", Status.WARN, "CoM at", inertial("right_shank_link", pos="0.004 0.01 -0.05")),
    (
        "symmetric legs",
        Status.WARN,
        "inertias differ",
        inertial("right_thigh_link", diaginertia="9e-5 9.86e-5 3.36e-5"),
    ),
    (
        "symmetric arms",
        Status.WARN,
        "torque limits 2 / 1.9",
        set_of("joint", "right_elbow", actuatorfrcrange="-1.9 1.9"),
    ),
    ("home", Status.FAIL, "neck_pitch at 1.2 rad of -0.7 … 0.9", home(29, 1.2)),
    ("home", Status.WARN, "neck_yaw at 1.49 rad", home(28, 1.49)),
    ("home feet", Status.FAIL, "left sole: a corner +5.0 mm", home(2, 0.005, add=True)),
    ("home feet", Status.FAIL, "between the soles is at x = +20.0 mm", home(0, 0.02, add=True)),
    ("home balance", Status.WARN, "at its edge", inertial("torso", pos="0.2 0 0.0522")),
    ("home collisions", Status.FAIL, "chest is", hand_in_chest),
    ("holding torques", Status.FAIL, "left_knee needs 1", default("leg", "joint", actuatorfrcrange="-0.35 0.35")),
    ("leg reach", Status.FAIL, "it cannot crouch", sides("joint", "knee", range="0.55 0.65")),
    ("palm reach", Status.WARN, "mm behind the toes", default("foot", "geom", size="0.3 0.035 0.01")),
    (
        "hands meet",
        Status.WARN,
        "share 0%",
        both(
            sides("joint", "shoulder_yaw", range="-0.1 0.1"),
            set_of("joint", "left_shoulder_roll", range="0.1 2.6"),
            set_of("joint", "right_shoulder_roll", range="-2.6 -0.1"),
        ),
    ),
    ("timestep", Status.WARN, "5 ms", option(timestep="0.005")),
    ("physics", Status.WARN, "integrator euler", option(integrator="Euler")),
    ("physics", Status.WARN, "cone pyramidal", option(cone="pyramidal")),
    ("physics", Status.FAIL, "switched off: frictionloss", flag),
]


@pytest.fixture(autouse=True)
def fewer_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reach, "SAMPLES", 800)
    monkeypatch.setattr(reach, "LEG_SAMPLES", 1500)


def test_the_shipped_robot_is_well() -> None:
    findings = examine_robot(MODEL)
    assert len(findings) == len(CHECKS) >= 20
    assert [finding for finding in findings if finding.status is not Status.OK] == []
    assert all(finding.found and finding.hint for finding in findings)


@pytest.mark.parametrize(("check", "status", "words", "change"), SPOILT, ids=lambda x: x if isinstance(x, str) else "")
def test_exactly_the_check_of_what_is_spoilt_speaks_up(
    check: str, status: Status, words: str, change: Callable[[Root], None], tmp_path: Path
) -> None:
    findings = spoilt(tmp_path, change)
    wrong = {name for name, finding in findings.items() if finding.status in (Status.WARN, Status.FAIL)}
    assert wrong == {check}, {name: findings[name].found for name in wrong}
    assert findings[check].status is status
    assert words in findings[check].found
    reasons = {f.found for f in findings.values() if f.status is Status.SKIPPED}
    assert all(reason.startswith("needs ") for reason in reasons)


def test_nearly_every_check_has_been_spoilt() -> None:
    # Pinocchio's reading is spoilt below; where it reads on, but otherwise, the contract's mass check speaks first.
    assert {check.name for check in CHECKS} - {row[0] for row in SPOILT} == {
        "pinocchio",
        "one dynamics",
        "one kinematics",
    }


def test_what_only_pinocchio_refuses_or_reads_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pinocchio as pin

    read = pin.buildModelFromMJCF

    def refuses(path: str) -> Any:
        raise ValueError("in function: f at line: 3 message: no such joint")

    monkeypatch.setattr(pin, "buildModelFromMJCF", refuses)
    findings = {finding.name: finding for finding in examine_robot(MODEL)}
    assert findings["pinocchio"].found == "Pinocchio refuses it: no such joint"
    assert {n for n, f in findings.items() if f.status is Status.SKIPPED} == {
        "one robot",
        "one dynamics",
        "one kinematics",
    }

    def shifts(path: str) -> Any:
        """Reads a link's CoM and a site elsewhere than they are."""
        model = read(path)
        model.inertias[8].lever = model.inertias[8].lever + np.array([1e-3, 0, 0])
        model.frames[model.getFrameId("imu")].placement.translation += np.array([1e-3, 0, 0])
        return model

    monkeypatch.setattr(pin, "buildModelFromMJCF", shifts)
    findings = {finding.name: finding for finding in examine_robot(MODEL)}
    wrong = {name: f.found for name, f in findings.items() if f.status is not Status.OK}
    assert set(wrong) == {"one dynamics", "one kinematics"}
    assert wrong["one kinematics"] == "site 'imu' differs by 1.0e-03"


@pytest.mark.parametrize("seed", range(12))
def test_whatever_is_missing_every_check_answers(seed: int, tmp_path: Path) -> None:
    """Elements taken out at random: nothing escapes, and no check stumbles over what another one reports."""
    draw = random.Random(seed)

    def change(root: Root) -> None:
        for _ in range(draw.choice((1, 3, 10))):
            pairs = [(parent, child) for parent in root.iter() for child in parent]
            parent, child = draw.choice(pairs)
            parent.remove(child)

    findings = spoilt(tmp_path, change)
    assert len(findings) == len(CHECKS)
    assert [f for f in findings.values() if "cannot be looked at" in f.found] == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nonsense",
        "<mujoco/>",
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>",
        "<mujoco><worldbody><body><joint type='ball'/><geom size='1'/></body></worldbody></mujoco>",
        "<mujoco><worldbody><body><freejoint name='root'/><geom size='1'/><body pos='0 0 1'><joint name='a'/>"
        "<geom size='.1'/></body></body></worldbody></mujoco>",
    ],
)
def test_a_file_that_is_no_humanoid_is_reported(text: str, tmp_path: Path) -> None:
    path = tmp_path / "other.xml"
    path.write_text(text)
    findings = examine_robot(path)
    assert any(finding.status is Status.FAIL for finding in findings)
    assert [f for f in findings if "cannot be looked at" in f.found] == []


def test_holding_torques_are_those_of_a_robot_that_stands() -> None:
    """Against a simulation: joints held stiffly on a floor until all is at rest."""
    from wbmpc.doctor.robot.standing import holding_torques

    model, data = settled(MODEL, ticks=2000, stiffness=60.0, damping=1.0)
    knee = model.joint("left_knee").id
    share = abs(data.actuator_force[knee - 1]) / model.jnt_actfrcrange[knee, 1]
    words = holding_torques(RobotFile(MODEL)).found
    assert "(left_knee)" in words
    assert share == pytest.approx(float(words.split("%")[0].split()[-1]) / 100, abs=0.03)
    assert data.qfrc_constraint[2] == pytest.approx(3.43 * GRAVITY, rel=0.01)


def test_a_check_that_stumbles_does_not_end_the_others() -> None:
    def stumbles(_: None) -> Answer:
        raise ZeroDivisionError("by zero\nsecond line")

    def lacks(_: None) -> Answer:
        raise Missing("a thing")

    many = [str(k) for k in range(6)]
    checks = [
        Check[None]("a", stumbles, "h"),
        Check[None]("b", lacks, "h"),
        Check[None]("c", lambda _: Answer("fine"), "h"),
        Check[None]("d", lambda _: Answer("fine", many, ["w"]), "h"),
    ]
    found = examine(checks, None)
    assert [f.status for f in found] == [Status.FAIL, Status.SKIPPED, Status.OK, Status.FAIL]
    assert [f.found for f in found] == [
        "cannot be looked at: ZeroDivisionError: by zero",
        "needs a thing",
        "fine",
        "0; 1; 2; 3; and 3 more",
    ]
