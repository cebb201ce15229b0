"""What free arms must not touch: half-spaces in front of the nearest obstacles."""

from __future__ import annotations

import numpy as np

from wbmpc.scenario import Obstacle
from wbmpc.signals import Vector

NEAR = 0.12  # [m] obstacles farther than this from a point are left alone
DISTANCE = 0.025  # [m] kept between an obstacle and the axis of an arm


class KeepOut:
    """The obstacles as free arms see them."""

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        k = len(obstacles)
        self._centres = np.array([o.centre for o in obstacles]).reshape(k, 3)
        self._halves = np.array([o.half for o in obstacles]).reshape(k, 3)
        yaws = np.array([o.yaw for o in obstacles])
        self._to_world = np.tile(np.eye(3), (k, 1, 1))
        self._to_world[:, 0, 0] = self._to_world[:, 1, 1] = np.cos(yaws)
        self._to_world[:, 1, 0], self._to_world[:, 0, 1] = np.sin(yaws), -np.sin(yaws)

    def half_spaces(self, points: Vector) -> Vector:
        """Half-spaces (n, 4): a point x of row (a, b) should keep a·x ≥ b; b is -inf when no obstacle is near.

        `points` (n, 3) in world [m]. Each row belongs to the obstacle nearest to its point; a is the direction away
        from it, for a point inside it the way out through the nearest face.
        """
        rows = np.zeros((len(points), 4))
        rows[:, 3] = -np.inf
        if not len(self._centres):
            return rows
        inside = np.einsum("nki,kij->nkj", points[:, None] - self._centres, self._to_world)  # in each box
        gaps = np.abs(inside) - self._halves
        away = np.maximum(gaps, 0.0)
        distances = np.sqrt(np.einsum("nki,nki->nk", away, away)) + np.minimum(gaps.max(axis=2), 0.0)
        nearest = np.argmin(distances, axis=1)
        for n, k in enumerate(nearest):
            distance = distances[n, k]
            if distance > NEAR:
                continue
            direction = away[n, k] if distance > 0.0 else (gaps[n, k] == gaps[n, k].max()).astype(float)
            direction = self._to_world[k] @ (direction * np.where(inside[n, k] < 0.0, -1.0, 1.0))
            direction /= np.linalg.norm(direction)
            rows[n, :3], rows[n, 3] = direction, direction @ points[n] - distance + DISTANCE
        return rows
