"""The `world:` and `patches:` blocks: what exists around the robot, and where a hand could brace."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from wbmpc.strict import Fraction, Friction, Identifier, NonNegative, Positive, StrictModel, Vector2

Face = Literal["top", "bottom", "front", "back", "left", "right"]
Colour = tuple[Fraction, Fraction, Fraction, Fraction]
TileCount = Annotated[int, Field(ge=1, le=50)]  # the planner looks at every tile for every foothold


class Floor(StrictModel):
    """The floor: the plane z = 0."""

    friction: Friction = Field(default=0.8, description="Coulomb friction coefficient [-].")


class Box(StrictModel):
    """A box, fixed or free. It is placed by its underside, so that changing `size.2` alone makes a table higher."""

    kind: Literal["box"] = Field(description="A box: table, wall, step, or with a mass a thing to carry.")
    size: tuple[Positive, Positive, Positive] = Field(description="Edge lengths along the box's own x, y, z [m].")
    position: Vector2 = Field(description="Centre of the box in the horizontal plane: world x, y [m].")
    bottom: NonNegative = Field(default=0.0, description="Height of the underside above the floor [m].")
    yaw: float = Field(default=0.0, description="Rotation about the world's z axis [rad].")
    friction: Friction = Field(default=0.8, description="Coulomb friction coefficient [-].")
    walkable: bool = Field(
        default=False, description="Whether the robot may stand on it: elsewhere a foot may touch the floor only."
    )
    mass: Positive | None = Field(
        default=None, description="Mass of a box that may be moved, as the controller is told [kg]; null: it is fixed."
    )
    color: Colour = Field(default=(0.72, 0.53, 0.35, 1.0), description="Red, green, blue, opacity, each 0 to 1 [-].")
    present: bool = Field(
        default=True,
        description="false: the planner still believes in the box and its patches, but the world does not contain it.",
    )

    @property
    def centre(self) -> tuple[float, float, float]:
        """Centre of the box in world [m]."""
        return (self.position[0], self.position[1], self.bottom + self.size[2] / 2)


# One kind only for now: a second one makes this `Annotated[Box | Other, Field(discriminator="kind")]`.
WorldObject = Box


class Tiles(StrictModel):
    """A field of walkable tiles side by side on the floor, of random heights that the planner knows.

    They are fixed boxes called `tile_COLUMN_ROW`, counted from 0 along x and y. Columns run along x, rows along y.
    """

    position: Vector2 = Field(description="Centre of the field in the horizontal plane: world x, y [m].")
    count: tuple[TileCount, TileCount] = Field(description="Columns along x, rows along y [-].")
    size: tuple[Positive, Positive] = Field(description="Edge lengths of one tile along x, y [m].")
    lowest: Positive = Field(description="Tops are drawn uniformly, with the scenario's seed, from this height on [m].")
    highest: Positive = Field(description="Up to this height above the floor [m].")
    friction: Friction = Field(default=0.8, description="Coulomb friction coefficient [-].")
    lowest_color: Colour = Field(
        default=(0.36, 0.45, 0.58, 1.0), description="Of a tile of height `lowest`; shades in between, 0 to 1 [-]."
    )
    highest_color: Colour = Field(
        default=(0.95, 0.88, 0.70, 1.0), description="Of a tile of height `highest`, 0 to 1 [-]."
    )


class Staircase(StrictModel):
    """Steps up to a landing and down again on its other side: walkable fixed boxes called `tread_NUMBER`, from 0."""

    position: Vector2 = Field(description="Middle of the first edge in the horizontal plane: world x, y [m].")
    yaw: float = Field(default=0.0, description="Direction in which it goes up, about the world's z axis [rad].")
    steps: Annotated[int, Field(ge=1, le=20)] = Field(description="Steps up, the landing is the last one [-].")
    rise: Positive = Field(description="Height of one step [m].")
    depth: Positive = Field(description="Length of one tread [m].")
    landing: Positive = Field(description="Length of the landing [m].")
    width: Positive = Field(description="Width of all treads [m].")
    down: bool = Field(default=True, description="Whether as many steps lead down again.")
    friction: Friction = Field(default=0.8, description="Coulomb friction coefficient [-].")
    color: Colour = Field(default=(0.72, 0.53, 0.35, 1.0), description="Red, green, blue, opacity, each 0 to 1 [-].")

    @property
    def count(self) -> int:
        """Treads in all, the landing included."""
        return 2 * self.steps - 1 if self.down else self.steps


class World(StrictModel):
    """Everything around the robot."""

    floor: Floor = Field(default=Floor(), description="The floor, z = 0.")
    objects: dict[Identifier, WorldObject] = Field(default={}, description="Objects by name.")
    staircase: Staircase | None = Field(default=None, description="Steps up and down; null: none.")
    tiles: Tiles | None = Field(default=None, description="Tiles of random heights; null: none.")


class Patch(StrictModel):
    """A place on an object where a palm could press: a candidate for stage 3, never a command to use it.

    `offset` runs along two of the box's own axes: (x, y) on top and bottom, (y, z) on front (+x) and back (−x),
    (x, z) on left (+y) and right (−y).
    """

    on: str = Field(min_length=1, description="Name of the object.")
    face: Face = Field(
        default="top", description="Face in the object's own frame: front +x, back −x, left +y, right −y, top +z."
    )
    offset: Vector2 = Field(default=(0.0, 0.0), description="From the face's centre, along the face's two axes [m].")
    friction: Friction = Field(default=0.4, description="Friction coefficient that the planner counts on [-].")
    force_cap: Positive = Field(default=15.0, description="Largest normal force that the planner may ask for [N].")
