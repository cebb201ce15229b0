"""Scenario + robot MJCF -> MuJoCo model of the plant.

The robot's file holds the robot and nothing else; floor, objects, light and the unmodelled differences of the plant
are added here. World geoms have the higher `priority`, so that a contact takes its friction and its stiffness from
the world alone and a scenario's number means what it says, whatever the robot's own geoms declare.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from wbmpc.errors import RobotError
from wbmpc.scenario.boxes import all_boxes, ground_boxes
from wbmpc.scenario.consistency import FLOOR
from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.world import Box
from wbmpc.signals import GRAVITY

PICTURE_WIDTH, PICTURE_HEIGHT = 1280, 960  # [pixel] largest off-screen picture
TORSIONAL_FRICTION = 0.005  # [m] radius over which a contact resists turning about its normal
ROLLING_FRICTION = 0.0001  # [m]
CONTACT_DIMENSION = 4  # normal, two tangents, torsion: a palm is a sphere and would spin freely on one point
SOLREF = (0.008, 1.0)  # [s, -] time constant and damping ratio of a contact: stiff enough for < 1 mm under a foot
SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
ALL_LAYERS = 2**31 - 1  # every robot geom that collides with anything collides with the world


def build_world(scenario: Scenario, robot_path: Path) -> mujoco.MjModel:
    """Build the plant of a scenario.

    World geoms are called `floor` and by the names of objects, treads and tiles; objects that are not `present` are
    left out. The physics step is `scenario.loop.timestep`.

    Raises:
        RobotError: MuJoCo cannot read or compile the robot's file.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(robot_path))
        _set_options(spec, scenario)
        _add_scenery(spec)
        _add_floor(spec, scenario)
        _add_objects(spec, scenario)
        model: mujoco.MjModel = spec.compile()
    except ValueError as error:
        raise RobotError(f"{robot_path.name}: MuJoCo refuses the model: {' '.join(str(error).split())}") from None
    _scale_masses(model, scenario)
    return model


def _set_options(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    option = spec.option
    option.timestep = scenario.loop.timestep
    option.gravity = [0.0, 0.0, -GRAVITY]
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10  # friction much harder than the normal direction: stance feet must not creep
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a diverged state must stay visible
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # MuJoCo 4.0.0's sparse Newton solver is said to be wrong


def _add_scenery(spec: mujoco.MjSpec) -> None:
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PICTURE_WIDTH, PICTURE_HEIGHT
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.45] * 3
    spec.visual.rgba.haze = [0.90, 0.93, 0.97, 1.0]
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.86, 0.91, 0.97],
        rgb2=[0.55, 0.66, 0.80],
        width=256,
        height=256,
    )
    spec.add_texture(
        name="ground",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.80, 0.82, 0.84],
        rgb2=[0.76, 0.78, 0.80],
        width=256,
        height=256,
    )
    material = spec.add_material(name="ground", texrepeat=[5, 5], texuniform=True, reflectance=0.03)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"
    spec.worldbody.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.5, -1.0, 3.0],
        dir=[-0.15, 0.35, -1.0],
        diffuse=[0.55, 0.55, 0.52],
        castshadow=True,
    )


def _add_floor(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    _add_geom(
        spec,
        scenario,
        friction=scenario.world.floor.friction,
        name=FLOOR,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.05],  # drawn without end
        material="ground",
    )


def _add_objects(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    """Fixed boxes as geoms of the world, those with a mass as free bodies after the robot."""
    for name, box in _true_boxes(scenario).items():
        if not box.present:
            continue
        pose: dict[str, list[float]] = {
            "pos": list(box.centre),
            "quat": [math.cos(box.yaw / 2), 0, 0, math.sin(box.yaw / 2)],
        }
        body: Any = None
        placed: dict[str, Any] = dict(pose)
        if box.mass is not None:
            body, placed = spec.worldbody.add_body(name=name, **pose), {"mass": box.mass}
            body.add_freejoint(name=f"{name}_free")
            for key in spec.keys:
                key.qpos = [*key.qpos, *pose["pos"], *pose["quat"]]
        _add_geom(
            spec,
            scenario,
            body=body,
            friction=box.friction,
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=np.array(box.size) / 2,
            rgba=box.color,
            **placed,
        )


def _true_boxes(scenario: Scenario) -> dict[str, Box]:
    """The boxes with the ground's errors in them: those that carry feet are taller or shorter than declared."""
    ground, largest = ground_boxes(scenario), scenario.plant.ground_error
    errors = generator(scenario.seed, Stream.GROUND_ERROR).uniform(-largest, largest, len(ground))
    return all_boxes(scenario) | {
        name: box.model_copy(update={"size": (*box.size[:2], box.size[2] + float(error))})
        for (name, box), error in zip(ground.items(), errors, strict=True)
    }


def _add_geom(spec: mujoco.MjSpec, scenario: Scenario, *, friction: float, body: Any = None, **attributes: Any) -> None:
    true_friction = friction if scenario.plant.friction is None else scenario.plant.friction
    (body or spec.worldbody).add_geom(
        priority=1,
        friction=[true_friction, TORSIONAL_FRICTION, ROLLING_FRICTION],
        condim=CONTACT_DIMENSION,
        solref=SOLREF,
        solimp=SOLIMP,
        contype=ALL_LAYERS,
        conaffinity=ALL_LAYERS,
        **attributes,
    )


def _scale_masses(model: mujoco.MjModel, scenario: Scenario) -> None:
    """Scale compiled inertias, so that it does not matter how the robot's file declares them."""
    robot = model.body_rootid == model.jnt_bodyid[0]  # joint 0 is the robot's free joint
    scale = np.where(robot, scenario.plant.mass_scale, 1.0)
    for name, factor in scenario.plant.body_mass_scale.items():
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body >= 0:  # an object that is not present has none
            scale[body] *= factor
    if np.all(scale == 1.0):
        return
    model.body_mass *= scale
    model.body_inertia *= scale[:, None]
    mujoco.mj_setConst(model, mujoco.MjData(model))  # subtree masses and inverse weights follow from the inertias
