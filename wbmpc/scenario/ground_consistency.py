"""What no single key of the ground can say: tiles and treads against objects, heights against their errors."""

from __future__ import annotations

from collections.abc import Iterator

from wbmpc.scenario.boxes import made_names
from wbmpc.scenario.diagnosis import Finding
from wbmpc.scenario.schema.scenario import Scenario


def find_ground_inconsistencies(scenario: Scenario) -> Iterator[Finding]:
    """Every contradiction within the tiles, of tiles or treads with the objects, and of heights with their error."""
    world, error = scenario.world, scenario.plant.ground_error
    heights = {name: box.size[2] for name, box in world.objects.items() if box.walkable and box.mass is None}
    if world.tiles is not None:
        lowest, highest = world.tiles.lowest, world.tiles.highest
        if highest < lowest:
            message = f"must not be less than lowest ({lowest:g} m), got {highest:g} m"
            yield Finding(("world", "tiles", "highest"), message)
        heights["the lowest tile"] = lowest  # whatever the seed draws: a scenario is valid with every seed
    for name, key in made_names(world).items():
        if name in world.objects:
            message = f"the name '{name}' is taken by one of world.{key}"
            yield Finding(("world", "objects", name), message, at_key=True)
    if world.staircase is not None:
        heights["the lowest tread"] = world.staircase.rise
    if heights and error >= min(heights.values()):
        name = min(heights, key=lambda name: heights[name])
        message = f"must be less than the height of the lowest walkable object ({name}, {heights[name]:g} m)"
        yield Finding(("plant", "ground_error"), f"{message}, got {error:g} m")
