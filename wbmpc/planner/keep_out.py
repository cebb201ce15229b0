"""What free arms must not touch: half-spaces in front of the nearest obstacle or leg."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.scenario import Obstacle
from wbmpc.signals import Vector

NEAR = 0.12  # [m] obstacles farther than this from a point are left alone
DISTANCE = 0.025  # [m] kept between an obstacle and the axis of an arm
SHARES = np.linspace(0.0, 1.0, 9)  # of the elbow in the points of a forearm that are looked at; the rest is the palm's


class KeepOut:
    """The obstacles as free arms see them."""

    def __init__(self, obstacles: tuple[Obstacle, ...], *, forearm_radius: float, leg_radius: float) -> None:
        """`forearm_radius`, `leg_radius` [m]: of the robot's links as capsules."""
        self._forearm_radius, self._leg_radius = forearm_radius, leg_radius
        k = len(obstacles)
        self._centres = np.array([o.centre for o in obstacles]).reshape(k, 3)
        self._halves = np.array([o.half for o in obstacles]).reshape(k, 3)
        yaws = np.array([o.yaw for o in obstacles])
        self._to_world = np.tile(np.eye(3), (k, 1, 1))
        self._to_world[:, 0, 0] = self._to_world[:, 1, 1] = np.cos(yaws)
        self._to_world[:, 1, 0], self._to_world[:, 0, 1] = np.sin(yaws), -np.sin(yaws)

    def of_arms(self, palms: Vector, elbows: Vector, leg_links: Vector, *, free: list[bool]) -> Vector:
        """Half-spaces (2, 3, 5) of palm, elbow and the point between them that is nearest to anything: a, b, share.

        `palms`, `elbows` (2, 3), `leg_links` (4, 2, 3): ends of thighs and shanks, in world [m]; share: of the elbow in
        the point, 0 … 1. A bar fits between three fixed points of a forearm; the nearest one it cannot pass. For a hand
        that is not `free` obstacles only mind the elbow's half of the forearm: the palm is to come near to one.
        """
        boxes = (self._centres, self._halves, self._to_world)
        return _of_arms(palms, elbows, leg_links, np.array(free), *boxes, self._leg_radius)

    def forearm_gap(self, palm: Vector, elbow: Vector) -> float:
        """Distance [m] from the surface of a forearm's elbow half to the nearest obstacle; palm and elbow (3,) [m]."""
        points = palm + SHARES[SHARES >= 0.5, None] * (elbow - palm)
        return float(self.half_spaces(points)[1].min()) - self._forearm_radius

    def half_spaces(self, points: Vector) -> tuple[Vector, Vector]:
        """Half-spaces (n, 4): a point x of row (a, b) should keep a·x ≥ b; and distances (n,) [m] to the obstacles.

        `points` (n, 3) in world [m]. Each row belongs to the obstacle nearest to its point; a is the direction away
        from it, for a point inside it the way out through the nearest face. b is -inf when no obstacle is near.
        """
        return _half_spaces(points, self._centres, self._halves, self._to_world)


@kernel
def _of_arms(
    palms: Vector,
    elbows: Vector,
    leg_links: Vector,
    free: NDArray[np.bool_],
    centres: Vector,
    halves: Vector,
    to_world: Vector,
    leg_radius: float,
) -> Vector:
    arms, n = np.empty((2, 3, 5)), len(SHARES)
    points = np.empty((n, 3))
    for side in range(2):
        for i in range(n):
            for j in range(3):
                points[i, j] = palms[side, j] + SHARES[i] * (elbows[side, j] - palms[side, j])
        rows, distances = _half_spaces(points, centres, halves, to_world)
        away, clearances = _from_axes(points, leg_links)
        for i in range(n):
            if not free[side] and SHARES[i] < 0.5:
                rows[i, 3], distances[i] = -np.inf, np.inf
            clearance = clearances[i] - leg_radius
            if clearance < min(distances[i], NEAR):
                level = 0.0
                for j in range(3):
                    rows[i, j] = away[i, j]
                    level += away[i, j] * points[i, j]
                rows[i, 3] = level - clearance + DISTANCE
            distances[i] = min(distances[i], clearance)
        nearest = 1 + int(np.argmin(distances[1:-1]))
        for row, i in enumerate((0, nearest, n - 1)):
            arms[side, row, :4], arms[side, row, 4] = rows[i], SHARES[i]
    return arms


@kernel
def _half_spaces(points: Vector, centres: Vector, halves: Vector, to_world: Vector) -> tuple[Vector, Vector]:
    rows, distances = np.zeros((len(points), 4)), np.full(len(points), np.inf)
    rows[:, 3] = -np.inf
    inside, direction = np.empty(3), np.empty(3)
    for n in range(len(points)):
        for k in range(len(centres)):
            outside, gap = 0.0, -np.inf
            for j in range(3):
                inside[j] = 0.0  # the point in the box's own axes
                for i in range(3):
                    inside[j] += (points[n, i] - centres[k, i]) * to_world[k, i, j]
                over = abs(inside[j]) - halves[k, j]
                gap = max(gap, over)
                outside += max(over, 0.0) ** 2
            distance = np.sqrt(outside) + min(gap, 0.0)
            if distance >= distances[n]:
                continue
            distances[n] = distance
            if distance > NEAR:
                continue
            direction[:] = 0.0
            for j in range(3):
                over = abs(inside[j]) - halves[k, j]
                share = max(over, 0.0) if distance > 0.0 else (1.0 if over == gap else 0.0)
                for i in range(3):
                    direction[i] += to_world[k, i, j] * (-share if inside[j] < 0.0 else share)
            length = np.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
            rows[n, 3] = DISTANCE - distance
            for i in range(3):
                rows[n, i] = direction[i] / length
                rows[n, 3] += rows[n, i] * points[n, i]
    return rows, distances


@kernel
def _from_axes(points: Vector, links: Vector) -> tuple[Vector, Vector]:
    """Unit directions (n, 3) away from the nearest of the links' axes (k, 2, 3), and distances (n,) [m] to it."""
    away, distances = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    along, offset = np.empty(3), np.empty(3)
    for n in range(len(points)):
        for k in range(len(links)):
            product = square = 0.0
            for i in range(3):
                along[i], offset[i] = links[k, 1, i] - links[k, 0, i], points[n, i] - links[k, 0, i]
                product += offset[i] * along[i]
                square += along[i] * along[i]
            share, distance = min(max(product / square, 0.0), 1.0), 0.0
            for i in range(3):
                offset[i] -= share * along[i]
                distance += offset[i] * offset[i]
            distance = np.sqrt(distance)
            if distance < distances[n]:
                distances[n] = distance
                for i in range(3):
                    away[n, i] = offset[i] / max(distance, 1e-9)
    return away, distances
