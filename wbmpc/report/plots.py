"""Panels as SVG: numbers become places on a sheet of 1000 by 1000 units that the browser stretches to any width.

Texts are no part of the sheet, or they would be stretched: the templates place them over it, in percent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from wbmpc.figures.panels import HANDS, Band, Curve, Ink, Note, Outline, Panel
from wbmpc.figures.trace import Trace
from wbmpc.signals import SIDES

FloatArray = NDArray[np.float64]
SHEET = 1000  # units of width and height
_POINTS = 800  # of a curve; more cannot be told apart
_PADDING = 0.06  # of the range, above and below
_OUTLIER = 3.0  # a range so many times that of nearly all samples is cut off
_PLAN_MARGIN = 3.0  # [cm] around a plan view


@dataclass(frozen=True, slots=True)
class Tick:
    """A labelled place of an axis."""

    at: float  # [%] from the left, or from the top
    label: str


@dataclass(frozen=True, slots=True)
class Shape:
    """One SVG element."""

    kind: str  # polyline or polygon
    points: str  # "x,y x,y ..."
    ink: str
    label: str = ""  # what the reader is told of it
    width: float = 0.0  # [px]; 0: no line
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Span:
    """A shaded stretch of time, through all panels."""

    start: float  # [%]
    width: float  # [%]
    ink: str
    title: str


@dataclass(frozen=True, slots=True)
class Word:
    """A text over the sheet."""

    x: float  # [%]
    y: float  # [%] from the top
    text: str
    ink: str
    dot: bool


@dataclass(frozen=True, slots=True)
class Key:
    """An entry of a legend."""

    label: str
    ink: str
    kind: str  # line, dashed or area


@dataclass(frozen=True, slots=True)
class Plot:
    """A panel as the template takes it."""

    title: str
    unit: str
    shapes: Sequence[Shape]
    words: Sequence[Word]
    keys: Sequence[Key]
    x_ticks: Sequence[Tick]
    y_ticks: Sequence[Tick]
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    over_time: bool
    height: float  # relative to the others
    aspect: float = 0.0  # width over height of a plan view; 0: as wide as the page


def plot_of(panel: Panel, trace: Trace) -> Plot:
    """One panel on its sheet."""
    if panel.over_time:
        x_range = time_range(trace.time)
        y_range = _value_range(panel)
    else:
        x_range, y_range = _plan_ranges(panel)
    sheet = _Sheet(x_range, y_range)
    shapes = [shape for item in panel.items if not isinstance(item, Note) for shape in sheet.shapes(item)]
    words = [sheet.word(item) for item in panel.items if isinstance(item, Note)]
    aspect = 0.0 if panel.over_time else float(np.ptp(x_range) / np.ptp(y_range))
    return Plot(
        title=panel.title,
        unit=panel.unit,
        shapes=shapes,
        words=words,
        keys=_keys(panel),
        x_ticks=ticks(*x_range, 10),
        y_ticks=[Tick(100 - tick.at, tick.label) for tick in ticks(*y_range, 4)],
        x_range=x_range,
        y_range=y_range,
        over_time=panel.over_time,
        height=panel.height,
        aspect=aspect,
    )


def spans_of(trace: Trace) -> list[Span]:
    """Hand contacts and pushes, as shades."""
    contacts = [
        (c.start, c.end, HANDS[c.side], f"{SIDES[c.side]} hand{' on ' + c.patch if c.patch else ''}")
        for c in trace.hand_contacts
    ]
    pushes = [(start, end, Ink.FAULT, "push") for start, end in trace.pushes]
    low, high = time_range(trace.time)
    return [
        Span(
            100 * (start - low) / (high - low),
            100 * (end - start) / (high - low),
            ink,
            f"{what}, {start:.2f} to {end:.2f} s",
        )
        for start, end, ink, what in [*contacts, *pushes]
    ]


def time_range(time: FloatArray) -> tuple[float, float]:
    """First sample and the end of the last one [s]; never empty."""
    start, last = float(time[0]), float(time[-1])
    return start, last + ((last - start) / (len(time) - 1) if len(time) > 1 else 1e-3)


def ticks(low: float, high: float, most: int) -> list[Tick]:
    """At most `most` round numbers between `low` and `high`, and a few less on a small axis."""
    values = [
        v
        for v in MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
        if low - 1e-9 <= v <= high + 1e-9 * max(1.0, high - low)
    ]
    return [Tick(round(100 * (v - low) / (high - low), 3), f"{v:.6g}".replace("-", "−")) for v in values]


def thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A curve of about `_POINTS` points that keeps every extreme: the least and the greatest of each stretch."""
    if len(x) <= _POINTS:
        return x, y
    edges = np.linspace(0, len(x), _POINTS // 2 + 1).astype(int)
    picked = {0, len(x) - 1}
    for first, stop in pairwise(edges):
        picked |= {first + int(np.argmin(y[first:stop])), first + int(np.argmax(y[first:stop]))}
    rows = np.array(sorted(picked))
    return x[rows], y[rows]


@dataclass(frozen=True, slots=True)
class _Sheet:
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def shapes(self, item: Curve | Band | Outline) -> Iterator[Shape]:
        if isinstance(item, Outline):
            yield Shape("polygon", self._points(*item.corners.T), item.ink, item.label, width=1.0)
        elif isinstance(item, Band):
            for part in _without_gaps(item.x, item.low, item.high):
                x, low = thinned(part[0], part[1])
                x_back, high = thinned(part[0], part[2])
                points = self._points(np.append(x, x_back[::-1]), np.append(low, high[::-1]))
                yield Shape("polygon", points, item.ink, item.label)
        else:
            for part in _without_gaps(item.x, item.y):
                x, y = thinned(*part) if np.all(np.diff(part[0]) > 0) else part
                yield Shape("polyline", self._points(x, y), item.ink, item.label, round(item.width, 2), item.dashed)

    def word(self, note: Note) -> Word:
        x, y = self._place(np.array([note.x]), np.array([note.y]))
        return Word(round(x[0] * 100 / SHEET, 2), round(y[0] * 100 / SHEET, 2), note.text, note.ink, note.dot)

    def _points(self, x: FloatArray, y: FloatArray) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(*self._place(x, y), strict=True))

    def _place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        (left, right), (bottom, top) = self.x_range, self.y_range
        # What is cut off stays near the sheet: some browsers draw numbers of any size badly.
        return (
            np.clip(SHEET * (x - left) / (right - left), -SHEET, 2 * SHEET),
            np.clip(SHEET * (top - y) / (top - bottom), -SHEET, 2 * SHEET),
        )


def _without_gaps(*columns: FloatArray) -> Iterator[tuple[FloatArray, ...]]:
    """The stretches of columns (n,) in which all are finite."""
    finite = np.isfinite(np.column_stack(columns)).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], finite.astype(np.int8), [0]])))
    for first, stop in edges.reshape(-1, 2):
        yield tuple(column[first:stop] for column in columns)


def _value_range(panel: Panel) -> tuple[float, float]:
    """What is to be seen of the y axis: everything, but for outliers far beyond."""
    columns: list[FloatArray] = []
    for item in panel.items:
        if isinstance(item, Curve):
            columns.append(item.y)
        elif isinstance(item, Band):
            columns += [item.low, item.high]
    columns = [column[np.isfinite(column)] for column in columns]
    columns = [column for column in columns if len(column)]
    if not columns:
        return 0.0, 1.0
    low, high = min(c.min() for c in columns), max(c.max() for c in columns)
    near = [np.quantile(c, [0.005, 0.995]) for c in columns]
    least, most = min(n[0] for n in near), max(n[1] for n in near)
    if high - low > _OUTLIER * (most - least) > 0:
        low, high = least, most
    room = _PADDING * (high - low) or max(0.5, 0.1 * abs(high))
    return float(low - room), float(high + room)


def _plan_ranges(panel: Panel) -> tuple[tuple[float, float], tuple[float, float]]:
    points = [item.corners for item in panel.items if isinstance(item, Outline)]
    points += [np.array([[item.x, item.y]]) for item in panel.items if isinstance(item, Note)]
    points += [
        np.column_stack([item.x, item.y])
        for item in panel.items
        if isinstance(item, Curve) and item.ink == Ink.MEASURED
    ]
    everything = np.concatenate(points)
    low, high = np.nanmin(everything, axis=0) - _PLAN_MARGIN, np.nanmax(everything, axis=0) + _PLAN_MARGIN
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def _keys(panel: Panel) -> list[Key]:
    keys: dict[str, Key] = {}
    for item in panel.items:
        if not isinstance(item, Note) and item.label:
            kind = ("dashed" if item.dashed else "line") if isinstance(item, Curve) else "area"
            keys.setdefault(item.label, Key(item.label, item.ink, kind))
    return list(keys.values())
