"""Thin layer over a rerun recording stream: whole blocks of rows at once, on the one timeline `time` [s].

A logging call a tick costs about 0.1 ms; a column of a hundred rows costs as much, once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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


class Stream:
    """Writes blocks of rows; remembers the last state of each state lane so that only changes are written."""

    def __init__(self, recording: Any) -> None:
        self.recording = recording
        self._last_state: dict[str, str] = {}

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
            # Rounded, not truncated: 0.003 s must not become 2 999 999 ns.
            nanoseconds = np.round(np.asarray(time) * 1e9).astype("timedelta64[ns]")
            self.recording.send_columns(path, indexes=[rr.TimeColumn(TIMELINE, duration=nanoseconds)], columns=columns)

    def scalars(self, path: str, time: NDArray[np.float64], values: ArrayLike) -> None:
        """Curves: `values` is (n,) or (n, k) for k curves of one entity."""
        rows = np.asarray(values, dtype=float).reshape(len(time), -1)
        columns = rr.Scalars.columns(scalars=rows.ravel())
        self.columns(path, time, columns.partition(np.full(len(rows), rows.shape[1])))

    def series(self, path: str, names: Sequence[str], colours: Sequence[Colour], width: float = 1.5) -> None:
        """Names and colours of the curves of one entity."""
        self.static(
            path,
            rr.SeriesLines(names=[drawable(name) for name in names], colors=list(colours), widths=[width] * len(names)),
        )

    def points(self, path: str, time: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
        """Points (n, 3) or (n, k, 3) [m]; a point with a nan is not there at that time."""
        flat, lengths = _present(np.asarray(positions, float).reshape(len(time), -1, 3))
        self.columns(path, time, rr.Points3D.columns(positions=flat).partition(lengths))

    def force_arrows(
        self,
        path: str,
        time: NDArray[np.float64],
        origins: NDArray[np.float64],
        forces: NDArray[np.float64],
        lengths: NDArray[np.integer],
    ) -> None:
        """Forces (c, 3) [N] at origins (c, 3) [m], lengths[i] of them at time i."""
        columns = rr.Arrows3D.columns(origins=origins, vectors=forces * METRES_PER_NEWTON)
        self.columns(path, time, columns.partition(lengths))

    def strips(self, path: str, time: NDArray[np.float64], strips: list[list[NDArray[np.float64]]]) -> None:
        """Lines: strips[i] are the polylines, each (k, 3) [m], at time i."""
        columns = rr.LineStrips3D.columns(strips=_arrow_strips([strip for row in strips for strip in row]))
        self.columns(path, time, columns.partition([len(row) for row in strips]))

    def values(self, path: str, time: NDArray[np.float64], **values: Sequence[Any]) -> None:
        """Values that no view draws, of any type: one, or an array of them, of each name at each time."""
        columns = [
            column
            for name, rows in values.items()
            for column in rr.DynamicArchetype.columns(
                # Named: the reader tells an archetype's components from timelines by it.
                archetype=_VALUES,
                components={name: np.concatenate([np.atleast_1d(row) for row in rows])},
            ).partition([np.size(row) for row in rows])
        ]
        self.columns(path, time, columns)

    def states(self, path: str, time: NDArray[np.float64], states: Sequence[str]) -> None:
        """A lane of a state timeline: only the changes are written."""
        last = self._last_state.get(path)
        changes = [i for i, state in enumerate(states) if state != (states[i - 1] if i else last)]
        if states:
            self._last_state[path] = states[-1]
        self.columns(
            path, np.asarray(time)[changes], rr.StateChange.columns(state=[drawable(states[i]) for i in changes])
        )

    def texts(self, path: str, time: NDArray[np.float64], texts: Sequence[str], level: str = "INFO") -> None:
        """Lines of the text log."""
        self.columns(
            path, time, rr.TextLog.columns(text=[drawable(text) for text in texts], level=[level] * len(texts))
        )


def _arrow_strips(strips: list[NDArray[np.float64]]) -> pa.Array:
    """Polylines, each (k, 3), in the file's own memory layout: rerun would convert them one by one."""
    kind = rr.components.LineStrip3DBatch._ARROW_DATATYPE
    points = np.concatenate([*strips, np.empty((0, 3))]).astype(np.float32)
    offsets = np.cumsum([0, *(len(strip) for strip in strips)]).astype(np.int32)
    flat = pa.FixedSizeListArray.from_arrays(pa.array(points.ravel()), type=kind.value_type)
    return pa.ListArray.from_arrays(offsets, flat, type=kind)


def _present(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, k, 3) -> the finite points in one list, and how many belong to each row."""
    finite = np.isfinite(positions).all(axis=2)
    return positions[finite], finite.sum(axis=1)
