"""A second run beside the first in one file, from the tick on at which they part: the same entities under /branch.

Its robot is a ghost, its curves are paler.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.documents import verdict_document
from wbmpc.rerun_sink.firings import FiringLog
from wbmpc.rerun_sink.mismatch import describe_mismatch, write_measured, write_planned
from wbmpc.rerun_sink.momentum import MomentumRate
from wbmpc.rerun_sink.plans import describe_plans, write_plans
from wbmpc.rerun_sink.scene import Patch, Scene
from wbmpc.rerun_sink.stream import TIMELINE, Colour, Stream
from wbmpc.rerun_sink.ticks import describe_ticks, write_ticks, write_tracker_status

BRANCH = "/branch"
_GHOST = (0.95, 0.55, 0.15, 0.45)  # RGBA
_SAME_TIME = 1e-9  # [s]
_HIDDEN_GROUP = 5
_PALENESS = 0.5  # share of white in a curve's colour


class BranchStream(Stream):
    """Everything under BRANCH, so that both runs can be read, and shown, in the same way."""

    def __init__(self, recording: Any, since: float) -> None:
        """`since`: when the runs part [s]."""
        super().__init__(recording)
        self._since = since

    def static(self, path: str, *archetypes: Any) -> None:
        if path.startswith("/world/bodies/"):  # no ghost before there is one
            self.recording.set_time(TIMELINE, duration=self._since)
            self.recording.log(BRANCH + path, *archetypes)
        else:
            super().static(BRANCH + path, *archetypes)

    def columns(self, path: str, time: NDArray[np.float64], columns: Any) -> None:
        super().columns(BRANCH + path, time, columns)

    def series(self, path: str, names: Sequence[str], colours: Sequence[Colour], width: float = 1.5) -> None:
        pale = [tuple(round(c + _PALENESS * (255 - c)) for c in colour) for colour in colours]
        super().series(path, [f"{name}, branch" for name in names], pale, width)  # type: ignore[arg-type]


def write_branch(
    stream: Stream,
    recorder: Recorder,
    model: Any,
    verdict: Mapping[str, Any],
    changes: Sequence[str],
    *,
    tick: int,
    patches: Mapping[str, Patch],
    joint_names: Sequence[str],
    stride: int,
    knot_period: float,
) -> None:
    """Write a run from `tick` on.

    Args:
        stream: of the first run.
        tick: the first one after the change.
        model: of the world, to be drawn as a ghost: it is recoloured.
        changes: what is different, in words.
        patches, joint_names, stride, knot_period: as of the first run, see `RerunSink`.
    """
    since = float(recorder.time[tick])
    branch = BranchStream(stream.recording, since)
    changed = "\n".join(f"- {text}" for text in changes)
    branch.document("/verdict", f"### Changed\n\n{changed}\n\n{verdict_document(verdict)}")
    scene = Scene(branch, _ghost(model), ())
    describe_ticks(branch, joint_names)
    describe_plans(branch)
    describe_mismatch(branch)
    firings = FiringLog(branch, patches)
    firings.describe()
    rows = np.arange(-(-tick // stride) * stride, recorder.ticks, stride)
    write_ticks(branch, recorder, rows, stride)
    scene.write_poses(recorder.time[rows], recorder.qpos[rows])
    write_measured(branch, recorder, rows, MomentumRate(model))
    write_tracker_status(branch, recorder, tick, recorder.ticks)
    plans = [plan for plan in recorder.plans if plan.time >= since - _SAME_TIME]
    ticks = np.searchsorted(recorder.time, [plan.time for plan in plans]).clip(max=recorder.ticks - 1)
    ground = recorder.sole_position[ticks, :, 2].min(axis=1)
    write_plans(branch, plans, ground=ground, knot_period=knot_period)
    write_planned(branch, plans, knot_period)
    firings.write(plans)
    events = [event for event in recorder.events if event.time >= since - _SAME_TIME]
    branch.texts("/log/events", np.array([e.time for e in events]), [f"branch: {e.text}" for e in events])
    branch.recording.flush()


def _ghost(model: Any) -> Any:
    """The model, without what stands still and in the ghost's colour."""
    moves = model.geom_bodyid > 0
    model.geom_group[~moves] = _HIDDEN_GROUP
    model.geom_matid[moves], model.geom_rgba[moves] = -1, _GHOST
    return model
