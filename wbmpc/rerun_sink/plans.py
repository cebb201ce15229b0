"""Columns of the 100 Hz plans: horizons, support polygon, ΔZ, stage reports, contact phases, candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.footage import on_ground
from wbmpc.rerun_sink.documents import candidate_lines, candidate_table
from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.palette import AXES, FAULT, LEFT, LIMIT, PLANNED, RIGHT
from wbmpc.rerun_sink.scene import Patch
from wbmpc.rerun_sink.stream import Stream
from wbmpc.signals import SIDES, CandidateReport, ContactPhase, PlanReport, SolveStatus

_STAGES = ("stage1", "stage2", "stage3")
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
    for path, radius in {"/world/com/horizon": 0.003, "/world/zmp/horizon": 0.003}.items():
        stream.static(path, rr.LineStrips3D.from_fields(radii=radius, colors=[PLANNED]))
    stream.static("/world/support_polygon", rr.LineStrips3D.from_fields(radii=0.002, colors=[LIMIT]))
    # Labels only on hover: a dozen of them would cover the robot.
    stream.static("/world/candidates", rr.Points3D.from_fields(show_labels=False))
    stream.static("/world/zmp/delta_z", rr.Arrows3D.from_fields(radii=0.0015, colors=[FAULT]))
    for side, colour in zip(SIDES, (LEFT, RIGHT), strict=True):
        stream.static(f"/world/hands/{side}/horizon", rr.LineStrips3D.from_fields(radii=0.003, colors=[colour]))


def write_plans(
    stream: Stream,
    plans: Sequence[PlanReport],
    *,
    ground: NDArray[np.float64],
    knot_period: float,
    patches: Mapping[str, Patch],
) -> None:
    """Send the plans; `ground` (n,) [m] is the height of the foot plane at each."""
    if not plans:
        return
    time = np.array([plan.time for plan in plans])
    _write_horizons(stream, plans, time, ground)
    _write_curves(stream, plans, time, knot_period)
    for i, side in enumerate(SIDES):
        names = [_phase_text(plan, i) for plan in plans]
        stream.states(f"/contact_phase/{side}", time, names)
    for stage in _STAGES:
        stream.states(
            f"/solver_status/{stage}", time, [SolveStatus(getattr(plan, stage).status).name for plan in plans]
        )
    _write_candidates(stream, [plan for plan in plans if plan.candidates], patches)


def _write_horizons(
    stream: Stream, plans: Sequence[PlanReport], time: NDArray[np.float64], ground: NDArray[np.float64]
) -> None:
    com = np.array([plan.com for plan in plans])  # (n, N, 3)
    stream.strips("/world/com/horizon", time, [[line] for line in com])
    zmp = np.empty_like(com)
    zmp[:, :, :2], zmp[:, :, 2] = [plan.zmp for plan in plans], ground[:, None]
    stream.strips("/world/zmp/horizon", time, [[line] for line in zmp])
    polygons = [on_ground(plan.support_polygon, z) for plan, z in zip(plans, ground, strict=True)]
    stream.strips("/world/support_polygon", time, [[np.vstack([p, p[:1]])] if len(p) else [] for p in polygons])
    references = np.array([plan.hand_reference for plan in plans])  # (n, 2, N, 3)
    known = np.isfinite(references).all(axis=3)
    for i, side in enumerate(SIDES):
        lines = [line[there] for line, there in zip(references[:, i], known[:, i], strict=True)]
        stream.strips(f"/world/hands/{side}/horizon", time, [[line] if len(line) else [] for line in lines])
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
    for i, axis in enumerate("xy"):
        stream.scalars(f"/zmp/{axis}/planned", first_knot, zmp[:, i])
        stream.scalars(f"/zmp/{axis}/support", time, [_range(plan.support_polygon[:, i]) for plan in plans])
    shift = np.column_stack([delta_z[:, 0], np.linalg.norm(delta_z, axis=2).max(axis=1)])
    stream.scalars("/planner/delta_z", time, 1e3 * shift)
    stream.scalars("/planner/progress", time, [plan.progress for plan in plans])
    stages = [[getattr(plan, stage) for stage in _STAGES] for plan in plans]
    run = np.array([[s.status != SolveStatus.NOT_RUN for s in row] for row in stages])
    solve_time = np.where(run, [[s.solve_time for s in row] for row in stages], np.nan)
    plan_time = [plan.plan_time for plan in plans]
    stream.scalars("/solvers/plan", time, 1e3 * np.column_stack([solve_time, plan_time]))
    stream.scalars("/solvers/iterations", time, np.where(run, [[s.iterations for s in row] for row in stages], np.nan))


def _range(values: NDArray[np.float64]) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (np.nan, np.nan)


def _phase_text(plan: PlanReport, hand: int) -> str:
    phase, patch = ContactPhase(int(plan.contact_phase[hand])).name.lower(), plan.contact_patch[hand]
    return f"{phase} ({patch})" if patch else phase


def _write_candidates(stream: Stream, plans: Sequence[PlanReport], patches: Mapping[str, Patch]) -> None:
    """Every firing of stage 3: a table, a line of the log for each candidate, and a marker at each patch."""
    if not plans:
        return
    time = np.array([plan.time for plan in plans])
    tables = [drawable(candidate_table(plan)) for plan in plans]
    columns = rr.TextDocument.columns(text=tables, media_type=["text/markdown"] * len(tables))
    stream.columns("/planner/candidates", time, columns)
    for plan in plans:
        lines = candidate_lines(plan.candidates)
        stream.texts("/log/candidates", np.full(len(lines), plan.time), lines)
    shown = [_best_at_each_patch([c for c in plan.candidates if c.patch in patches]) for plan in plans]
    flat = [c for row in shown for c in row]
    marker: Any = rr.Points3D.columns(
        positions=[patches[c.patch].centre for c in flat],
        colors=[_marker_colour(c) for c in flat],
        radii=[0.012 if c.chosen else 0.008 for c in flat],
        labels=[drawable(f"{c.patch}, {SIDES[c.hand]} hand: {c.reason}") for c in flat],
    )
    stream.columns("/world/candidates", time, marker.partition([len(row) for row in shown]))


def _best_at_each_patch(candidates: Sequence[CandidateReport]) -> list[CandidateReport]:
    """The hands share a patch and so would their markers: the better hand's is drawn."""
    ranked = sorted(candidates, key=lambda c: (c.chosen, -c.cost))
    return list({c.patch: c for c in ranked}.values())


def _marker_colour(candidate: CandidateReport) -> tuple[int, int, int]:
    if candidate.chosen:
        return PLANNED
    return LIMIT if np.isfinite(candidate.cost) else FAULT
