"""Where a foot may be put, how high that is, and what it must clear on its way there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, TypeVar

import numpy as np

from wbmpc.planner.footprint_kernel import is_inside, swept, things_under
from wbmpc.planner.support import UNEVEN, foot_corners
from wbmpc.scenario import Obstacle, Tread
from wbmpc.signals import Vector

MARGIN, EDGE_MARGIN = 0.012, 0.006  # [m] kept between a sole and an obstacle, and the edge of what carries it
REACH_UP = 0.10  # [m] obstacles that begin higher are not in a foot's way; those that end higher cannot be stepped over
LEVEL = 0.002  # [m] steps up or down that are none
CLEARANCE = 0.025  # [m] of a swing foot over what it steps over

Thing = TypeVar("Thing", bound=Obstacle | Tread)


class Footholds:
    """Obstacles and treads as the feet see them; where there is neither, there is the floor."""

    def __init__(
        self, obstacles: tuple[Obstacle, ...], half_extents: Vector, *, ground: tuple[Tread, ...] = ()
    ) -> None:
        """`half_extents` (2,) of a sole [m]."""
        self._obstacles: _Footprints[Obstacle] = _Footprints(obstacles)
        self._ground: _Footprints[Tread] = _Footprints(ground)
        self._sole = half_extents.copy()  # one that may be written to, as the kernels know it
        nowhere = np.zeros(2)  # compiled here: the first search is in the middle of a run
        self.free(nowhere, 0.0)
        outline = self._swept(nowhere, nowhere, 0.0, 0.0)
        is_inside(outline, outline)
        things_under(outline, np.zeros((0, 4, 2)))

    def free(self, position: Vector, yaw: float) -> bool:
        """Whether a sole with its centre at `position` (2,) [m] is carried as a whole and clear of every obstacle."""
        carried, clear = (
            foot_corners(position=position, yaw=yaw, half_extents=self._sole + margin)
            for margin in (EDGE_MARGIN, MARGIN)
        )
        level = self._level(carried)
        return level is not None and not self._in_way(clear, level)

    def height(self, position: Vector, yaw: float) -> float | None:
        """Height of the ground [m] under a sole with its centre at `position` (2,) [m]; None over an edge."""
        return self._level(foot_corners(position=position, yaw=yaw, half_extents=self._sole))

    def on_ground(self, place: Vector, yaw: float, *, stance: float, own: float | None) -> Vector:
        """(3,) [m] a sole's centre at `place` (2,): as high as the ground is said to be there.

        On the level that carries the other foot, and over an edge, it is as high as that one.

        Args:
            stance: measured height of the other foot [m].
            own: what its `height` is said to be [m].
        """
        level = self.height(place, yaw)
        if level is None or level == own or (own is None and abs(level - stance) < UNEVEN):
            level = stance
        return np.array([*place, level])

    def _level(self, sole: Vector) -> float | None:
        """Height [m] of the tread, or floor, that carries a sole (4, 2) [m] as a whole; None over an edge."""
        under = self._ground.under(sole)
        if not under:
            return 0.0
        highest = max(under, key=lambda tread: tread.top)
        return highest.top if is_inside(sole, highest.corners) else None

    def obstructed(self, start: Vector, end: Vector, yaw: float, *, lowest: float) -> bool:
        """Whether an obstacle is in a sole's straight way from `start` to `end` (2,) [m], or too near to its end.

        `lowest` [m]: the lower one of the heights of both ends.
        """
        return bool(self._in_way(self._swept(start, end, yaw, MARGIN), lowest))

    def _in_way(self, polygon: Vector, lowest: float) -> list[Obstacle]:
        """The obstacles that a foot over `polygon` (k, 2) [m] meets, not those over its head or under the ground."""
        return [o for o in self._obstacles.under(polygon) if o.bottom - lowest < REACH_UP and o.top > lowest]

    def crossed(self, start: Vector, end: Vector, yaw: float, *, lowest: float = 0.0) -> float | None:
        """Height to lift a sole by on its straight way from `start` to `end` (2,) [m]: 0 when nothing is in the way.

        `lowest` [m]: the lower one of the heights of both ends, over which the height counts.

        None: something is too high to step over. Where a foot has landed it may stand closer than the margin to what it
        leaves: that is no longer in its way.
        """
        treads = self._ground.under(self._swept(start, end, yaw, EDGE_MARGIN))
        tops = [tread.top - lowest for tread in treads if tread.top - lowest > LEVEL]
        tops += [o.top - lowest for o in self._in_way(self._swept(start, end, yaw, MARGIN), lowest)]
        if any(top > REACH_UP for top in tops):
            return None
        return max(tops) + CLEARANCE if tops else 0.0

    def _swept(self, start: Vector, end: Vector, yaw: float, margin: float) -> Vector:
        """Outline (k, 2) [m] of a sole's way, with a `margin` [m] at its end: where it is, it stands already."""
        return swept(start, end, yaw, self._sole, margin)


class _Footprints(Generic[Thing]):
    """Things on the floor, found by where they are."""

    def __init__(self, things: Sequence[Thing]) -> None:
        self._things = things
        self._corners = np.array([thing.corners for thing in things]).reshape(-1, 4, 2)  # [m]

    def under(self, polygon: Vector) -> list[Thing]:
        """Those whose footprints overlap a convex `polygon` (k, 2) [m], counter-clockwise."""
        return [self._things[i] for i in things_under(polygon, self._corners)] if self._things else []
