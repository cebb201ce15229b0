"""Where two runs differ: the first tick, each signal's first difference and largest, the metrics and checks."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import recorded_run, recorded_verdict

FloatArray = NDArray[np.float64]
SAME_TIME = 1e-7  # [s] the file's times are whole nanoseconds, of ticks that are sums of timesteps
# Wall times, which differ from run to run.
_WALL_CLOCK = ("/solvers/plan", "/solvers/tracker", "/timing/tick_", "/timing/plan_ready")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Two numbers are the same within atol + rtol · the larger size."""

    atol: float = 0.0
    rtol: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether every bit counts."""
        return self.atol == self.rtol == 0.0

    def differ(self, a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
        """Elementwise; two nan, or two equal infinities, are the same."""
        with np.errstate(invalid="ignore"):
            near = np.abs(a - b) <= self.atol + self.rtol * np.maximum(np.abs(a), np.abs(b))
        return ~(near & np.isfinite(a) & np.isfinite(b) | (a == b) | (np.isnan(a) & np.isnan(b)))


@dataclass(frozen=True, slots=True)
class NumberRow:
    """A metric or the value of a check in both runs; None where one does not have it or could not measure it."""

    name: str
    a: float | None
    b: float | None
    differs: bool


@dataclass(frozen=True, slots=True)
class SignalRow:
    """A signal that differs."""

    name: str
    time: float  # [s] of the first sample that differs
    a: str  # what it is then
    b: str
    largest: float  # difference; nan for words
    largest_time: float  # [s]


@dataclass(frozen=True, slots=True)
class Comparison:
    """How two runs differ."""

    numbers: tuple[NumberRow, ...]
    signals: tuple[SignalRow, ...]  # in order of their first difference; empty when one of both is no recording
    first_tick: int | None  # of the state, to the bit; None: equal, or not known
    ticks: tuple[int, int] | None  # length of each run; None when one of both is no recording
    same: bool  # within the tolerance


def read_result(path: Path) -> tuple[dict[str, Any], Recording | None]:
    """The verdict of a .json or .rrd file, and the recording if it is one.

    Raises:
        WbmpcError: no such file, or neither a verdict nor a recording of a run.
    """
    if path.suffix == ".rrd":
        recording = Recording(path)
        return recorded_verdict(recording) or {"metrics": {}, "checks": []}, recording
    if path.suffix != ".json":
        raise WbmpcError(f"{path}: neither NAME.json nor NAME.rrd")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise WbmpcError(f"{path}: {error.strerror}") from None
    except ValueError as error:
        raise WbmpcError(f"{path}: not JSON: {error}") from None
    if not isinstance(document, dict) or not {"metrics", "checks", "state_sha256"} <= document.keys():
        raise WbmpcError(f"{path}: not the verdict of a run (it has no metrics, checks and state_sha256)")
    try:
        numbers_of(document)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise WbmpcError(
            f"{path}: not the verdict of a run (metrics: a number or null by name; checks: a list of name and value)"
        ) from None
    return document, None


def numbers_of(verdict: Mapping[str, Any]) -> dict[str, float | None]:
    """Metrics and the values of checks, by name; None where one could not be measured."""
    values = {f"metrics.{name}": value for name, value in verdict["metrics"].items()}
    values |= {f"checks.{row['name']}": row["value"] for row in verdict["checks"]}
    return {name: None if value is None else float(value) for name, value in values.items()}


def compare_results(a: Path, b: Path, tolerance: Tolerance) -> Comparison:
    """Compare two results, .json or .rrd each; with two recordings every signal, too.

    Raises:
        WbmpcError: one of them is neither, or holds no tick.
    """
    (first, one), (second, other) = read_result(a), read_result(b)
    numbers = tuple(_numbers(first, second, tolerance))
    same = not any(row.differs for row in numbers)
    if one is None or other is None:
        hashes = {document.get("state_sha256") for document in (first, second)}
        return Comparison(numbers, (), None, None, same and (len(hashes) == 1 or not tolerance.exact))
    sums = [recorded_run(recording).checksums for recording in (one, other)]
    common = min(len(s) for s in sums)
    parted = np.flatnonzero(sums[0][:common] != sums[1][:common])
    tick = int(parted[0]) if parted.size else None if len(sums[0]) == len(sums[1]) else common
    signals = sorted(_signals(one, other, tolerance), key=lambda row: row.time)
    same = same and not signals and len(sums[0]) == len(sums[1]) and (tick is None or not tolerance.exact)
    return Comparison(numbers, tuple(signals), tick, (len(sums[0]), len(sums[1])), same)


def _numbers(a: Mapping[str, Any], b: Mapping[str, Any], tolerance: Tolerance) -> Iterator[NumberRow]:
    sides = [numbers_of(verdict) for verdict in (a, b)]
    for name in dict.fromkeys([*sides[0], *sides[1]]):
        x, y = (side.get(name) for side in sides)
        pair = [np.array([np.nan if value is None else value], float) for value in (x, y)]
        missing = (name in sides[0]) != (name in sides[1])
        yield NumberRow(name, x, y, bool(tolerance.differ(*pair)[0]) or missing)


def _signals(a: Recording, b: Recording, tolerance: Tolerance) -> Iterator[SignalRow]:
    for entity in sorted({*a.entities("scalars"), *b.entities("scalars")}):
        if not entity.startswith(_WALL_CLOCK):
            yield from _curves(entity, a, b, tolerance)
    if tolerance.exact:  # words have no tolerance, nor the times at which they change
        for component in ("state", "text"):
            for entity in sorted({*a.entities(component), *b.entities(component)}):
                if entity != "/planner/candidates":  # the same as /log/candidates, as a table
                    yield from _words(entity, a.column(entity, component), b.column(entity, component))


def _curves(entity: str, a: Recording, b: Recording, tolerance: Tolerance) -> Iterator[SignalRow]:
    (time, x), (other_time, y) = a.column(entity, "scalars"), b.column(entity, "scalars")
    common = min(len(time), len(other_time))
    apart = np.flatnonzero(np.abs(time[:common] - other_time[:common]) > SAME_TIME)
    common = int(apart[0]) if apart.size else common
    width = min((len(row) for row in [*x[:1], *y[:1]]), default=0)
    names = a.static(entity, "names")
    if common:
        left, right = (np.array([row[:width] for row in rows[:common]], float) for rows in (x, y))
        differ, gap = tolerance.differ(left, right), np.abs(left - right)
        for k in np.flatnonzero(differ.any(axis=0)):
            first, worst = int(np.argmax(differ[:, k])), int(np.argmax(np.nan_to_num(gap[:, k], nan=-1.0)))
            label = (
                f"{entity} {names[k]}" if k < len(names) and width > 1 else f"{entity}[{k}]" if width > 1 else entity
            )
            values = (f"{left[first, k]:.6g}", f"{right[first, k]:.6g}")
            largest = float(gap[worst, k]), float(time[worst])
            yield SignalRow(label, float(time[first]), values[0], values[1], *largest)
    if apart.size or len(time) != len(other_time):
        ends = [f"sample at {t[common]:.3f} s" if common < len(t) else "no sample" for t in (time, other_time)]
        when = min(float(t[common]) for t in (time, other_time) if common < len(t))
        yield SignalRow(entity, when, ends[0], ends[1], np.nan, np.nan)


def _words(entity: str, a: tuple[Any, Any], b: tuple[Any, Any]) -> Iterator[SignalRow]:
    lines = [[(float(t), str(row[0])) for t, row in zip(*column, strict=True) if len(row)] for column in (a, b)]
    for k in range(max(len(rows) for rows in lines)):
        pair = [rows[k] if k < len(rows) else (np.inf, "nothing more") for rows in lines]
        if pair[0][1] != pair[1][1] or abs(pair[0][0] - pair[1][0]) > SAME_TIME:
            yield SignalRow(entity, min(t for t, _ in pair), pair[0][1], pair[1][1], np.nan, np.nan)
            return
