"""Where the ZMP may be over the horizon: the support polygons of the coming steps, which move with the footsteps."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.support import SupportPolygon
from wbmpc.record import record
from wbmpc.signals import Vector

MAX_FOOTSTEPS = 4  # landings within one horizon; later ones are not planned yet


@record
class SupportPreview:
    """Half-planes of every knot, at the footsteps' reference places, and how they move with the footsteps.

    A polygon on one footstep moves with it; that of a double support, with half of each of its two: exact to first
    order in the middle, and what a landed foot adds is known exactly before it matters.
    """

    normals: Vector  # (N, MAX_EDGES, 2) outward
    offsets: Vector  # (N, MAX_EDGES) [m] margins subtracted
    shift: Vector  # (N, MAX_FOOTSTEPS) share of a footstep's displacement by which the polygon moves
    polygons: tuple[SupportPolygon, ...]  # (N,) the same at the references
    centres: Vector  # (N, 2) [m] of the polygons at the references
    centring: Vector  # (N,) 0 … 1: how much the ZMP is drawn to them
    rest_normals: Vector  # (MAX_EDGES, 2) where the last knot's capture point may be
    rest_offsets: Vector  # (MAX_EDGES,)
    rest_shift: Vector  # (MAX_FOOTSTEPS,)
    footsteps: Vector  # (MAX_FOOTSTEPS, 2) [m] references, in world; zero when unused
    placement_axes: Vector  # (MAX_FOOTSTEPS, 2, 2) rows: forward and left of the foot stood on
    placement_lower: Vector  # (MAX_FOOTSTEPS, 2) [m] bounds on a displacement relative to the one before, in those axes
    placement_upper: Vector  # (MAX_FOOTSTEPS, 2)
    lower: Vector  # (MAX_FOOTSTEPS, 2) [m] bounds on a displacement in world; zero when unused
    upper: Vector  # (MAX_FOOTSTEPS, 2)
    com_reference: Vector  # (N, 2) [m] between the feet
    com_velocity: Vector  # (N, 2) [m/s]

    @classmethod
    def standing(cls, polygons: tuple[SupportPolygon, ...], *, rest: SupportPolygon) -> SupportPreview:
        """No footsteps: the polygon of each knot, the CoM to rest at their centres."""
        n, m = len(polygons), MAX_FOOTSTEPS
        zero, free = np.zeros((m, 2)), np.full((m, 2), np.inf)
        return cls(
            normals=np.array([p.normals for p in polygons]),
            offsets=np.array([p.offsets for p in polygons]),
            shift=np.zeros((n, m)),
            polygons=polygons,
            centres=np.array([p.centre for p in polygons]),
            centring=np.zeros(n),
            rest_normals=rest.normals,
            rest_offsets=rest.offsets,
            rest_shift=np.zeros(m),
            footsteps=zero,
            placement_axes=np.tile(np.eye(2), (m, 1, 1)),
            placement_lower=-free,
            placement_upper=free,
            lower=zero,
            upper=zero,
            com_reference=np.array([p.centre for p in polygons]),
            com_velocity=np.zeros((n, 2)),
        )
