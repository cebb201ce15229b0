"""What the robot is asked to lift, in world coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import LiftTask
from wbmpc.signals import Vector


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A box to be lifted, as the planner is told of it before it is touched."""

    task: LiftTask
    centre: Vector  # (3,) [m]
    half: Vector  # (3,) [m] half edge lengths
    yaw: float  # [rad]
    mass: float  # [kg]


def resolve_loads(scenario: Scenario) -> tuple[Load, ...]:
    """The objects of a valid scenario's lift tasks, whether or not they are present."""
    loads = []
    for task in scenario.tasks:
        if isinstance(task, LiftTask):
            box = scenario.world.objects[task.object]
            assert box.mass is not None  # a valid scenario lifts what can be lifted
            loads.append(Load(task, np.array(box.centre), np.array(box.size) / 2, box.yaw, box.mass))
    return tuple(loads)
