"""What free arms must not touch: half-spaces in front of the nearest obstacles."""

from __future__ import annotations

import numpy as np

from wbmpc.scenario import Obstacle
from wbmpc.signals import Vector

NEAR = 0.12  # [m] obstacles farther than this from a point are left alone
DISTANCE = 0.025  # [m] kept between an obstacle and the axis of an arm


def keep_out(points: Vector, obstacles: tuple[Obstacle, ...]) -> Vector:
    """Half-spaces (n, 4): a point x of row (a, b) should keep a·x ≥ b; b is -inf when no obstacle is near.

    `points` (n, 3) in world [m]. Each row belongs to the obstacle nearest to its point, a is the direction away from
    it; for a point inside, out of its nearest vertical face or its top.
    """
    rows = np.zeros((len(points), 4))
    rows[:, 3] = -np.inf
    for row, point in zip(rows, points, strict=True):
        least = NEAR
        for obstacle in obstacles:
            c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
            to_world = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            inside = (point - obstacle.centre) @ to_world  # in the box
            gap = np.abs(inside) - obstacle.half
            if gap.max() >= least:
                continue
            away = np.maximum(gap, 0.0) * np.sign(inside)
            distance = float(np.linalg.norm(away))
            if distance == 0.0:
                axis = int(np.argmax(gap))
                away[axis] = np.sign(inside[axis]) or 1.0
                distance = float(gap[axis])
                direction = to_world @ away
            else:
                direction = to_world @ (away / distance)
            if distance < least:
                least = distance
                row[:3], row[3] = direction, direction @ point - distance + DISTANCE
    return rows
