"""What feet may stand on besides the floor, in world coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from wbmpc.scenario.boxes import ground_boxes
from wbmpc.scenario.obstacles import footprint
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.signals import Vector


@dataclass(frozen=True, slots=True, eq=False)
class Tread:
    """The top of a walkable box, as the planner sees it."""

    corners: Vector  # (4, 2) [m] counter-clockwise
    top: float  # [m]


def resolve_ground(scenario: Scenario) -> tuple[Tread, ...]:
    """All walkable boxes of a scenario, whether or not they are present, in the file's order; then treads and tiles."""
    return tuple(Tread(corners=footprint(box), top=box.bottom + box.size[2]) for box in ground_boxes(scenario).values())
