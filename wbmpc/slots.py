"""When ticks belong on the wall clock: evenly, at a pace that may change, with pauses."""

from __future__ import annotations


class Slots:
    """Tick k belongs at `of(k)` [s] of `perf_counter`: at `start + k · step` as long as nobody intervenes."""

    def __init__(self, start: float, step: float) -> None:
        """Tick 0 at `start` [s], the others `step` [s] after each other."""
        self._origin, self._first, self._period = start, 0, step
        self._step = step

    def of(self, tick: int) -> float:
        """[s] the place of a tick at the present pace."""
        return self._origin + (tick - self._first) * self._period

    def go_on(self, tick: int, pace: float, *, at: float | None = None) -> None:
        """From `tick` on time goes by at `pace` times the wall clock's; that tick belongs at `at`, or as before."""
        self._origin, self._first, self._period = self.of(tick) if at is None else at, tick, self._step / pace

    def start(self, tick: int) -> float:
        """[s] when tick 0 would have been if all before `tick` had gone by at full pace, without a pause."""
        return self.of(tick) - tick * self._step
