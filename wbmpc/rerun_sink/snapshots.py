"""The planner's inputs in a recording: every snapshot that was planned from, to the bit, and a digest of its plan."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, lru_cache
from operator import attrgetter
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.stream import Stream
from wbmpc.signals import PlanReport, RobotState

SNAPSHOTS = "/planner/snapshots"
_STATE = ("q", "v", "sole_wrench_in_world", "palm_force_in_world", "mass_scale")
_WALL_TIMES = {"solve_time", "plan_time"}
_DIGEST_BYTES = 16
_BITS = Struct("=d").pack


@dataclass(frozen=True, slots=True)
class RecordedPlan:
    """What one plan was made from, and which plan it was."""

    state: RobotState
    digest: str  # see `digest`


def digest(report: PlanReport) -> str:
    """Of every bit of a plan's report but its wall times: equal for equal plans."""
    parts: list[bytes] = []
    _gather((report,), parts)
    return hashlib.blake2b(b"".join(parts), digest_size=_DIGEST_BYTES).hexdigest()


def write_snapshots(stream: Stream, recorder: Recorder, since: int) -> None:
    """Send the snapshots of the plans from number `since` on; the plan made before the run began has none."""
    planned = recorder.planned[since:]
    if not planned:
        return
    time = np.array([state.time for state, _ in planned])
    columns = {name: np.array([getattr(state, name) for state, _ in planned]) for name in _STATE}
    digests = [digest(report) for _, report in planned]
    stream.values(SNAPSHOTS, time, snapshot_time=time, digest=digests, **columns)


def recorded_plans(recording: Recording) -> Sequence[RecordedPlan]:
    """The plans of a recording in order; empty for one that is older than this module."""
    columns: dict[str, list[NDArray[Any]]] = {
        name: recording.column(SNAPSHOTS, name)[1] for name in ("snapshot_time", "digest", *_STATE)
    }
    return [
        RecordedPlan(
            RobotState(
                time=float(time[0]),
                q=q,
                v=v,
                sole_wrench_in_world=sole.reshape(2, 6),
                palm_force_in_world=palm.reshape(2, 3),
                mass_scale=float(mass[0]),
            ),
            str(made[0]),
        )
        for time, made, q, v, sole, palm, mass in zip(*columns.values(), strict=True)
    ]


def _gather(values: Iterable[Any], parts: list[bytes]) -> None:
    """Append what tells each of `values` from every other, type by type; floats to the bit."""
    for value in values:
        kind = value.__class__
        if kind is np.ndarray:
            parts += (_text(value.shape), value.tobytes())
        elif kind is float or kind is np.float64:
            parts.append(_BITS(value))
        elif kind is tuple:
            parts.append(_text(len(value)))
            _gather(value, parts)
        elif (fields_of := _fields(kind)) is not None:
            _gather(fields_of(value), parts)
        else:
            parts.append(_text(value))


@lru_cache(maxsize=256, typed=True)  # 1, True and an enum's member are not the same
def _text(value: object) -> bytes:
    """Of a text, a small number, a shape, or None: few are different, and they come back in every plan."""
    return repr(value).encode()


@cache
def _fields(kind: type) -> Callable[[Any], tuple[Any, ...]] | None:
    """Gives those fields of a dataclass that a plan is told by; None: `kind` is none."""
    return attrgetter(*(f.name for f in fields(kind) if f.name not in _WALL_TIMES)) if is_dataclass(kind) else None
