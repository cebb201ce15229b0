"""The support over the horizon, out of the intervals in which the robot stands on the same feet."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep_bounds import FootstepBounds
from wbmpc.planner.support import UNEVEN, SupportPolygon
from wbmpc.planner.support_interval import Interval
from wbmpc.planner.support_kernel import horizon_polygons, place_knots
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.signals import Vector

NEVER = 1e3  # [s]
NO_TRANSFER = (np.nan,) * 5


class SupportHorizon:
    """Intervals, the last of which lasts for ever, as arrays."""

    headings: Vector  # (N,) of the robot at the knots [rad]

    def __init__(self, intervals: list[Interval], times: Vector, *, standing: list[float]) -> None:
        """Knots at `times` (N,) [s from now]; heights `standing` [m] of the feet that stand now.

        Where soles stand at different heights all polygons are projected onto the plane of the feet that stand now.
        """
        self._times = times
        self._phases = np.array([_numbers(interval) for interval in intervals])  # (I, 9)
        self._positions = np.array([interval.feet.positions for interval in intervals])  # (I, 2, 3)
        self._yaws = np.array([interval.feet.yaws for interval in intervals])  # (I, 2)
        plane = sum(standing) / len(standing)
        self._which, self.headings, uneven = place_knots(
            times, self._phases, self._positions, self._yaws, plane, UNEVEN
        )
        self.plane: float | None = plane if uneven else None  # [m]

    def preview(
        self,
        *,
        half_extents: Vector,
        margin: float,
        growth: float,
        com: Vector,
        com_velocity: Vector,
        bounds: FootstepBounds,
    ) -> SupportPreview:
        """What stage 2 needs.

        Args:
            half_extents: (2,) of a sole [m].
            margin: inset of the polygons [m], growing by `growth` [m/s].
            com: (N, 3) where the CoM will be [m], roughly.
            com_velocity: (N, 2) wanted [m/s].
            bounds: of the footsteps.
        """
        counts, vertices, normals, offsets, centres, planes, shares, centring, between = horizon_polygons(
            *(self._which, self._times, margin, growth, self._phases, self._positions, self._yaws, half_extents),
            *(np.nan if self.plane is None else self.plane, com, MAX_FOOTSTEPS),
        )
        return SupportPreview(
            normals=normals[:-1],
            offsets=offsets[:-1],
            shift=shares[:-1],
            polygons=tuple(
                SupportPolygon(corners[:count], *rest)
                for corners, count, *rest in zip(
                    *(vertices[:-1], counts[:-1].tolist(), normals, offsets, centres, planes.tolist()), strict=False
                )
            ),
            centres=centres[:-1],
            centring=centring,
            rest_normals=normals[-1],
            rest_offsets=offsets[-1],
            rest_shift=shares[-1],
            footsteps=bounds.footsteps,
            placement_axes=bounds.placement_axes,
            placement_lower=bounds.placement_lower,
            placement_upper=bounds.placement_upper,
            lower=bounds.lower,
            upper=bounds.upper,
            com_reference=between,
            com_velocity=com_velocity,
        )


def _numbers(interval: Interval) -> tuple[float, ...]:
    """An interval as a row of `horizon_polygons`' phases."""
    end, _, swing, moved, transfer = interval
    if transfer is None:
        return end, swing, *moved, *NO_TRANSFER
    return end, swing, *moved, transfer.begin, *transfer.before, *transfer.after
