"""What the loop's clock saw: when each tick began and how long it took, and when each plan took effect.

Wall times differ from run to run: nothing here is part of a verdict, of the state's hash or of anything compared. The
ticks at which plans took effect are what a replay needs, and all that it needs, to repeat a threaded run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Schedule:
    """Which snapshots are planned, and when each plan takes effect."""

    effects: Mapping[int, int]  # tick of a snapshot -> tick from which its plan is in effect, the same or a later one
    ticks: int  # length of the run

    @classmethod
    def constant(cls, *, period: int, delay: int, ticks: int) -> Schedule:
        """A plan every `period` ticks but at tick 0, each in effect `delay` ticks after its snapshot."""
        return cls({k: k + delay for k in range(period, ticks, period)}, ticks)


class LoopTiming:
    """One row a tick and one a plan; a tick's row is two stores into preallocated arrays.

    Args:
        expected_ticks: rows allocated at the start; more ticks cost one copy at each doubling.
    """

    def __init__(self, *, expected_ticks: int) -> None:
        self._rows = np.zeros((2, max(1, expected_ticks)))
        self._late, self._duration = self._rows
        self._ticks = 0
        self.timestep = nan  # [s]
        self.realtime = False  # whether there was a wall clock to keep up with
        self.realtime_priority = False  # whether the ticks' thread came before all ordinary ones
        self.wall_time = 0.0  # [s] of the loop
        self.simulated_time = 0.0  # [s]
        self.missed_deadlines = 0  # ticks that began more than a timestep late; 0 in lockstep
        self.late_plans = 0  # not ready by their delay, nor one planner period after their snapshot; 0 in lockstep
        self.skipped_plans = 0  # snapshots that a newer one replaced before the planner came to them; 0 in lockstep
        self.snapshots: list[int] = []  # ticks of the snapshots that were planned
        self.effects: list[int] = []  # ticks from which those plans were in effect
        self.ready: list[int] = []  # ticks at which a planner in its thread had them ready

    def begin(self, *, timestep: float, realtime: bool) -> None:
        """Say what kind of loop fills this, before its first tick."""
        self.timestep, self.realtime = timestep, realtime

    def tick(self, late: float, duration: float) -> None:
        """One tick: by how much it began late [s], 0 in lockstep, and the wall time that it took [s]."""
        k = self._ticks
        if k == len(self._late):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)], axis=1)
            self._late, self._duration = self._rows
        self._late[k] = late
        self._duration[k] = duration
        self._ticks = k + 1

    def plan(self, *, snapshot: int, effect: int, ready: int | None = None) -> None:
        """One plan: the ticks of its snapshot, of its first use, and, from a thread, of when it was there."""
        self.snapshots.append(snapshot)
        self.effects.append(effect)
        if ready is not None:
            self.ready.append(ready)

    @property
    def ticks(self) -> int:
        """Number of ticks so far."""
        return self._ticks

    @property
    def tick_late(self) -> FloatArray:
        """(ticks,) [s] by how much each tick began after its slot of the wall clock; zeros in lockstep."""
        return self._late[: self._ticks]

    @property
    def tick_time(self) -> FloatArray:
        """(ticks,) [s] wall time of each tick."""
        return self._duration[: self._ticks]

    @property
    def plan_latency(self) -> FloatArray:
        """(plans,) [s] the loop's time from each plan's snapshot to its first use."""
        effects = np.array(self.effects, int)  # before the snapshots, which a reader in another thread may see more of
        return (effects - np.array(self.snapshots[: len(effects)], int)) * self.timestep

    @property
    def plan_ready(self) -> FloatArray:
        """(plans,) [s] the loop's time from each plan's snapshot to when it was ready; empty in lockstep."""
        return (np.array(self.ready, int) - np.array(self.snapshots[: len(self.ready)], int)) * self.timestep

    @property
    def drift(self) -> float:
        """By how much simulated time lags the wall clock at the end [s]; negative when it is ahead."""
        return self.wall_time - self.simulated_time

    def summary(self) -> dict[str, float]:
        """The `timing` of NAME.json; nan for what only a run against the wall clock has."""
        ran = self.wall_time > 0
        return {
            "real_time_factor": self.simulated_time / self.wall_time if ran else 0.0,
            "drift": self.drift if self.realtime else nan,
            **_percentiles("tick_late", self.tick_late if self.realtime else ()),
            **_percentiles("tick_time", self.tick_time),
            "ticks": self._ticks,
            "realtime_priority": float(self.realtime_priority),
            "missed_deadlines": self.missed_deadlines,
            "plans": len(self.effects),
            "planner_rate": len(self.effects) / self.wall_time if self.realtime and ran else nan,
            "late_plans": self.late_plans,
            "skipped_plans": self.skipped_plans,
            **_percentiles("plan_ready", self.plan_ready),
            **_percentiles("plan_latency", self.plan_latency),
        }


def _percentiles(name: str, values: ArrayLike) -> dict[str, float]:
    array = np.asarray(values, dtype=float)
    levels = np.percentile(array, [50, 99, 100]) if array.size else (nan, nan, nan)
    return {f"{name}_{level}": float(value) for level, value in zip(("p50", "p99", "max"), levels, strict=True)}
