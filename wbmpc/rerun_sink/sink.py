"""Recorder -> one .rrd file, or a viewer, in blocks as the run goes on: a killed run leaves a readable file."""

from __future__ import annotations

import json
import warnings
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
import rerun as rr

from wbmpc.errors import WbmpcError
from wbmpc.files import writing
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.blueprint import KEY, KEY_TEXT, layout
from wbmpc.rerun_sink.branching import BRANCH, write_branch
from wbmpc.rerun_sink.documents import VERDICT, verdict_document
from wbmpc.rerun_sink.firings import FiringLog
from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.mismatch import describe_mismatch, write_measured, write_planned
from wbmpc.rerun_sink.momentum import MomentumRate
from wbmpc.rerun_sink.plans import describe_plans, write_plans
from wbmpc.rerun_sink.rerunning import describe_run, write_progress
from wbmpc.rerun_sink.scene import Patch, Scene
from wbmpc.rerun_sink.snapshots import write_snapshots
from wbmpc.rerun_sink.stream import Stream
from wbmpc.rerun_sink.ticks import describe_ticks, write_ticks, write_tracker_status
from wbmpc.rerun_sink.timing import describe_timing, write_plan_timing, write_tick_timing

APPLICATION = "wbmpc"
PATIENCE = 10.0  # [s] for a viewer to take a block; a file gets all the time it needs


class RerunSink:
    """Writes what a recorder holds to `target`; reads the recorder and nothing else.

    Args:
        target: the .rrd file; replaced when it exists, its folder made when it does not. A str is the URL of a viewer;
            one that goes away is warned of, and costs the run nothing.
        model: compiled MjModel of robot and world; kept in the file, so that `wbmpc render` needs nothing else.
        joint_names: (nj,) in the order of the torques.
        scenario_text: the scenario as run, overrides included.
        tick_rate: ticks a second [Hz]; `rate` must divide it.
        rate: samples a second in the file [Hz].
        knot_period: T of the planner [s], to draw a plan's first knot at the time it speaks of.
        patches: candidate contact patches of the scene.
        versions: names and versions of the programs that made the run.
        replay: what `wbmpc replay` needs besides the plans' times, as data; None: cannot be replayed.
        block: simulated time between two writes [s]; what a killed run can lose.

    Raises:
        WbmpcError: the file cannot be written, `rate` does not divide `tick_rate`, or the recorder samples less often.
    """

    def __init__(
        self,
        target: Path | str,
        model: Any,
        recorder: Recorder,
        *,
        joint_names: Sequence[str],
        scenario_name: str,
        scenario_text: str,
        seed: int,
        tick_rate: float,
        rate: float = 100.0,
        knot_period: float = 0.1,
        patches: Sequence[Patch] = (),
        versions: Mapping[str, str] | None = None,
        replay: Mapping[str, Any] | None = None,
        block: float = 2.0,
    ) -> None:
        self._stride = _stride(tick_rate, rate, recorder.stride)
        self._recorder, self._block, self._knot_period = recorder, block, knot_period
        self._joint_names = joint_names
        self._next_flush = block
        self._ticks_done = self._plans_done = self._events_done = self._timed_done = self._snapshots_done = 0
        self._closed = self._lost = False
        self._of_file = isinstance(target, Path)

        recording = rr.RecordingStream(APPLICATION)
        _open(recording, target, model)
        self._stream = Stream(recording)
        recording.send_recording_name(drawable(f"{scenario_name}, seed {seed}"))
        self._stream.properties("run", {"scenario": scenario_name, "seed": seed, "sample_rate": float(rate)})
        self._stream.properties("versions", versions or {})
        self._stream.document("/scenario", f"~~~~yaml\n{scenario_text}\n~~~~")
        self._stream.document(KEY, KEY_TEXT)
        self._stream.document("/verdict", "No verdict: the run did not end.")
        self._stream.static("/model", rr.AnyValues(mjb=_packed(model), mujoco=mujoco.__version__))
        self._scene = Scene(self._stream, model, patches)
        describe_ticks(self._stream, joint_names)
        describe_plans(self._stream)
        self._patches = {patch.name: patch for patch in patches}
        self._firings = FiringLog(self._stream, self._patches)
        self._firings.describe()
        self._momentum = MomentumRate(model)
        describe_mismatch(self._stream)
        describe_timing(self._stream)
        self._replayable = replay is not None
        if replay is not None:
            describe_run(self._stream, replay)
        self._deliver()
        # Only now, with the run's beginning in it: a file of this name is always readable, whenever the run is killed.
        if isinstance(target, Path):
            _begun(target).replace(target)

    def flush(self, now: float | None = None) -> None:
        """Write what is new; with `now` [s], only when a block's time has passed (cheap enough for every tick)."""
        if self._lost or (now is not None and now < self._next_flush):
            return
        if now is not None:
            self._next_flush = now + self._block
        recorder, first = self._recorder, self._ticks_done
        self._ticks_done = recorder.ticks
        rows = np.arange(-(-first // self._stride) * self._stride, self._ticks_done, self._stride)
        if len(rows):
            write_ticks(self._stream, recorder, rows, self._stride)
            self._scene.write_poses(recorder.time[rows], recorder.qpos[rows])
            write_measured(self._stream, recorder, rows, self._momentum)
            write_tick_timing(self._stream, recorder, rows, self._stride)
        write_tracker_status(self._stream, recorder, first, self._ticks_done)
        self._flush_plans()
        self._flush_events()
        write_snapshots(self._stream, recorder, self._snapshots_done)
        self._snapshots_done = len(recorder.planned)
        self._timed_done = write_plan_timing(self._stream, recorder.timing, self._timed_done)
        if self._replayable:
            write_progress(self._stream, recorder, first)  # after the plans, which a replay of these ticks needs
        self._deliver()

    def finish(self, verdict: Mapping[str, Any]) -> None:
        """Write what is left and the verdict (the content of NAME.json), as a text and as the file's properties."""
        self.flush()
        self._stream.document("/verdict", verdict_document(verdict))
        self._stream.static(VERDICT, rr.AnyValues(json=json.dumps(verdict)))  # as data, which texts and properties lose
        plain = {k: v for k, v in verdict.items() if isinstance(v, bool | int | float | str)}
        numbers = {k: float(v) for k, v in (verdict.get("metrics") or {}).items() if isinstance(v, int | float)}
        self._stream.properties("verdict", plain)
        self._stream.properties("metrics", numbers)

    def beside(
        self, recorder: Recorder, model: Any, verdict: Mapping[str, Any], changes: Sequence[str], *, tick: int
    ) -> None:
        """Write a second run of the same robot beside this one, from `tick` on: see `write_branch`."""
        write_branch(
            *(self._stream, recorder, model, verdict, changes),
            tick=tick,
            patches=self._patches,
            joint_names=self._joint_names,
            stride=self._stride,
            knot_period=self._knot_period,
        )
        self._stream.recording.send_blueprint(layout(_look_at(model), beside=BRANCH), make_active=True)

    def close(self) -> None:
        """Write what is left and close the file; belongs in a `finally`. May be called twice."""
        if not self._closed:
            self._closed = True
            try:
                self.flush()
            finally:
                if not self._lost:  # it would wait for the viewer once more
                    self._stream.recording.disconnect()

    def __enter__(self) -> RerunSink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _deliver(self) -> None:
        """Wait until the block is in the file, whatever happens to the process then, or until the viewer has it."""
        if self._of_file:
            self._stream.recording.flush()
            return
        try:
            self._stream.recording.flush(timeout_sec=PATIENCE)
        except (RuntimeError, ValueError) as error:  # rerun's words for a viewer that is gone, or does not answer
            self._lost = True
            warnings.warn(f"the viewer shows no more of the run: {error}", stacklevel=2)

    def _flush_plans(self) -> None:
        recorder = self._recorder
        plans = recorder.plans[self._plans_done :]
        self._plans_done += len(plans)
        if not plans or not recorder.ticks:
            return
        ticks = np.searchsorted(recorder.time, [plan.time for plan in plans]).clip(max=recorder.ticks - 1)
        ground = recorder.sole_position[ticks, :, 2].min(axis=1)
        write_plans(self._stream, plans, ground=ground, knot_period=self._knot_period)
        write_planned(self._stream, plans, self._knot_period)
        self._firings.write(plans)

    def _flush_events(self) -> None:
        events = self._recorder.events[self._events_done :]
        self._events_done += len(events)
        self._stream.texts("/log/events", np.array([e.time for e in events]), [e.text for e in events])


def _stride(tick_rate: float, rate: float, sampled: int) -> int:
    stride = round(tick_rate / rate)
    if stride < 1 or abs(stride * rate - tick_rate) > 1e-6 * tick_rate:
        raise WbmpcError(f"recording rate {rate:g} Hz does not divide the tick rate {tick_rate:g} Hz")
    if stride % sampled:
        raise WbmpcError(
            f"recording rate {rate:g} Hz: the recorder keeps only every {sampled}th tick of the controller"
        )
    return stride


def _open(recording: Any, target: Path | str, model: Any) -> None:
    blueprint = layout(_look_at(model))
    if isinstance(target, str):
        recording.connect_grpc(target, default_blueprint=blueprint)
        return
    with writing(target):
        target.unlink(missing_ok=True)
        with _begun(target).open("wb"):  # rerun reports an unwritable file from a thread of its own, too late
            pass
    recording.save(_begun(target), default_blueprint=blueprint)


def _look_at(model: Any) -> Any:
    """(3,) [m] the robot's CoM at the start."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[1 if model.nbody > 1 else 0]


def _begun(path: Path) -> Path:
    """Where the file is until the run's beginning is in it."""
    return path.with_name(path.name + ".partial")


def _packed(model: Any) -> bytes:
    """The compiled model in MuJoCo's binary format, compressed."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return zlib.compress(buffer.tobytes())
