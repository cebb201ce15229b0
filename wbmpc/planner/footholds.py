"""Where a foot may be put and what it must clear on its way: footprints against the obstacles on the floor."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.support import convex_hull, foot_corners
from wbmpc.scenario import Obstacle
from wbmpc.signals import Vector

MARGIN = 0.012  # [m] kept between a sole and an obstacle
REACH_UP = 0.10  # [m] obstacles that begin higher are not in a foot's way; those that end higher cannot be stepped over
CLEARANCE = 0.025  # [m] of a swing foot over what it steps over


class Footholds:
    """The obstacles as the feet see them."""

    def __init__(self, obstacles: tuple[Obstacle, ...], half_extents: Vector) -> None:
        """`half_extents` (2,) of a sole [m]."""
        self._low = [o for o in obstacles if o.bottom < REACH_UP]
        self._sole, self._half = half_extents, half_extents + MARGIN

    def free(self, position: Vector, yaw: float) -> bool:
        """Whether a sole with its centre at `position` (2,) [m] stands clear of every obstacle."""
        sole = foot_corners(position=position, yaw=yaw, half_extents=self._half)
        return not any(_overlap(sole, obstacle.corners) for obstacle in self._low)

    def crossed(self, start: Vector, end: Vector, yaw: float) -> float | None:
        """Height to lift a sole by on its straight way from `start` to `end` (2,) [m]: 0 when nothing is in the way.

        None: something is too high to step over. Where a foot has landed it may stand closer than the margin to what it
        leaves: that is no longer in its way.
        """
        sides = ((start, self._sole), (end, self._half))
        swept = convex_hull(np.vstack([foot_corners(position=p, yaw=yaw, half_extents=half) for p, half in sides]))
        tops = [obstacle.top for obstacle in self._low if _overlap(swept, obstacle.corners)]
        if any(top > REACH_UP for top in tops):
            return None
        return max(tops) + CLEARANCE if tops else 0.0


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
