"""Left and right limbs as mirror images in the base's x-z plane at zero angles, whatever frames the links have."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import mujoco
import numpy as np

from wbmpc.doctor.check import Answer, Check
from wbmpc.doctor.robot.subject import RobotFile
from wbmpc.signals import Vector

LENGTH = 1e-6  # [m]
RELATIVE = 1e-6
MIRROR = np.array([1.0, -1.0, 1.0])


def limbs(robot: RobotFile, *, site: str, above: str) -> Answer:
    """Masses, CoMs, inertias, joint places, axes, ranges and servos of the chains to `left_SITE` and `right_SITE`."""
    body = robot.base if above == "base" else robot.id("body", above)
    left, right = (robot.chain(place, above=body) for place in robot.pair("site", site))
    pairs = list(zip(robot.joints_of(left), robot.joints_of(right), strict=False))
    joints = [len(robot.joints_of(chain)) for chain in (left, right)]
    if len(left) != len(right) or joints[0] != joints[1]:
        return Answer("", (), [f"left: {len(left)} links, {joints[0]} joints; right: {len(right)}, {joints[1]}"])
    zero = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, zero)
    differences = [
        *(words for pair in zip(left, right, strict=True) for words in _links(robot, zero, *pair)),
        *(words for pair in pairs for words in _joints(robot, zero, *pair)),
    ]
    left_end, right_end = (_seen(robot, zero, zero.site_xpos[place]) for place in robot.pair("site", site))
    if np.abs(right_end - MIRROR * left_end).max() > LENGTH:
        differences.append(f"sites {site}: left at {_place(left_end)}, right at {_place(right_end)} m")
    mass = float(robot.model.body_mass[left].sum())
    return Answer(f"{joints[0]} joints, {mass:.3g} kg a side: mirror images", (), differences)


def symmetry(name: str, *, site: str, above: str) -> Check[RobotFile]:
    """The check of one pair of limbs."""
    hint = (
        "a robot may be lopsided, but mostly a sign or a digit is wrong on one side: y, roll and yaw change their signs"
    )
    return Check(name, partial(limbs, site=site, above=above), hint)


def _links(robot: RobotFile, zero: mujoco.MjData, left: int, right: int) -> Iterator[str]:
    model, name = robot.model, f"{robot.body_name(left)} / {robot.body_name(right)}"
    masses = model.body_mass[[left, right]]
    if abs(masses[0] - masses[1]) > RELATIVE * masses.max():
        yield f"{name}: {masses[0]:g} / {masses[1]:g} kg"
    places = [_seen(robot, zero, zero.xipos[body]) for body in (left, right)]
    if np.abs(places[1] - MIRROR * places[0]).max() > LENGTH:
        yield f"{name}: CoM at {_place(places[0])} / {_place(places[1])} m"
    first, second = (_inertia(robot, zero, body) for body in (left, right))
    if np.abs(second - np.outer(MIRROR, MIRROR) * first).max() > RELATIVE * np.abs(first).max():
        yield f"{name}: inertias differ"


def _joints(robot: RobotFile, zero: mujoco.MjData, left: int, right: int) -> Iterator[str]:
    model, name = robot.model, f"{robot.joint_name(left)} / {robot.joint_name(right)}"
    places = [_seen(robot, zero, zero.xanchor[joint]) for joint in (left, right)]
    if np.abs(places[1] - MIRROR * places[0]).max() > LENGTH:
        yield f"{name}: at {_place(places[0])} / {_place(places[1])} m"
    turn = zero.xmat[robot.base].reshape(3, 3).T
    axes = [turn @ zero.xaxis[joint] for joint in (left, right)]
    along = float(axes[1] @ (-MIRROR * axes[0]))  # an axis is a pseudovector
    if abs(abs(along) - 1) > RELATIVE:
        yield f"{name}: axes {_place(axes[0])} / {_place(axes[1])}"
        return
    mirrored = np.sort(np.sign(along) * model.jnt_range[left])
    if np.abs(mirrored - model.jnt_range[right]).max() > RELATIVE:
        (a, b), (c, d) = model.jnt_range[left], model.jnt_range[right]
        yield f"{name}: ranges {a:g} … {b:g} / {c:g} … {d:g} rad"
    dofs = [int(model.jnt_dofadr[joint]) for joint in (left, right)]
    values = {"torque limits": model.jnt_actfrcrange[[left, right], 1], "armatures": model.dof_armature[dofs]}
    if model.nuser_jnt:
        values["no-load speeds"] = model.jnt_user[[left, right], 0]
    for what, (one, other) in values.items():
        if abs(one - other) > RELATIVE * max(abs(one), abs(other)):
            yield f"{name}: {what} {one:g} / {other:g}"


def _seen(robot: RobotFile, zero: mujoco.MjData, position: Vector) -> Vector:
    """(3,) [m] in the base."""
    return np.asarray(zero.xmat[robot.base].reshape(3, 3).T @ (position - zero.xpos[robot.base]))


def _inertia(robot: RobotFile, zero: mujoco.MjData, body: int) -> Vector:
    """(3, 3) [kg·m²] about the link's CoM, in the base's axes."""
    turn = zero.xmat[robot.base].reshape(3, 3).T @ zero.ximat[body].reshape(3, 3)
    return np.asarray(turn @ np.diag(robot.model.body_inertia[body]) @ turn.T)


def _place(vector: Vector) -> str:
    return f"({', '.join(f'{value:.4g}' for value in np.round(vector, 9) + 0.0)})"
