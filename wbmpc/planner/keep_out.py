"""What free arms must not touch: half-spaces in front of the nearest obstacle or leg."""

from __future__ import annotations

import numpy as np

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
        points = palms[:, None] + SHARES[None, :, None] * (elbows - palms)[:, None]
        points = points.reshape(-1, 3)
        rows, distances = self.half_spaces(points)
        reaching = np.repeat([not f for f in free], len(SHARES)) & (np.tile(SHARES, 2) < 0.5)
        rows[reaching, 3], distances[reaching] = -np.inf, np.inf
        away, clearance = _from_axes(points, leg_links)
        clearance -= self._leg_radius
        nearer = clearance < np.minimum(distances, NEAR)
        rows[nearer, :3] = away[nearer]
        rows[nearer, 3] = (np.einsum("ni,ni->n", away, points) - clearance + DISTANCE)[nearer]
        distances = np.minimum(distances, clearance)
        rows, distances = rows.reshape(2, len(SHARES), 4), distances.reshape(2, len(SHARES))
        arms = np.empty((2, 3, 5))
        for side in range(2):
            chosen = (0, 1 + int(np.argmin(distances[side, 1:-1])), len(SHARES) - 1)
            arms[side, :, :4], arms[side, :, 4] = rows[side, chosen], SHARES[list(chosen)]
        return arms

    def forearm_gap(self, palm: Vector, elbow: Vector) -> float:
        """Distance [m] from the surface of a forearm's elbow half to the nearest obstacle; palm and elbow (3,) [m]."""
        points = palm + SHARES[SHARES >= 0.5, None] * (elbow - palm)
        return float(self.half_spaces(points)[1].min()) - self._forearm_radius

    def half_spaces(self, points: Vector) -> tuple[Vector, Vector]:
        """Half-spaces (n, 4): a point x of row (a, b) should keep a·x ≥ b; and distances (n,) [m] to the obstacles.

        `points` (n, 3) in world [m]. Each row belongs to the obstacle nearest to its point; a is the direction away
        from it, for a point inside it the way out through the nearest face. b is -inf when no obstacle is near.
        """
        rows = np.zeros((len(points), 4))
        rows[:, 3] = -np.inf
        if not len(self._centres):
            return rows, np.full(len(points), np.inf)
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
        return rows, distances.min(axis=1)


def _from_axes(points: Vector, links: Vector) -> tuple[Vector, Vector]:
    """Unit directions (n, 3) away from the nearest of the links' axes (k, 2, 3), and distances (n,) [m] to it."""
    begin, along = links[:, 0], links[:, 1] - links[:, 0]
    shares = np.einsum("nki,ki->nk", points[:, None] - begin, along) / np.einsum("ki,ki->k", along, along)
    offsets = points[:, None] - begin - np.clip(shares, 0.0, 1.0)[:, :, None] * along
    distances = np.sqrt(np.einsum("nki,nki->nk", offsets, offsets))
    nearest = (np.arange(len(points)), np.argmin(distances, axis=1))
    return offsets[nearest] / np.maximum(distances[nearest], 1e-9)[:, None], distances[nearest]
