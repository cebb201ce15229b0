"""The support over the horizon, out of the intervals in which the robot stands on the same feet."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep_bounds import FootstepBounds
from wbmpc.planner.support import UNEVEN, SupportPolygon
from wbmpc.planner.support_interval import Interval
from wbmpc.planner.support_kernel import horizon_polygons
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.signals import Vector

NEVER = 1e3  # [s]
NO_TRANSFER = (np.nan,) * 5


class SupportHorizon:
    """Intervals, the last of which lasts for ever, and the same as arrays, with the rest after the horizon."""

    def __init__(self, intervals: list[Interval], times: Vector, *, standing: list[float]) -> None:
        """Knots at `times` (N,) [s from now]; heights `standing` [m] of the feet that stand now.

        Where soles stand at different heights all polygons are projected onto the plane of the feet that stand now.
        """
        ends = np.array([interval.end for interval in intervals])
        which = np.minimum(np.searchsorted(ends + 1e-9, times), len(intervals) - 1)  # a knot at an end is before it
        last = int(which[-1])
        both = intervals[last if intervals[last].swing < 0 else min(last + 1, len(intervals) - 1)]
        self._intervals = [*intervals, Interval(NEVER, both.feet, -1, both.moved)]
        self._which, self._times = np.append(which, len(intervals)), np.append(times, times[-1])
        self._positions = np.array([interval.feet.positions for interval in self._intervals])  # (I + 1, 2, 3)
        self._yaws = np.array([interval.feet.yaws for interval in self._intervals])  # (I + 1, 2)
        plane = sum(standing) / len(standing)
        uneven = np.abs(self._positions[:, :, 2] - plane).max() > UNEVEN
        self.plane: float | None = plane if uneven else None  # [m]

    @property
    def headings(self) -> Vector:
        """(N,) of the robot at the knots [rad]."""
        mean: Vector = self._yaws.mean(axis=1)[self._which[:-1]]
        return mean

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
        intervals, which = self._intervals, self._which
        swings = np.array([interval.swing for interval in intervals])
        transfers = np.array([_numbers(interval) for interval in intervals])
        counts, vertices, normals, offsets, centres, planes, shares = horizon_polygons(
            which,
            self._times,
            margin + growth * self._times,
            np.array([interval.end for interval in intervals]),
            self._positions,
            self._yaws,
            swings,
            np.array([interval.moved for interval in intervals]),
            transfers,
            half_extents,
            np.nan if self.plane is None else self.plane,
            np.vstack([com, com[-1:]]),
            MAX_FOOTSTEPS,
        )
        onto_one = (swings >= 0) | ~np.isnan(transfers[:, 0])  # one foot carries, or will in a moment
        return SupportPreview(
            normals=normals[:-1],
            offsets=offsets[:-1],
            shift=shares[:-1],
            polygons=tuple(
                SupportPolygon(vertices[k, : counts[k]], normals[k], offsets[k], centres[k], float(planes[k]))
                for k in range(len(which) - 1)
            ),
            centres=centres[:-1],
            centring=onto_one[which[:-1]].astype(float),
            rest_normals=normals[-1],
            rest_offsets=offsets[-1],
            rest_shift=shares[-1],
            footsteps=bounds.footsteps,
            placement_axes=bounds.placement_axes,
            placement_lower=bounds.placement_lower,
            placement_upper=bounds.placement_upper,
            lower=bounds.lower,
            upper=bounds.upper,
            com_reference=self._positions[:, :, :2].mean(axis=1)[which[:-1]],
            com_velocity=com_velocity,
        )


def _numbers(interval: Interval) -> tuple[float, ...]:
    transfer = interval.transfer
    return NO_TRANSFER if transfer is None else (transfer.begin, *transfer.before, *transfer.after)
