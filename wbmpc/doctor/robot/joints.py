"""Joints and their servos."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from wbmpc import model_contract
from wbmpc.doctor.check import Answer
from wbmpc.doctor.robot.subject import RobotFile

LEAST_MARGIN = 0.02  # [rad] between home and the end of a range
SPEEDS = (1.0, 50.0)  # [rad/s] no-load speeds of servos that move a humanoid


def tree(robot: RobotFile) -> Answer:
    """A floating base, then hinges with ranges: the contract."""
    return Answer(f"a floating base and {robot.model.njnt - 1} hinges", model_contract.tree_problems(robot.model))


def servos(robot: RobotFile) -> Answer:
    """One torque motor for each joint, with torque limit and no-load speed: the contract."""
    robot.needs_floating_base()
    limits = robot.model.jnt_actfrcrange[robot.hinges, 1]
    found = f"{robot.model.nu} motors of {limits.min(initial=math.inf):g} to {limits.max(initial=0):g} N·m"
    return Answer(found, model_contract.servo_problems(robot.model))


def motor_ranges(robot: RobotFile) -> Answer:
    """No control or force range of a motor cuts off what its joint's torque limit allows."""
    model, cut = robot.model, []
    for actuator in range(model.nu):
        joint, gear = int(model.actuator_trnid[actuator, 0]), abs(model.actuator_gear[actuator, 0])
        ranges = (
            ("ctrlrange", model.actuator_ctrllimited, model.actuator_ctrlrange, gear),
            ("forcerange", model.actuator_forcelimited, model.actuator_forcerange, gear),
        )
        for name, limited, bounds, factor in ranges:
            if limited[actuator] and factor * np.abs(bounds[actuator]).min() < model.jnt_actfrcrange[joint, 1]:
                torque = factor * np.abs(bounds[actuator]).min()
                cut.append(f"{name} of {robot.joint_name(joint)}'s motor ends at {torque:g} N·m")
    return Answer("none is narrower than its joint's torque limit", cut)


def joint_ranges(robot: RobotFile) -> Answer:
    """Ranges in order, no wider than a turn."""
    model, failures, warnings = robot.model, [], []
    for joint in (joint for joint in robot.hinges if model.jnt_limited[joint]):
        lower, upper = model.jnt_range[joint]
        if not lower < upper:
            failures.append(f"{robot.joint_name(joint)}: {lower:g} … {upper:g} rad")
        elif upper - lower > 2 * math.pi:
            warnings.append(f"{robot.joint_name(joint)}: {upper - lower:.3g} rad, more than a turn; degrees?")
    spans = np.ptp(model.jnt_range[robot.hinges], axis=1)
    return Answer(f"{spans.min():.2g} to {spans.max():.2g} rad wide", failures, warnings)


def home_in_range(robot: RobotFile) -> Answer:
    """The keyframe `home`: finite, a unit quaternion, every joint within its range and not at its end."""
    model, qpos = robot.model, robot.model.key_qpos[robot.id("key", "home")]
    robot.needs_floating_base()
    failures, warnings, margins = [], [], {}
    if not np.isfinite(qpos).all():
        return Answer("", ["home is not finite"])
    if abs(np.linalg.norm(qpos[3:7]) - 1) > 1e-6:
        failures.append(f"quaternion of norm {np.linalg.norm(qpos[3:7]):.4g}")
    for joint in (joint for joint in robot.hinges if model.jnt_limited[joint]):
        angle, (lower, upper) = qpos[model.jnt_qposadr[joint]], model.jnt_range[joint]
        margin = margins[joint] = min(angle - lower, upper - angle)
        words = f"{robot.joint_name(joint)} at {angle:.3g} rad of {lower:g} … {upper:g}"
        if margin < 0:
            failures.append(words)
        elif margin < LEAST_MARGIN:
            warnings.append(f"{words}, at its end")
    least = min(margins, key=margins.__getitem__, default=-1)
    found = f"at least {margins[least]:.2g} rad from an end ({robot.joint_name(least)})" if margins else "no ranges"
    return Answer(found, failures, warnings)


def rotors(robot: RobotFile) -> Answer:
    """Armature and friction: without rotor inertia a light link at 1 kHz is stiff to integrate and to control."""
    model, failures, warnings = robot.model, [], []
    dofs = [int(model.jnt_dofadr[joint]) for joint in robot.hinges]
    for joint, dof in zip(robot.hinges, dofs, strict=True):
        name, values = robot.joint_name(joint), (model.dof_damping[dof], model.dof_frictionloss[dof])
        if min(*values, model.dof_armature[dof]) < 0:
            failures.append(f"{name}: negative armature, damping or friction")
        elif model.dof_armature[dof] == 0:
            warnings.append(f"{name}: no armature")
        elif values[1] > 0.25 * model.jnt_actfrcrange[joint, 1] > 0:
            warnings.append(f"{name}: dry friction {values[1]:.2g} N·m, over a quarter of the torque limit")
    armature = model.dof_armature[dofs]
    found = f"armature {armature.min():g} to {armature.max():g} kg·m², damping to {model.dof_damping[dofs].max():g}"
    return Answer(f"{found} N·m·s/rad, dry friction to {model.dof_frictionloss[dofs].max():g} N·m", failures, warnings)


def speeds(robot: RobotFile) -> Answer:
    """No-load speeds that move a humanoid; [rad/s], not [rev/min]."""
    model = robot.model
    if model.nuser_jnt < 1:
        return Answer("not given: see servos")
    given = {joint: float(model.jnt_user[joint, 0]) for joint in robot.hinges if model.jnt_user[joint, 0] > 0}
    low, high = SPEEDS
    odd = [f"{robot.joint_name(j)}: {speed:g} rad/s" for j, speed in given.items() if not low <= speed <= high]
    values = np.array(list(given.values()) or [math.nan])
    return Answer(f"{values.min():g} to {values.max():g} rad/s", (), odd)


def timestep(robot: RobotFile) -> Answer:
    """The file's own step; scenarios set theirs (`loop.physics_rate`)."""
    step = robot.model.opt.timestep
    words = f"{1e3 * step:g} ms"
    return Answer(words, (), [] if step <= 0.002 else [f"{words}: contacts of light feet need 2 ms or less"])


def physics_options(robot: RobotFile) -> Answer:
    """Nothing of the physics switched off; an integrator, a cone and a solver that suit contacts."""
    option, warnings = robot.model.opt, []
    bits = {n: int(bit) for n, bit in mujoco.mjtDisableBit.__members__.items() if n.startswith("mjDSBL_")}
    off = [f"switched off: {n.removeprefix('mjDSBL_').lower()}" for n, bit in bits.items() if option.disableflags & bit]
    integrator = mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_").lower()
    cone = mujoco.mjtCone(option.cone).name.removeprefix("mjCONE_").lower()
    solver = mujoco.mjtSolver(option.solver).name.removeprefix("mjSOL_").lower()
    if integrator not in ("implicit", "implicitfast"):
        warnings.append(f"integrator {integrator}: damping and friction are stiff, take implicitfast")
    if cone != "elliptic":
        warnings.append(f"cone {cone}: the planner's friction cones are nearer to elliptic ones")
    if solver != "newton":
        warnings.append(f"solver {solver}: newton converges in a few iterations")
    return Answer(f"{integrator}, cone {cone}, solver {solver}, impratio {option.impratio:g}", off, warnings)
