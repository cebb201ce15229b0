"""Every firing of stage 3: what it was asked, every candidate as text, as numbers and in 3D, and a lane of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.rerun_sink.documents import candidate_lines, firing_document
from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.palette import FAULT, LIMIT, METRES_PER_NEWTON, PLANNED
from wbmpc.rerun_sink.scene import Patch
from wbmpc.rerun_sink.stream import Stream
from wbmpc.rotations import contact_frame
from wbmpc.signals import SIDES, CandidateReport, ContactPhase, Firing, PlanReport

_LANE, _WAITS = "/contact_phase/stage_3", "waits"
_FATES = ("chosen", "rejected")
_ON_THE_WAY = (ContactPhase.CHOSEN, ContactPhase.APPROACHING)
_LEAST_SHOWN = 1.0  # [s] in 3D, however soon the palm is there
_THICKNESS = 1e-3  # [m] of a patch as drawn
_LEAST_CONE = 0.06  # [m] height of a friction cone as drawn
_SPOKES, _ARC = 8, 3  # of a cone, and chords of its rim between two of them

FloatArray = NDArray[np.float64]


class FiringLog:
    """Writes the firings among the plans; remembers which one the 3D view shows."""

    def __init__(self, stream: Stream, patches: Mapping[str, Patch]) -> None:
        self._stream, self._patches = stream, patches
        self._shown_since: float | None = None
        self._begun = False

    def describe(self) -> None:
        """Sizes and manners of everything that `write` draws: what was chosen is solid, the rest is a ghost."""
        stream, modes = self._stream, rr.components.FillMode
        stream.static(_LANE, rr.StateConfiguration(values=[_WAITS], visible=[False]))  # a gap
        for fate, mode, size in zip(
            _FATES, (modes.Solid, modes.TransparentFillMajorWireframe), (1.0, 0.5), strict=True
        ):
            path = f"/world/stage_3/{fate}"
            # Labels only on hover: a dozen of them would cover the robot.
            stream.static(f"{path}/patch", rr.Boxes3D.from_fields(fill_mode=mode, radii=5e-4, show_labels=False))
            stream.static(f"{path}/palm", rr.Ellipsoids3D.from_fields(fill_mode=mode, line_radii=3e-4))
            stream.static(f"{path}/force", rr.Arrows3D.from_fields(radii=0.005 * size))
            stream.static(f"{path}/cone", rr.LineStrips3D.from_fields(radii=8e-4 * size))

    def write(self, plans: Sequence[PlanReport]) -> None:
        """Send what fired in the plans, in order, and take from the 3D view what is over."""
        fired = [(plan.time, plan.firing) for plan in plans if plan.firing]
        if fired:
            self._write_texts([plan for plan in plans if plan.firing])
            self._write_numbers(fired)
        scenes: list[tuple[float, Firing | None]] = []
        for plan in plans:
            if plan.firing:
                self._shown_since = plan.time
                scenes.append((plan.time, plan.firing))
            elif self._is_over(plan):
                self._shown_since = None
                scenes.append((plan.time, None))
        if not self._begun and (not scenes or scenes[0][0] > plans[0].time):
            scenes.insert(0, (plans[0].time, None))
        self._begun = True
        if not scenes:  # nor did anything fire
            return
        time = np.array([t for t, _ in scenes])
        self._stream.states(_LANE, time, [_headline(firing) for _, firing in scenes])
        self._draw(time, [firing for _, firing in scenes])

    def _is_over(self, plan: PlanReport) -> bool:
        if self._shown_since is None or plan.time - self._shown_since < _LEAST_SHOWN:
            return False
        return not any(phase in _ON_THE_WAY for phase in plan.contact_phase)

    def _write_texts(self, plans: Sequence[PlanReport]) -> None:
        texts = [drawable(firing_document(plan)) for plan in plans]
        columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
        self._stream.columns("/planner/candidates", np.array([plan.time for plan in plans]), columns)
        for plan in plans:
            lines = candidate_lines(plan.candidates)
            self._stream.texts("/log/candidates", np.full(len(lines), plan.time), lines)

    def _write_numbers(self, fired: Sequence[tuple[float, Firing]]) -> None:
        """The same as numbers, for those who query the file: k knots and c candidates a row, forces (c k 3,)."""
        time, firings = np.array([t for t, _ in fired]), [firing for _, firing in fired]

        def of_all(value: Callable[[CandidateReport], Any]) -> list[Any]:
            return [np.array([value(c) for c in firing.candidates]).ravel() for firing in firings]

        self._stream.values(
            "/planner/stage_3",
            time,
            knot_time=[firing.knot_times for firing in firings],
            delta_z=[firing.delta_z.ravel() for firing in firings],
            zmp=[firing.zmp.ravel() for firing in firings],
            reserve=[firing.reserve for firing in firings],
            patch=of_all(lambda c: drawable(c.patch)),
            hand=of_all(lambda c: SIDES[c.hand]),
            chosen=of_all(lambda c: c.chosen),
            cost=of_all(lambda c: c.cost),
            way_cost=of_all(lambda c: c.way_cost),
            force_cost=of_all(lambda c: c.force_cost),
            shift_cost=of_all(lambda c: c.shift_cost),
            reach_slack=of_all(lambda c: c.reach_slack),
            friction_margin=of_all(lambda c: c.friction_margin),
            forces=of_all(lambda c: c.forces),
            reason=of_all(lambda c: drawable(c.reason)),
        )

    def _draw(self, time: FloatArray, firings: Sequence[Firing | None]) -> None:
        best = [_best_at_each_patch(firing.candidates, self._patches) if firing else [] for firing in firings]
        for fate in _FATES:
            rows = [[c for c in row if c.chosen == (fate == "chosen")] for row in best]
            self._draw_candidates(f"/world/stage_3/{fate}", time, rows)

    def _draw_candidates(self, path: str, time: FloatArray, rows: Sequence[Sequence[CandidateReport]]) -> None:
        stream = self._stream
        flat = [c for row in rows for c in row]
        count = [len(row) for row in rows]
        patches = [self._patches[c.patch] for c in flat]
        colours = np.array([_colour(c) for c in flat], np.uint8).reshape(-1, 4)
        boxes = rr.Boxes3D.columns(
            centers=_points([patch.centre for patch in patches]),
            half_sizes=_points([patch.half_size(_THICKNESS) for patch in patches]),
            quaternions=np.array([_quaternion(patch.frame) for patch in patches]).reshape(-1, 4),
            colors=colours,
            labels=[drawable(f"{c.patch}, {SIDES[c.hand]} hand: {c.reason}") for c in flat],
        )
        stream.columns(f"{path}/patch", time, boxes.partition(count))
        radius = [float((c.palm - patch.centre) @ patch.normal) for c, patch in zip(flat, patches, strict=True)]
        palms = rr.Ellipsoids3D.columns(
            centers=_points([c.palm for c in flat]),
            half_sizes=_points([np.full(3, r) for r in radius]),
            colors=colours,
        )
        stream.columns(f"{path}/palm", time, palms.partition(count))
        able = [[c for c in row if np.isfinite(c.cost)] for row in rows]
        arrows = [(c.palm, force, _colour(c)) for row in able for c in row for force in c.forces]
        forces = rr.Arrows3D.columns(
            origins=_points([origin for origin, _, _ in arrows]),
            vectors=_points([METRES_PER_NEWTON * force for _, force, _ in arrows]),
            colors=np.array([colour for _, _, colour in arrows], np.uint8).reshape(-1, 4),
        )
        stream.columns(f"{path}/force", time, forces.partition([sum(len(c.forces) for c in row) for row in able]))
        cones = [[strip for c in row for strip in _cone(c, self._patches[c.patch])] for row in able]
        colours = np.array([_colour(c) for row in able for c in row], np.uint8).reshape(-1, 4)
        stream.strips(f"{path}/cone", time, cones, colours.repeat(_SPOKES, axis=0))


def _headline(firing: Firing | None) -> str:
    """State of the lane: what the 3D view shows."""
    if firing is None:
        return _WAITS
    chosen = " and ".join(c.patch for c in firing.candidates if c.chosen)
    sizes = " / ".join(f"{1e3 * size:.0f}" for size in np.abs(firing.delta_z).max(axis=1))
    return f"fired: {chosen or 'none helps'}, |ΔZ| {sizes} mm"


def _best_at_each_patch(candidates: Sequence[CandidateReport], patches: Mapping[str, Patch]) -> list[CandidateReport]:
    """The hands share a patch and so would their drawings: the better hand's is drawn."""
    ranked = sorted((c for c in candidates if c.patch in patches), key=lambda c: (c.chosen, -c.cost))
    return list({c.patch: c for c in ranked}.values())


def _colour(candidate: CandidateReport) -> tuple[int, int, int, int]:
    if candidate.chosen:
        return (*PLANNED, 255)
    return (*(LIMIT if np.isfinite(candidate.cost) else FAULT), 90)


def _cone(candidate: CandidateReport, patch: Patch) -> list[FloatArray]:
    """Polylines [m] of the friction cone, as high as the largest normal force: each a spoke and its part of the rim."""
    height = max(_LEAST_CONE, METRES_PER_NEWTON * float((candidate.forces @ patch.normal).max()))
    angles = np.linspace(0.0, 2.0 * np.pi, _ARC * _SPOKES + 1)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.full_like(angles, 1.0 / patch.friction)])
    rim = patch.centre + patch.friction * height * rim @ contact_frame(patch.normal).T
    return [np.vstack([patch.centre, rim[k : k + _ARC + 1]]) for k in range(0, _ARC * _SPOKES, _ARC)]


def _quaternion(frame: FloatArray) -> FloatArray:
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(frame).ravel())
    return wxyz[[1, 2, 3, 0]]


def _points(rows: Sequence[FloatArray]) -> FloatArray:
    return np.array(rows, dtype=float).reshape(-1, 3)
