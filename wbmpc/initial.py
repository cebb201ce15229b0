"""Where the robot is when a run begins."""

from __future__ import annotations

import mujoco
import numpy as np

from wbmpc.errors import Problem, ScenarioError
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario
from wbmpc.scenario.consistency import FLOOR
from wbmpc.signals import Vector

DEEPEST = 0.001  # [m] in a thing of the world: more is no touch


def initial_posture(scenario: Scenario, robot: Robot, model: mujoco.MjModel) -> Vector:
    """MuJoCo configuration (nq,) at the start: the keyframe, the scenario's joints, the soles on the floor, objects.

    Raises:
        ScenarioError: there the robot is inside of an object.
    """
    qpos = model.key(scenario.initial.keyframe).qpos.copy()
    for name, angle in scenario.initial.joints.items():
        qpos[7 + robot.joint_index(name)] = angle
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    qpos[2] -= min(data.site(f"{side}_sole").xpos[2] for side in ("left", "right"))
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    robot_root = model.jnt_bodyid[0]
    for contact in data.contact:
        mine = model.body_rootid[model.geom_bodyid[contact.geom]] == robot_root  # (2,)
        if contact.dist < -DEEPEST and mine.sum() == 1:
            part, thing = (model.geom(int(contact.geom[int(np.argmax(mine == own))])) for own in (True, False))
            if thing.name == FLOOR:  # a foot that is not level
                continue
            message = (
                f"the robot starts inside '{thing.name}': its {part.name} is {-1e3 * contact.dist:.0f} mm deep in it"
            )
            raise ScenarioError([Problem(str(scenario.source), message)])
    return qpos
