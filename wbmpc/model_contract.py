"""What an MJCF must contain to be a robot here, checked before anything else looks at it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from wbmpc.errors import RobotError
from wbmpc.signals import GRAVITY, SIDES

SITES = ("left_sole", "right_sole", "left_palm", "right_palm", "imu")
IMU = {  # sensors that the estimator reads, all of the site `imu`
    "imu_quaternion": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "imu_gyro": mujoco.mjtSensor.mjSENS_GYRO,
    "imu_accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER,
}
MASS_TOLERANCE = 1e-9  # [kg]
LENGTH_TOLERANCE = 1e-9  # [m]


def read(path: Path) -> tuple[mujoco.MjModel, pin.Model]:
    """Both libraries' reading of the MJCF at `path`, checked against the contract in models/README.md.

    Raises:
        RobotError: one line that names the file and everything found missing.
    """
    if not path.is_file():
        raise RobotError(f"{path}: no such robot model")
    try:
        mj_model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise RobotError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from None
    problems = [
        *tree_problems(mj_model),
        *servo_problems(mj_model),
        *named_problems(mj_model),
        *sensor_problems(mj_model),
    ]
    problems = problems or contact_geom_problems(mj_model)  # these look the names up
    if problems:
        raise RobotError(f"{path}: {'; '.join(problems)}")
    try:
        pin_model = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{path}: Pinocchio refuses it: {' '.join(str(error).split())}") from None
    problems = agreement_problems(mj_model, pin_model)
    if problems:
        raise RobotError(f"{path}: {'; '.join(problems)}")
    return mj_model, pin_model


def _has(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, kind, name) >= 0)


def tree_problems(model: mujoco.MjModel) -> list[str]:
    """A floating base named `root`, then hinges with ranges."""
    if model.njnt == 0 or model.jnt_type[0] != mujoco.mjtJoint.mjJNT_FREE or model.joint(0).name != "root":
        return ["the first joint must be <freejoint name='root'/>"]
    problems = []
    for joint in range(1, model.njnt):
        name = model.joint(joint).name
        if not name:
            problems.append(f"joint {joint} has no name")
        elif model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            problems.append(f"joint {name!r} is not a hinge")
        elif not model.jnt_limited[joint]:
            problems.append(f"joint {name!r} has no range")
    return problems


def servo_problems(model: mujoco.MjModel) -> list[str]:
    """Torque and speed limit of every hinge, and one plain torque motor each, in joint order."""
    problems = []
    for joint in range(1, model.njnt):
        name, (lower, upper) = model.joint(joint).name, model.jnt_actfrcrange[joint]
        if not (model.jnt_actfrclimited[joint] and upper > 0 and lower == -upper):
            problems.append(f"joint {name!r} has no symmetric torque limit (actuatorfrcrange)")
        if model.nuser_jnt < 1 or not model.jnt_user[joint, 0] > 0:
            problems.append(f"joint {name!r} has no no-load speed [rad/s] (user)")
    wanted = list(range(1, model.njnt))
    if model.nu != len(wanted) or model.actuator_trnid[:, 0].tolist() != wanted:
        problems.append(f"{len(wanted)} motors needed, one per hinge in joint order")
    elif not (
        np.all(model.actuator_gear[:, 0] == 1) and np.all(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED)
    ):
        problems.append("actuators must be <motor> with gear 1")
    return problems


def named_problems(model: mujoco.MjModel) -> list[str]:
    problems = [f"no site {name!r}" for name in SITES if not _has(model, mujoco.mjtObj.mjOBJ_SITE, name)]
    if not _has(model, mujoco.mjtObj.mjOBJ_BODY, "torso"):
        problems.append("no body 'torso'")
    if not _has(model, mujoco.mjtObj.mjOBJ_KEY, "home"):
        problems.append("no keyframe 'home'")
    for side in SIDES:
        for name, shape in (
            (f"{side}_foot", "box"),
            (f"{side}_palm_geom", "sphere"),
            (f"{side}_forearm", "capsule"),
            (f"{side}_thigh", "capsule"),
            (f"{side}_shank", "capsule"),
        ):
            if not _has(model, mujoco.mjtObj.mjOBJ_GEOM, name):
                problems.append(f"no {shape} geom {name!r}")
            elif model.geom(name).type[0] != getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}"):
                problems.append(f"geom {name!r} is not a {shape}")
    return problems


def sensor_problems(model: mujoco.MjModel) -> list[str]:
    """The IMU's three sensors."""
    problems = []
    for name, kind in IMU.items():
        tag = kind.name.removeprefix("mjSENS_").lower()
        if not _has(model, mujoco.mjtObj.mjOBJ_SENSOR, name):
            problems.append(f"no <{tag}> sensor {name!r}")
            continue
        sensor = model.sensor(name)
        on_site = sensor.objtype[0] == mujoco.mjtObj.mjOBJ_SITE
        if sensor.type[0] != kind or not on_site or model.site(int(sensor.objid[0])).name != "imu":
            problems.append(f"sensor {name!r} is not a <{tag}> of site 'imu'")
    return problems


def contact_geom_problems(model: mujoco.MjModel) -> list[str]:
    """Sole sites on the bottom face of the foot boxes, palm sites in the centre of the palm spheres."""
    problems = []
    for side in SIDES:
        foot, sole = model.geom(f"{side}_foot"), model.site(f"{side}_sole")
        palm, centre = model.geom(f"{side}_palm_geom"), model.site(f"{side}_palm")
        bottom = foot.pos - [0, 0, foot.size[2]]
        if foot.bodyid[0] != sole.bodyid[0] or np.abs(bottom - sole.pos).max() > LENGTH_TOLERANCE:
            problems.append(f"site '{side}_sole' is not the centre of the bottom of geom '{side}_foot'")
        if palm.bodyid[0] != centre.bodyid[0] or np.abs(palm.pos - centre.pos).max() > LENGTH_TOLERANCE:
            problems.append(f"site '{side}_palm' is not the centre of geom '{side}_palm_geom'")
    return problems


def agreement_problems(mj_model: mujoco.MjModel, pin_model: pin.Model) -> list[str]:
    """What Pinocchio reads differently without saying so."""
    problems = []
    names = [mj_model.joint(i).name for i in range(mj_model.njnt)]
    if list(pin_model.names)[1:] != names:
        problems.append("Pinocchio orders the joints differently; put everything under the first world body")
    masses = mj_model.body_subtreemass[0], pin.computeTotalMass(pin_model)
    if abs(masses[0] - masses[1]) > MASS_TOLERANCE:
        problems.append(
            f"MuJoCo weighs it {masses[0]:.6g} kg, Pinocchio {masses[1]:.6g} kg; give every body an explicit <inertial>"
        )
    if np.abs(mj_model.opt.gravity - [0, 0, -GRAVITY]).max() > 0:
        problems.append(f"gravity must be (0, 0, -{GRAVITY})")
    problems += [f"Pinocchio has no frame {name!r}" for name in (*SITES, "torso") if not pin_model.existFrame(name)]
    return problems
