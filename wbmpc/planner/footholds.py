"""Where a foot may be put, how high that is, and what it must clear on its way there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbmpc.planner.support import convex_hull, foot_corners
from wbmpc.scenario import Obstacle, Tread
from wbmpc.signals import Vector

MARGIN = 0.012  # [m] kept between a sole and an obstacle
REACH_UP = 0.10  # [m] obstacles that begin higher are not in a foot's way; those that end higher cannot be stepped over
LEVEL = 0.002  # [m] steps up or down that are none
CLEARANCE = 0.025  # [m] of a swing foot over what it steps over


class Footholds:
    """Obstacles and treads as the feet see them; where there is neither, there is the floor."""

    def __init__(
        self, obstacles: tuple[Obstacle, ...], half_extents: Vector, *, ground: tuple[Tread, ...] = ()
    ) -> None:
        """`half_extents` (2,) of a sole [m]."""
        self._obstacles = _Things([o for o in obstacles if o.bottom < REACH_UP])
        self._ground = _Things(ground)
        self._sole, self._half = half_extents, half_extents + MARGIN

    def free(self, position: Vector, yaw: float) -> bool:
        """Whether a sole with its centre at `position` (2,) [m] stands clear of every obstacle."""
        sole = foot_corners(position=position, yaw=yaw, half_extents=self._half)
        level = self._level(sole)
        return level is not None and not self._obstacles.under(sole)

    def height(self, position: Vector, yaw: float, *, otherwise: float) -> float:
        """Height of the ground [m] under a sole with its centre at `position` (2,) [m]; `otherwise` over an edge."""
        level = self._level(foot_corners(position=position, yaw=yaw, half_extents=self._sole))
        return otherwise if level is None else level

    def _level(self, sole: Vector) -> float | None:
        """Height [m] of the tread, or floor, that carries a sole (4, 2) [m] as a whole; None over an edge."""
        under = self._ground.under(sole)
        if not under:
            return 0.0
        highest = max(under, key=lambda tread: tread.top)
        return highest.top if _inside(sole, highest.corners) else None

    def crossed(self, start: Vector, end: Vector, yaw: float, *, lowest: float = 0.0) -> float | None:
        """Height to lift a sole by on its straight way from `start` to `end` (2,) [m]: 0 when nothing is in the way.

        `lowest` [m]: the lower one of the heights of both ends, over which the height counts.

        None: something is too high to step over. Where a foot has landed it may stand closer than the margin to what it
        leaves: that is no longer in its way.
        """
        sides = ((start, self._sole), (end, self._half))
        swept = convex_hull(np.vstack([foot_corners(position=p, yaw=yaw, half_extents=half) for p, half in sides]))
        tops = [thing.top - lowest for thing in [*self._obstacles.under(swept), *self._ground.under(swept)]]
        tops = [top for top in tops if top > LEVEL]
        if any(top > REACH_UP for top in tops):
            return None
        return max(tops) + CLEARANCE if tops else 0.0


class _Things:
    """Things on the floor, found by where they are."""

    def __init__(self, things: Sequence[Obstacle | Tread]) -> None:
        self._things = things
        corners = np.array([thing.corners for thing in things]).reshape(-1, 4, 2)
        self._lower, self._upper = corners.min(axis=1), corners.max(axis=1)  # (n, 2) [m]

    def under(self, polygon: Vector) -> list[Obstacle | Tread]:
        """Those whose footprints overlap a convex `polygon` (k, 2) [m], counter-clockwise."""
        apart = (self._lower >= polygon.max(axis=0)) | (self._upper <= polygon.min(axis=0))
        near = np.flatnonzero(~apart.any(axis=1)).tolist()  # most are far away; the exact test takes its time
        return [self._things[i] for i in near if _overlap(polygon, self._things[i].corners)]


def _inside(inner: Vector, outer: Vector) -> bool:
    """Whether all points (n, 2) are in a convex polygon (k, 2), counter-clockwise."""
    edges = np.roll(outer, -1, axis=0) - outer
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    return bool((inner @ normals.T <= np.einsum("ki,ki->k", normals, outer) + 1e-9).all())


def _overlap(a: Vector, b: Vector) -> bool:
    """Whether two convex polygons (n, 2), counter-clockwise, overlap (separating axes)."""
    for polygon in (a, b):
        edges = np.roll(polygon, -1, axis=0) - polygon
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        for normal in normals:
            along_a, along_b = a @ normal, b @ normal
            if along_a.max() <= along_b.min() or along_b.max() <= along_a.min():
                return False
    return True
