"""What stands in the way of the feet, in world coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import LiftTask
from wbmpc.scenario.schema.world import Box
from wbmpc.signals import Vector


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A box that no foot may be put on and no free arm may touch, as the planner sees it."""

    centre: Vector  # (3,) [m]
    half: Vector  # (3,) [m] half edge lengths
    yaw: float  # [rad]
    corners: Vector  # (4, 2) [m] of its footprint, counter-clockwise
    bottom: float  # [m]
    top: float  # [m]


def resolve_obstacles(scenario: Scenario) -> tuple[Obstacle, ...]:
    """Boxes that are neither walkable nor to be lifted, whether or not they are present, in the order of the file.

    Treads and tiles are walkable, none of them is an obstacle.
    """
    lifted = {task.object for task in scenario.tasks if isinstance(task, LiftTask)}
    return tuple(
        Obstacle(
            centre=np.array(box.centre),
            half=np.array(box.size) / 2,
            yaw=box.yaw,
            corners=footprint(box),
            bottom=box.bottom,
            top=box.bottom + box.size[2],
        )
        for name, box in scenario.world.objects.items()
        if not box.walkable and name not in lifted
    )


def footprint(box: Box) -> Vector:
    """Corners (4, 2) [m] of a box seen from above, in world, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    return np.array(box.position) + (signs * np.array(box.size[:2]) / 2) @ np.array([[c, s], [-s, c]])
