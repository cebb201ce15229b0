"""The latest available plan: one immutable object, swapped whole."""

from __future__ import annotations

from collections import deque

from wbmpc.planner.plan import Plan


class Mailbox:
    """Hands plans from the planner to the tracker; a plan is visible from its `available_at` on.

    Plans are posted in the order of their `available_at`. One writer and one reader may be in different threads:
    deque's append and popleft are atomic, and a plan never changes once it is posted.
    """

    def __init__(self) -> None:
        self._posted: deque[tuple[float, Plan]] = deque()
        self._current: Plan | None = None

    def post(self, plan: Plan, *, available_at: float) -> None:
        """Leave a plan that takes effect at `available_at` [s]."""
        self._posted.append((available_at, plan))

    def arrived(self, time: float) -> list[Plan]:
        """Plans that became available up to `time` [s] and were not seen before, the oldest first."""
        plans = []
        while self._posted and self._posted[0][0] <= time + 1e-9:
            plans.append(self._posted.popleft()[1])
        if plans:
            self._current = plans[-1]
        return plans

    def latest(self, time: float) -> Plan | None:
        """The newest plan available at `time` [s]; None before the first."""
        self.arrived(time)
        return self._current
