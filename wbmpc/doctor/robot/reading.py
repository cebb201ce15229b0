"""Whether both libraries read the file, and read the same robot."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from wbmpc import model_contract
from wbmpc.doctor.check import Answer, Missing
from wbmpc.doctor.robot.subject import SEED, RobotFile
from wbmpc.robot import Robot

CONFIGURATIONS = 8
TOLERANCE = 1e-8  # relative; both compute the same in double precision


def readable(robot: RobotFile) -> Answer:
    """MuJoCo compiles it: that also asks for positive masses and inertias that a solid can have."""
    if robot.mujoco_error:
        return Answer("", [f"MuJoCo refuses it: {robot.mujoco_error}"])
    model = robot.model
    return Answer(f"{model.nbody - 1} bodies, {model.njnt} joints, {model.nu} actuators, {model.ngeom} geoms")


def pinocchio_reads(robot: RobotFile) -> Answer:
    if not robot.mujoco_error and robot.pinocchio_error:
        return Answer("", [f"Pinocchio refuses it: {robot.pinocchio_error}"])
    return Answer(f"{robot.pin_model.njoints - 1} joints")


def same_robot(robot: RobotFile) -> Answer:
    """Joint order, mass, gravity and frames, as the contract has them."""
    for name in model_contract.SITES:
        robot.id("site", name)
    robot.id("body", "torso")
    problems = model_contract.agreement_problems(robot.model, robot.pin_model)
    return Answer(f"{robot.model.body_subtreemass[0]:.4g} kg in both, joints in one order", problems)


def same_dynamics(robot: RobotFile) -> Answer:
    """CoM, mass matrix and gravity torques at random configurations."""
    model, data = robot.model, mujoco.MjData(robot.model)
    pin_model, pin_data = robot.pin_model, robot.pin_model.createData()
    robot.needs_floating_base()
    if (pin_model.nq, pin_model.nv) != (model.nq, model.nv) or model_contract.agreement_problems(model, pin_model):
        raise Missing("one robot in both libraries")
    worst = dict.fromkeys(("CoM", "mass matrix", "gravity torques"), 0.0)
    random = np.random.default_rng(SEED)
    for _ in range(CONFIGURATIONS):
        data.qpos[:] = random_configuration(robot, random)
        mujoco.mj_forward(model, data)
        q = Robot.q_from_qpos(data.qpos)
        pin.computeAllTerms(pin_model, pin_data, q, np.zeros(model.nv))
        to_mujoco = np.eye(model.nv)  # qvel = to_mujoco v: Pinocchio's base velocity is in the base
        to_mujoco[:3, :3] = Robot.base_rotation(data.qpos)
        mass_matrix = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass_matrix)
        ours = to_mujoco @ pin_data.M @ to_mujoco.T
        compared = {
            "CoM": (pin_data.com[0], data.subtree_com[0]),
            "mass matrix": (np.triu(ours), np.triu(mass_matrix)),
            "gravity torques": (to_mujoco @ pin_data.nle, data.qfrc_bias),
        }
        for name, (a, b) in compared.items():
            worst[name] = max(worst[name], float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-12)))
    wrong = [f"{name} differ by {share:.1e} of the largest" for name, share in worst.items() if not share < TOLERANCE]
    return Answer(f"equal to {max(worst.values()):.0e} at {CONFIGURATIONS} random configurations", wrong)


def same_frames(robot: RobotFile) -> Answer:
    """Where the sites are, at random configurations."""
    model, data = robot.model, mujoco.MjData(robot.model)
    pin_model, pin_data = robot.pin_model, robot.pin_model.createData()
    robot.needs_floating_base()
    if pin_model.nq != model.nq:
        raise Missing("one robot in both libraries")
    sites = {name: robot.id("site", name) for name in model_contract.SITES}
    random = np.random.default_rng(SEED)
    wrong = dict.fromkeys(sites, 0.0)
    for _ in range(CONFIGURATIONS):
        data.qpos[:] = random_configuration(robot, random)
        mujoco.mj_kinematics(model, data)
        pin.framesForwardKinematics(pin_model, pin_data, Robot.q_from_qpos(data.qpos))
        for name, site in sites.items():
            if not pin_model.existFrame(name):
                raise Missing(f"a frame {name!r} in Pinocchio")
            frame = pin_data.oMf[pin_model.getFrameId(name)]
            turned = np.abs(frame.rotation - data.site_xmat[site].reshape(3, 3)).max()
            wrong[name] = max(wrong[name], np.abs(frame.translation - data.site_xpos[site]).max(), turned)
    differ = [f"site {name!r} differs by {error:.1e}" for name, error in wrong.items() if not error < TOLERANCE]
    return Answer(f"{len(sites)} sites equal to {max(wrong.values()):.0e} m", differ)


def random_configuration(robot: RobotFile, random: np.random.Generator) -> np.ndarray:
    """A MuJoCo configuration (nq,): base anywhere, joints within their ranges."""
    lower, upper = robot.model.jnt_range[robot.hinges].T
    quaternion = random.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    return np.concatenate((random.uniform(-1, 1, 3), quaternion, random.uniform(lower, upper)))
