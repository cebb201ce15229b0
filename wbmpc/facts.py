"""The facts that checks need of the true plant, read from the compiled MuJoCo model of robot and world."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np

from wbmpc.checks.context import Facts, LiftedObject
from wbmpc.robot import Robot
from wbmpc.scenario.boxes import ground_boxes
from wbmpc.scenario.consistency import FLOOR
from wbmpc.scenario.patches import PatchPose
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import LiftTask, StepTask
from wbmpc.signals import SIDES, Vector


def facts_of(model: mujoco.MjModel, robot: Robot, scenario: Scenario, patches: Sequence[PatchPose]) -> Facts:
    """Facts of a run.

    Args:
        model: compiled plant, robot and world; its masses are the true ones.
        robot: the controller's robot, for the servos' limits and joint names.
        scenario: what was asked for.
        patches: candidate contacts in world.
    """
    root = int(model.jnt_bodyid[0])  # the contract: joint 0 is the robot's free joint
    foot = np.full(model.ngeom, -1, dtype=np.int64)
    palm = np.full(model.ngeom, -1, dtype=np.int64)
    for side, name in enumerate(SIDES):
        foot[model.geom_bodyid == model.site(f"{name}_sole").bodyid[0]] = side
        palm[model.geom(f"{name}_palm_geom").id] = side
    walkable = {FLOOR, *ground_boxes(scenario)}
    steps = sorted((task for task in scenario.tasks if isinstance(task, StepTask)), key=lambda task: task.start)
    tasks = scenario.tasks
    return Facts(
        duration=scenario.duration,
        timestep=float(model.opt.timestep),
        mass=float(model.body_subtreemass[root]),
        geom_name=tuple(_geom_name(model, geom) for geom in range(model.ngeom)),
        geom_is_robot=model.body_rootid[model.geom_bodyid] == root,
        geom_foot=foot,
        geom_palm=palm,
        geom_walkable=np.array([model.geom(geom).name in walkable for geom in range(model.ngeom)]),
        joint_name=robot.joint_names,
        stall_torque=robot.torque_limit,
        no_load_speed=robot.joint_speed,
        patch_geoms={patch.name: _geoms_of(model, patch.object) for patch in patches},
        patch_normal={patch.name: patch.normal for patch in patches},
        patch_force_cap={patch.name: patch.force_cap for patch in patches},
        lifted_objects=tuple(_lifted_objects(model, scenario)),
        step_targets=tuple((SIDES.index(task.foot), np.array(task.target)) for task in steps),
        go_targets=tuple(np.array(task.target) for task in tasks if task.kind == "go"),
        highest_ground=max((box.bottom + box.size[2] for box in ground_boxes(scenario).values()), default=None),
        reach_targets=tuple(np.array(task.target) for task in tasks if task.kind == "reach"),
        com_heights=tuple((p.time, p.height) for task in tasks if task.kind == "com_height" for p in task.waypoints),
        sole_vertices=_sole_corners(model, robot),
    )


def _lifted_objects(model: mujoco.MjModel, scenario: Scenario) -> Iterator[LiftedObject]:
    for task in scenario.tasks:
        if isinstance(task, LiftTask) and (geoms := _geoms_of(model, task.object)):
            joint = int(model.body(task.object).jntadr[0])
            half = np.array(scenario.world.objects[task.object].size) / 2
            yield LiftedObject(task.object, geoms, int(model.jnt_qposadr[joint]), half)


def _geom_name(model: mujoco.MjModel, geom: int) -> str:
    return str(model.geom(geom).name or model.body(int(model.geom_bodyid[geom])).name or f"geom {geom}")


def _geoms_of(model: mujoco.MjModel, name: str) -> frozenset[int]:
    """Geoms of the world object `name`: empty when the world does not contain it."""
    return frozenset(geom for geom in range(model.ngeom) if model.geom(geom).name == name)


def _sole_corners(model: mujoco.MjModel, robot: Robot) -> Callable[[Vector], Vector]:
    """Function qpos (nq,) -> (2, 4, 3) [m], the corners of both soles in world, front ones first."""
    data = mujoco.MjData(model)
    sites = [model.site(f"{side}_sole").id for side in SIDES]
    half_length, half_width = robot.sole_half_extents
    corners_in_sole = np.array([[x, y, 0.0] for x in (half_length, -half_length) for y in (half_width, -half_width)])

    def corners(qpos: Vector) -> Vector:
        data.qpos[: qpos.size] = qpos
        mujoco.mj_kinematics(model, data)
        rotation = data.site_xmat[sites].reshape(2, 3, 3)
        return np.einsum("sij,kj->ski", rotation, corners_in_sole) + data.site_xpos[sites][:, None]

    return corners
