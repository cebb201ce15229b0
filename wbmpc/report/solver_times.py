"""Solver times of a run: a row a stage with p50, p99 and max, and where the recording has them, their distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.rerun_sink.reading import Recording

FloatArray = NDArray[np.float64]
_PLANNER = ("stage1", "stage2", "stage3", "plan")  # columns of /solvers/plan
_BINS = 48


@dataclass(frozen=True, slots=True)
class SolverRow:
    """One stage."""

    name: str
    solves: Any
    failures: Any
    p50: float | None  # [ms]
    p99: float | None
    most: float | None
    bars: Sequence[float] = ()  # heights in percent of the tallest, over the table's common axis


@dataclass(frozen=True, slots=True)
class SolverTimes:
    """The table; `low` and `high` [ms] are the ends of its logarithmic axis."""

    rows: Sequence[SolverRow]
    low: float = 0.0
    high: float = 0.0
    sampled: bool = False  # the numbers come from the recording, for want of a verdict


def solver_times(verdict: Mapping[str, Any], recording: Recording | None) -> SolverTimes | None:
    """The table of a run; None when nothing was solved.

    The verdict counts every solve. A recording holds every plan, and of the tracker the slowest tick of each sample,
    which is what its distribution shows.
    """
    recorded = _recorded(recording) if recording is not None else {}
    counted = verdict.get("solver")
    counted = counted if isinstance(counted, Mapping) else {}
    names = [*counted, *(name for name in recorded if name not in counted)]
    if not names:
        return None
    everything = np.concatenate([*recorded.values(), np.zeros(0)])
    positive = everything[everything > 0]
    low, high = (float(positive.min()), float(positive.max())) if len(positive) else (0.0, 0.0)
    edges = np.geomspace(low, max(high, low * 1.01), _BINS + 1) if low else np.zeros(0)
    rows = [_row(name, counted.get(name), recorded.get(name, np.zeros(0)), edges) for name in names]
    return SolverTimes(rows, low, high, sampled=not counted)


def _row(name: str, counted: Any, times: FloatArray, edges: FloatArray) -> SolverRow:
    bars: list[float] = []
    if len(times) and len(edges):
        counts, _ = np.histogram(times, edges)
        bars = [round(100 * float(c) / max(int(counts.max()), 1), 1) for c in counts]
    if isinstance(counted, Mapping):
        p50, p99, most = (_milliseconds(counted.get(level)) for level in ("p50", "p99", "max"))
        return SolverRow(name, counted.get("solves"), counted.get("failures"), p50, p99, most, bars)
    p50, p99, most = (float(v) for v in np.percentile(times, [50, 99, 100])) if len(times) else (None, None, None)
    return SolverRow(name, None if name == "tracker" else len(times), None, p50, p99, most, bars)


def _recorded(recording: Recording) -> dict[str, FloatArray]:
    """[ms] by stage, of those that ran."""
    found: dict[str, FloatArray] = {}
    _, ticks = recording.column("/solvers/tracker", "scalars")
    if ticks:
        found["tracker"] = np.ravel(ticks).astype(float)
    _, plans = recording.column("/solvers/plan", "scalars")
    if plans:
        found |= dict(zip(_PLANNER, np.array(plans, float).T, strict=False))
    return {name: times[np.isfinite(times)] for name, times in found.items() if np.isfinite(times).any()}


def _milliseconds(seconds: Any) -> float | None:
    return 1e3 * seconds if isinstance(seconds, int | float) else None
