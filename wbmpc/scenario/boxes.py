"""All boxes of a scenario: those declared by name, a staircase's treads, and tiles whose heights the seed draws."""

from __future__ import annotations

import math

from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.world import Box, Staircase, Tiles, World


def all_boxes(scenario: Scenario) -> dict[str, Box]:
    """Boxes by name as the controller is told of them, whether or not they are present."""
    world = scenario.world
    treads = _tread_boxes(world.staircase) if world.staircase else {}
    tiles = _tile_boxes(world.tiles, scenario.seed) if world.tiles else {}
    return {**world.objects, **treads, **tiles}


def ground_boxes(scenario: Scenario) -> dict[str, Box]:
    """The boxes that feet may stand on."""
    return {name: box for name, box in all_boxes(scenario).items() if box.walkable and box.mass is None}


def tread_names(staircase: Staircase) -> list[str]:
    """Names of a staircase's treads, `tread_NUMBER`, in the order in which they are walked on."""
    return [f"tread_{number}" for number in range(staircase.count)]


def tile_names(tiles: Tiles) -> list[str]:
    """Names of all tiles, `tile_COLUMN_ROW`, counted along x and y from the field's corner where both are smallest."""
    return [f"tile_{column}_{row}" for column, row in _cells(tiles)]


def made_names(world: World) -> dict[str, str]:
    """Names of the boxes that nobody declares one by one, and the key of `world` that makes each."""
    names = dict.fromkeys(tread_names(world.staircase), "staircase") if world.staircase else {}
    return names | (dict.fromkeys(tile_names(world.tiles), "tiles") if world.tiles else {})


def _cells(tiles: Tiles) -> list[tuple[int, int]]:
    columns, rows = tiles.count
    return [(column, row) for column in range(columns) for row in range(rows)]


def _tread_boxes(staircase: Staircase) -> dict[str, Box]:
    boxes, edge = {}, 0.0  # [m] from the staircase's beginning
    for number, name in enumerate(tread_names(staircase)):
        level = min(number + 1, staircase.count - number) if staircase.down else number + 1
        length = staircase.landing if level == staircase.steps else staircase.depth
        ahead, edge = edge + length / 2, edge + length
        boxes[name] = Box(
            kind="box",
            size=(length, staircase.width, level * staircase.rise),
            position=(
                staircase.position[0] + ahead * math.cos(staircase.yaw),
                staircase.position[1] + ahead * math.sin(staircase.yaw),
            ),
            yaw=staircase.yaw,
            friction=staircase.friction,
            walkable=True,
            color=staircase.color,
        )
    return boxes


def _tile_boxes(tiles: Tiles, seed: int) -> dict[str, Box]:
    shares = generator(seed, Stream.TILES).random(tiles.count)  # of the way from the lowest to the highest
    names = zip(tile_names(tiles), _cells(tiles), strict=True)
    return {name: _tile(tiles, cell, float(shares[cell])) for name, cell in names}


def _tile(tiles: Tiles, cell: tuple[int, int], share: float) -> Box:
    x, y = (tiles.position[i] + (cell[i] - (tiles.count[i] - 1) / 2) * tiles.size[i] for i in (0, 1))
    red, green, blue, opacity = (
        low + share * (high - low) for low, high in zip(tiles.lowest_color, tiles.highest_color, strict=True)
    )
    return Box(
        kind="box",
        size=(*tiles.size, tiles.lowest + share * (tiles.highest - tiles.lowest)),
        position=(x, y),
        friction=tiles.friction,
        walkable=True,
        color=(red, green, blue, opacity),
    )
