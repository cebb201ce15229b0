"""What a recording holds so that its run can be made again and compared: the run as data, and its state's checksums."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wbmpc.errors import WbmpcError
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.documents import VERDICT
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.stream import Stream
from wbmpc.rerun_sink.timing import SCHEDULE
from wbmpc.timing import Schedule

_RUN, _PROGRESS = "/replay", "/replay/progress"


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run as its recording tells it, up to the last tick that is in the file."""

    document: Mapping[str, Any]  # what was given to RerunSink as `replay`
    schedule: Schedule
    state_sha256: str
    checksums: NDArray[np.uint32]  # (ticks,)


def checksums(recorder: Recorder, since: int = 0) -> NDArray[np.uint32]:
    """(ticks - since,) CRC-32 of each tick's (qpos, qvel): they tell where two runs part, which a hash cannot."""
    states = np.ascontiguousarray(recorder.states[since:])
    return np.fromiter(map(crc32, states), np.uint32, len(states))


def describe_run(stream: Stream, document: Mapping[str, Any]) -> None:
    """Keep the run as data: JSON, whose numbers read back as the same bits."""
    stream.static(_RUN, rr.AnyValues(run=json.dumps(document)))


def write_progress(stream: Stream, recorder: Recorder, since: int) -> None:
    """Send the hash over all ticks so far and the checksums of those from `since` on, as one row."""
    if recorder.ticks == since:
        return
    stream.values(
        _PROGRESS,
        recorder.time[-1:],
        ticks=[recorder.ticks],
        state_sha256=[recorder.state_sha256],
        checksums=[checksums(recorder, since)],
    )


def recorded_verdict(recording: Recording) -> dict[str, Any] | None:
    """The content of NAME.json; None when the run did not come to its end."""
    text = recording.static(VERDICT, "json")
    return json.loads(text[0]) if text else None


def recorded_run(recording: Recording) -> RecordedRun:
    """What the recording says of its run.

    Raises:
        WbmpcError: it holds no schedule, or not one tick.
    """
    text = recording.static(_RUN, "run")
    if not text:
        raise WbmpcError(f"{recording.path}: holds no schedule of plans (an interactive run cannot be made again)")
    _, hashes = recording.column(_PROGRESS, "state_sha256")
    if not hashes:
        raise WbmpcError(
            f"{recording.path}: no tick is in it: it was cut short before the end of the first block of ticks "
            "(of a real-time run there is only one, written when it ends)"
        )
    sums = np.concatenate(recording.column(_PROGRESS, "checksums")[1])
    snapshots, effects = (
        [int(row[0]) for row in recording.column(SCHEDULE, name)[1]] for name in ("snapshot_tick", "effect_tick")
    )
    schedule = Schedule(dict(zip(snapshots, effects, strict=True)), len(sums))
    return RecordedRun(json.loads(text[0]), schedule, str(hashes[-1][0]), sums.astype(np.uint32))
