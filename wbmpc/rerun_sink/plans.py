"""Columns of the 100 Hz plans: horizons, support polygon, ΔZ, stage reports, contact phases."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.footage import on_ground
from wbmpc.rerun_sink.palette import AXES, FAULT, GOOD, LEFT, LIMIT, PLANNED, RIGHT
from wbmpc.rerun_sink.stream import Stream
from wbmpc.signals import SIDES, ContactPhase, PlanReport, SolveStatus

_STAGES = ("stage1", "stage2", "stage3")
_NOWHERE = np.full((1, 2), np.nan)
_LEAST_DRAWN_SHIFT = 1e-4  # [m] a shorter ΔZ is solver noise


def describe_plans(stream: Stream) -> None:
    """Names, colours and sizes of everything that `write_plans` sends."""
    stream.series("/com/z/band", ["lowest CoM height", "highest CoM height"], [LIMIT, LIMIT])
    for axis in "xy":
        stream.series(f"/zmp/{axis}/planned", ["ZMP planned"], [PLANNED])
        stream.series(f"/zmp/{axis}/support", ["support polygon, least", "greatest"], [LIMIT, LIMIT])
    stream.series("/planner/delta_z", ["ΔZ x [mm]", "ΔZ y [mm]", "largest |ΔZ| [mm]"], [*AXES[:2], PLANNED])
    stream.series("/planner/progress", ["progress of the task (0 gated, 1 free)"], [PLANNED])
    stream.series("/solvers/plan", ["stage 1 [ms]", "stage 2 [ms]", "stage 3 [ms]", "plan [ms]"], [*AXES, LIMIT])
    stream.series("/solvers/iterations", ["stage 1", "stage 2", "stage 3"], AXES)
    for solver in (*_STAGES, "tracker"):
        stream.static(f"/solver_status/{solver}", _status_colours())
    for path, radius in {"/world/com/horizon": 0.003, "/world/zmp/horizon": 0.003}.items():
        stream.static(path, rr.LineStrips3D.from_fields(radii=radius, colors=[PLANNED]))
    stream.static("/world/support_polygon", rr.LineStrips3D.from_fields(radii=0.002, colors=[LIMIT]))
    stream.static("/world/zmp/delta_z", rr.Arrows3D.from_fields(radii=0.0015, colors=[FAULT]))
    for side, colour in zip(SIDES, (LEFT, RIGHT), strict=True):
        stream.static(f"/world/hands/{side}/horizon", rr.LineStrips3D.from_fields(radii=0.003, colors=[colour]))


def _status_colours() -> rr.StateConfiguration:
    good = {SolveStatus.SOLVED: GOOD, SolveStatus.NOT_RUN: LIMIT}
    colours = {status.name: good.get(status, FAULT) for status in SolveStatus}
    colours |= {f"{name}, fallback": FAULT for name in colours}
    return rr.StateConfiguration(values=list(colours), colors=list(colours.values()))


def write_plans(
    stream: Stream,
    plans: Sequence[PlanReport],
    *,
    ground: NDArray[np.float64],
    knot_period: float,
) -> None:
    """Send the plans; `ground` (n,) [m] is the height of the foot plane at each."""
    if not plans:
        return
    time = np.array([plan.time for plan in plans])
    _write_horizons(stream, plans, time, ground)
    _write_curves(stream, plans, time, knot_period)
    for i, side in enumerate(SIDES):
        names = [_phase_text(int(plan.contact_phase[i]), plan.contact_patch[i]) for plan in plans]
        stream.states(f"/contact_phase/{side}", time, names)
    for stage in _STAGES:
        stream.states(
            f"/solver_status/{stage}", time, [SolveStatus(getattr(plan, stage).status).name for plan in plans]
        )


def _write_horizons(
    stream: Stream, plans: Sequence[PlanReport], time: NDArray[np.float64], ground: NDArray[np.float64]
) -> None:
    com = np.array([plan.com for plan in plans])  # (n, N, 3)
    knots = np.full(len(com), com.shape[1])
    stream.lines("/world/com/horizon", time, com.reshape(-1, 3), knots)
    zmp = np.empty_like(com)
    zmp[:, :, :2], zmp[:, :, 2] = [plan.zmp for plan in plans], ground[:, None]
    stream.lines("/world/zmp/horizon", time, zmp.reshape(-1, 3), knots)
    outlines, corners = _closed([plan.support_polygon for plan in plans])
    stream.lines("/world/support_polygon", time, on_ground(outlines, np.repeat(ground, corners)), corners)
    references = np.array([plan.hand_reference for plan in plans])  # (n, 2, N, 3)
    known = np.isfinite(references).all(axis=3)
    for i, side in enumerate(SIDES):
        line, there = references[:, i], known[:, i]
        stream.lines(f"/world/hands/{side}/horizon", time, line[there], there.sum(axis=1))
    shifts = np.zeros_like(com)
    shifts[:, :, :2] = [plan.delta_z for plan in plans]
    drawn = np.linalg.norm(shifts, axis=2) > _LEAST_DRAWN_SHIFT
    vectors, tips = shifts[drawn], zmp[drawn]
    columns = rr.Arrows3D.columns(origins=tips - vectors, vectors=vectors)
    stream.columns("/world/zmp/delta_z", time, columns.partition(drawn.sum(axis=1)))


def _write_curves(stream: Stream, plans: Sequence[PlanReport], time: NDArray[np.float64], knot_period: float) -> None:
    # The first knot is a statement about t + T: drawn there, it can be compared with what was measured then.
    first_knot = time + knot_period
    stream.scalars("/com/z/band", first_knot, [plan.com_height_band[0] for plan in plans])
    zmp, delta_z = np.array([plan.zmp[0] for plan in plans]), np.array([plan.delta_z for plan in plans])
    support = _extents([plan.support_polygon for plan in plans])
    for i, axis in enumerate("xy"):
        stream.scalars(f"/zmp/{axis}/planned", first_knot, zmp[:, i])
        stream.scalars(f"/zmp/{axis}/support", time, support[:, :, i])
    shift = np.column_stack([delta_z[:, 0], np.linalg.norm(delta_z, axis=2).max(axis=1)])
    stream.scalars("/planner/delta_z", time, 1e3 * shift)
    stream.scalars("/planner/progress", time, [plan.progress for plan in plans])
    stages = [[getattr(plan, stage) for stage in _STAGES] for plan in plans]
    run = np.array([[s.status != SolveStatus.NOT_RUN for s in row] for row in stages])
    solve_time = np.where(run, [[s.solve_time for s in row] for row in stages], np.nan)
    plan_time = [plan.plan_time for plan in plans]
    stream.scalars("/solvers/plan", time, 1e3 * np.column_stack([solve_time, plan_time]))
    stream.scalars("/solvers/iterations", time, np.where(run, [[s.iterations for s in row] for row in stages], np.nan))


def _closed(polygons: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners (c, 2) of all polygons, each back at its first, and how many each has got; an empty one stays empty."""
    parts = [part for polygon in polygons for part in (polygon, polygon[:1])]
    return np.concatenate(parts), np.array([len(polygon) + (len(polygon) > 0) for polygon in polygons])


def _extents(polygons: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(n, 2, 2) [m] least and greatest coordinates of each; nan for an empty one."""
    corners = np.concatenate([part for polygon in polygons for part in (polygon, _NOWHERE)])  # no stretch is empty
    starts = np.cumsum([0, *(len(polygon) + 1 for polygon in polygons[:-1])])
    return np.stack([extreme.reduceat(corners, starts, axis=0) for extreme in (np.fmin, np.fmax)], axis=1)


@cache
def _phase_text(phase: int, patch: str) -> str:
    name = ContactPhase(phase).name.lower()
    return f"{name} ({patch})" if patch else name
