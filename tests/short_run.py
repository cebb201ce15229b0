"""Short runs of the repository's scenarios, for tests of the parts that only mean something in a closed loop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco

from wbmpc.loop import Session, run_lockstep
from wbmpc.plant import Plant
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world, load_scenario, robot_path
from wbmpc.timing import LoopTiming

ROOT = Path(__file__).parents[1]
ROBOT = Robot.load(ROOT / "models" / "surena_mini.xml")


def stand(*, duration: float = 1.0, **changes: Any) -> Scenario:
    """`scenarios/stand.yaml` with other values; a dot of a path is written as two underscores."""
    return short("stand", duration=duration, **changes)


def short(name: str, *, duration: float, **changes: Any) -> Scenario:
    overrides = {path.replace("__", "."): value for path, value in changes.items()}
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", overrides)
    return scenario.model_copy(update={"duration": duration})  # a file may not ask for less than one horizon


def new_recorder(scenario: Scenario, model: mujoco.MjModel | None = None) -> Recorder:
    model = model or build_world(scenario, robot_path(scenario))
    ticks = round(scenario.duration * scenario.loop.physics_rate)
    return Recorder(ROBOT, expected_ticks=ticks, plant_nq=model.nq, plant_nv=model.nv)


def finished(
    scenario: Scenario, *, run: Callable[..., LoopTiming] = run_lockstep, **arguments: Any
) -> tuple[LoopTiming, Recorder]:
    """The scenario run to its end."""
    model = build_world(scenario, robot_path(scenario))
    recorder = new_recorder(scenario, model)
    return run(scenario, robot=ROBOT, recorder=recorder, model=model, **arguments), recorder


def new_session(scenario: Scenario) -> tuple[Session, Recorder]:
    model = build_world(scenario, robot_path(scenario))
    recorder = new_recorder(scenario, model)
    return Session(scenario, robot=ROBOT, model=model, recorder=recorder), recorder


def new_plant(scenario: Scenario, *, seed: int = 0, height: float = 0.0, velocity: Any = 0.0) -> Plant:
    """The plant alone: the robot at home, `height` [m] above the floor, with the given MuJoCo velocity (nv,)."""
    model = build_world(scenario, robot_path(scenario))
    qpos = ROBOT.qpos_from_q(ROBOT.home_q)
    qpos[2] += height
    plant = Plant(
        model, ROBOT, disturbances=scenario.disturbances, sensors=scenario.sensors, qpos=qpos, seed=seed
    )  # fmt: skip
    plant.data.qvel[:] = velocity
    mujoco.mj_step1(model, plant.data)  # what depends on the velocity, as after a step
    return plant
