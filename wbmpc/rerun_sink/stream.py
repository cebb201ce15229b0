"""Thin layer over a rerun recording stream: whole blocks of rows at once, on the one timeline `time` [s].

A logging call a tick costs about 0.1 ms; a column of a hundred rows costs as much, once. Most of that is rerun's
conversion of its arguments, so what is written most often goes out in the file's own memory layout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.palette import METRES_PER_NEWTON

TIMELINE = "time"
_VALUES = "wbmpc"
Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Column:
    """What `send_columns` asks of a column, with nothing left to convert."""

    descriptor: Any
    values: pa.ListArray

    def component_descriptor(self) -> Any:
        """Which component of which archetype."""
        return self.descriptor

    def as_arrow_array(self) -> pa.ListArray:
        """One list a row."""
        return self.values


@dataclass(frozen=True, slots=True)
class Ragged:
    """Arrays of different lengths, one after another."""

    values: NDArray[Any]  # (c,)
    lengths: NDArray[np.integer]  # (n,) whose sum is c


class Component:
    """One component of an archetype: its name and memory layout, learnt from a column that rerun has made."""

    def __init__(self, example: Any) -> None:
        self._descriptor, self._kind = example.component_descriptor(), example.as_arrow_array().type

    def column(self, values: NDArray[np.floating], *offsets: pa.Array) -> Column:
        """Row i has items offsets[i] to offsets[i + 1] of `values` (c,) or (c, k), whose last is c.

        Where an item is itself a list, as a line is one of points, second offsets say which of `values` it has.
        """
        return Column(self._descriptor, _nested(self._kind, values, offsets))


_ZERO, _STILL = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
(_SCALAR,) = map(Component, rr.Scalars.columns(scalars=_ZERO[:, 0]))
(_POSITION,) = map(Component, rr.Points3D.columns(positions=_ZERO))
(_STRIP,) = map(Component, rr.LineStrips3D.columns(strips=[_ZERO]))
(_ORIGIN,) = map(Component, rr.Arrows3D.columns(origins=_ZERO))
(_VECTOR,) = map(Component, rr.Arrows3D.columns(vectors=_ZERO))
(_TRANSLATION,) = map(Component, rr.Transform3D.columns(translation=_ZERO))
(_QUATERNION,) = map(Component, rr.Transform3D.columns(quaternion=_STILL))


class Stream:
    """Writes blocks of rows; remembers the last state of each state lane so that only changes are written."""

    def __init__(self, recording: Any) -> None:
        self.recording = recording
        self._last_state: dict[str, str] = {}
        self._time: NDArray[np.float64] | None = None  # of the last block, and what rerun has made of it
        self._indexes: list[Any] = []

    def static(self, path: str, *archetypes: Any) -> None:
        """What does not change over the run."""
        self.recording.log(path, *archetypes, static=True)

    def document(self, path: str, markdown: str) -> None:
        """A text that does not change over the run."""
        self.static(path, rr.TextDocument(drawable(markdown), media_type="text/markdown"))

    def properties(self, name: str, values: Mapping[str, bool | int | float | str]) -> None:
        """Named values of the whole file: columns of a table over many files."""
        shown = {key: drawable(value) if isinstance(value, str) else value for key, value in values.items()}
        if shown:
            self.recording.send_property(name, rr.AnyValues(**shown))

    def columns(self, path: str, time: NDArray[np.float64], columns: Any) -> None:
        """Any archetype's columns, one row for each `time` (n,) [s]."""
        if len(time):
            if time is not self._time:  # many entities share the times of a block
                # Rounded, not truncated: 0.003 s must not become 2 999 999 ns.
                nanoseconds = np.round(np.asarray(time) * 1e9).astype("timedelta64[ns]")
                self._time, self._indexes = time, [rr.TimeColumn(TIMELINE, duration=nanoseconds)]
            self.recording.send_columns(path, indexes=self._indexes, columns=columns)

    def scalars(self, path: str, time: NDArray[np.float64], values: ArrayLike) -> None:
        """Curves: `values` is (n,) or (n, k) for k curves of one entity."""
        rows = np.asarray(values, dtype=float).reshape(len(time), -1)
        self.columns(path, time, [_SCALAR.column(rows.ravel(), _even(*rows.shape))])

    def poses(
        self, path: str, time: NDArray[np.float64], position: NDArray[np.floating], xyzw: NDArray[np.floating]
    ) -> None:
        """One frame: `position` (n, 3) [m] and quaternion `xyzw` (n, 4) in its parent's."""
        offsets = _even(len(time), 1)
        self.columns(path, time, [_TRANSLATION.column(position, offsets), _QUATERNION.column(xyzw, offsets)])

    def series(self, path: str, names: Sequence[str], colours: Sequence[Colour], width: float = 1.5) -> None:
        """Names and colours of the curves of one entity."""
        self.static(
            path,
            rr.SeriesLines(names=[drawable(name) for name in names], colors=list(colours), widths=[width] * len(names)),
        )

    def points(self, path: str, time: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
        """Points (n, 3) or (n, k, 3) [m]; a point with a nan is not there at that time."""
        flat, lengths = _present(np.asarray(positions, float).reshape(len(time), -1, 3))
        self.columns(path, time, [_POSITION.column(flat, _offsets(lengths))])

    def force_arrows(
        self,
        path: str,
        time: NDArray[np.float64],
        origins: NDArray[np.float64],
        forces: NDArray[np.float64],
        lengths: NDArray[np.integer],
    ) -> None:
        """Forces (c, 3) [N] at origins (c, 3) [m], lengths[i] of them at time i."""
        offsets, vectors = _offsets(lengths), forces * METRES_PER_NEWTON
        self.columns(path, time, [_ORIGIN.column(origins, offsets), _VECTOR.column(vectors, offsets)])

    def strips(
        self,
        path: str,
        time: NDArray[np.float64],
        strips: list[list[NDArray[np.float64]]],
        colours: NDArray[np.uint8] | None = None,
    ) -> None:
        """Lines: strips[i] are the polylines, each (k, 3) [m], at time i; `colours` (s, 4) of all of them in order."""
        flat, lengths = [strip for row in strips for strip in row], [len(row) for row in strips]
        points = np.concatenate([*flat, np.empty((0, 3))])
        columns = [_STRIP.column(points, _offsets(lengths), _offsets([len(strip) for strip in flat]))]
        if colours is not None:
            columns += rr.LineStrips3D.columns(colors=colours).partition(lengths)
        self.columns(path, time, columns)

    def lines(
        self, path: str, time: NDArray[np.float64], points: NDArray[np.float64], lengths: NDArray[np.integer]
    ) -> None:
        """Polylines through points (c, 3) [m], one at time i through lengths[i] of them; without points, none."""
        there = lengths > 0
        column = _STRIP.column(points, _offsets(there), _offsets(lengths[there]))
        self.columns(path, time, [column])

    def values(self, path: str, time: NDArray[np.float64], **values: Sequence[Any] | NDArray[Any] | Ragged) -> None:
        """Values that no view draws, of any type: one, or an array of them, of each name at each time."""
        columns = []
        for name, rows in values.items():
            if isinstance(rows, Ragged):
                flat, offsets = rows.values, _offsets(rows.lengths)
            elif isinstance(rows, np.ndarray):
                flat, offsets = rows.ravel(), _even(len(rows), rows[0].size if len(rows) else 0)
            elif any(map(np.ndim, rows)):
                flat, offsets = np.concatenate([np.ravel(row) for row in rows]), _offsets(list(map(np.size, rows)))
            else:
                flat, offsets = np.asarray(rows), _even(len(rows), 1)
            # Named: the reader tells an archetype's components from timelines by it.
            descriptor = rr.ComponentDescriptor(component=name).with_builtin_archetype(_VALUES)
            columns.append(Column(descriptor, pa.ListArray.from_arrays(offsets, pa.array(flat))))
        self.columns(path, time, columns)

    def states(self, path: str, time: NDArray[np.float64], states: Sequence[str]) -> None:
        """A lane of a state timeline: only the changes are written."""
        last = self._last_state.get(path)
        changes = [i for i, state in enumerate(states) if state != (states[i - 1] if i else last)]
        if changes:
            self._last_state[path] = states[-1]
            column = rr.StateChange.columns(state=[drawable(states[i]) for i in changes])
            self.columns(path, np.asarray(time)[changes], column)

    def texts(self, path: str, time: NDArray[np.float64], texts: Sequence[str], level: str = "INFO") -> None:
        """Lines of the text log."""
        if texts:
            column = rr.TextLog.columns(text=[drawable(text) for text in texts], level=[level] * len(texts))
            self.columns(path, time, column)


def worst_since_last(column: NDArray[np.float64], rows: NDArray[np.integer], stride: int) -> NDArray[np.float64]:
    """(n,) largest value of `column` in the `stride` rows up to each of `rows` (n,), that one included."""
    index = np.maximum(rows[:, None] - np.arange(stride), 0)
    worst: NDArray[np.float64] = column[index].max(axis=1)
    return worst


def _nested(kind: pa.DataType, values: NDArray[np.floating], offsets: tuple[pa.Array, ...]) -> pa.Array:
    if offsets:
        inner = _nested(kind.value_type, values, offsets[1:])
        return pa.ListArray.from_arrays(offsets[0], inner, type=kind)
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(pa.array(values.astype(np.float32, copy=False).ravel()), type=kind)
    return pa.array(values, kind)


@lru_cache(maxsize=256)  # blocks are equally long, but the last one
def _even(rows: int, each: int) -> pa.Array:
    """Offsets of rows that are equally long."""
    return pa.array(np.arange(rows + 1, dtype=np.int32) * np.int32(each))


def _offsets(lengths: ArrayLike) -> pa.Array:
    """Offsets of rows of these lengths."""
    return pa.array(np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32))


def _present(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, k, 3) -> the finite points in one list, and how many belong to each row."""
    finite = np.isfinite(positions).all(axis=2)
    return positions[finite], finite.sum(axis=1)
