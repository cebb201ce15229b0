"""All boxes of a scenario: those declared by name, then the tiles, whose heights the seed draws."""

from __future__ import annotations

from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.world import Box, Tiles


def all_boxes(scenario: Scenario) -> dict[str, Box]:
    """Boxes by name as the controller is told of them, whether or not they are present."""
    tiles = scenario.world.tiles
    return {**scenario.world.objects, **(_tile_boxes(tiles, scenario.seed) if tiles else {})}


def ground_boxes(scenario: Scenario) -> dict[str, Box]:
    """The boxes that feet may stand on."""
    return {name: box for name, box in all_boxes(scenario).items() if box.walkable and box.mass is None}


def tile_names(tiles: Tiles) -> list[str]:
    """Names of all tiles, `tile_COLUMN_ROW`, counted along x and y from the field's corner where both are smallest."""
    return [f"tile_{column}_{row}" for column, row in _cells(tiles)]


def _cells(tiles: Tiles) -> list[tuple[int, int]]:
    columns, rows = tiles.count
    return [(column, row) for column in range(columns) for row in range(rows)]


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
