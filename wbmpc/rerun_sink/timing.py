"""Columns of the loop's clock: how late ticks began, how long they took, how old plans were at their first use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.palette import FAULT, MEASURED, PLANNED
from wbmpc.rerun_sink.stream import Stream, worst_since_last
from wbmpc.timing import LoopTiming

SCHEDULE = "/timing/schedule"


def describe_timing(stream: Stream) -> None:
    """Names and colours of everything that this file sends."""
    stream.series("/timing/tick_start_late", ["latest begin since the last sample [ms]"], [FAULT])
    stream.series("/timing/tick_time", ["longest tick since the last sample [ms]"], [MEASURED])
    stream.series("/timing/plan_latency", ["from snapshot to first use [ms]"], [PLANNED])
    stream.series("/timing/plan_ready", ["from snapshot to ready [ms]"], [MEASURED])


def write_tick_timing(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], stride: int) -> None:
    """Send the ticks `rows`, every `stride`-th; each carries the worst since the one before."""
    timing = recorder.timing
    rows = rows[rows < timing.ticks]
    if not len(rows):  # a recorder that no loop fills
        return
    time = recorder.time[rows]
    columns = {"tick_time": timing.tick_time}
    if timing.realtime:  # in lockstep there is no clock to be late against
        columns["tick_start_late"] = timing.tick_late
    for name, column in columns.items():
        stream.scalars(f"/timing/{name}", time, 1e3 * worst_since_last(column, rows, stride))


def write_plan_timing(stream: Stream, timing: LoopTiming, since: int) -> int:
    """Send the plans from the `since`-th on, at the times of their first use: latency, and the ticks for a replay.

    Returns the number of plans that are sent by now.
    """
    until = len(timing.ready or timing.effects)  # whole rows, while a loop goes on
    snapshots, effects = timing.snapshots[since:until], timing.effects[since:until]
    if not effects:
        return since
    time = np.array(effects) * timing.timestep
    stream.scalars("/timing/plan_latency", time, 1e3 * timing.plan_latency[since:until])
    if timing.ready:
        stream.scalars("/timing/plan_ready", time, 1e3 * timing.plan_ready[since:until])
    stream.values(SCHEDULE, time, snapshot_tick=snapshots, effect_tick=effects)
    return until
