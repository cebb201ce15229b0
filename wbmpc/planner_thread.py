"""A planner in a thread of the ticks' process, for the real-time loop."""

from __future__ import annotations

from collections.abc import Sequence
from queue import Empty, SimpleQueue
from threading import Thread

from wbmpc.mailbox import Mailbox
from wbmpc.planner.planner import Planner
from wbmpc.signals import RobotState, TargetMove

Request = tuple[RobotState, Sequence[TargetMove]]


class PlannerThread:
    """Solves on the newest snapshot it was given and posts the plan; a context manager: start on entry, join on exit.

    `request` and `check` belong to the tick thread and never wait for the planner.
    """

    def __init__(self, planner: Planner, mailbox: Mailbox) -> None:
        """`planner` is used by this thread alone from entry to exit; `mailbox` receives its plans."""
        self._planner, self._mailbox = planner, mailbox
        self._requests: SimpleQueue[Request | None] = SimpleQueue()  # None: stop
        self._thread = Thread(target=self._run, name="planner", daemon=True)
        self._error: BaseException | None = None
        self._at = 0.0  # [s] time of the snapshot in work
        self.skipped = 0  # snapshots that a newer one replaced

    def request(self, snapshot: RobotState, orders: Sequence[TargetMove] = ()) -> None:
        """Ask for a plan, under new orders. The snapshot must not change afterwards."""
        self._requests.put((snapshot, orders))

    def check(self) -> None:
        """Raise a RuntimeError when the planner has raised, from what it raised."""
        if self._error is not None:
            raise failure(self._at, self._error) from self._error

    def __enter__(self) -> PlannerThread:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._requests.put(None)
        self._thread.join()

    def _run(self) -> None:
        try:
            while (request := self._newest()) is not None:
                snapshot, orders = request
                self._at = snapshot.time
                for order in orders:
                    self._planner.order(order)
                # Ready is ready: whichever tick comes next may use it.
                self._mailbox.post(self._planner.solve(snapshot), available_at=snapshot.time)
        except BaseException as error:  # a thread cannot raise into another: `check` does
            self._error = error

    def _newest(self) -> Request | None:
        """Wait for a request; of several that wait, the newest, with the orders of all. None: stop."""
        newest = self._requests.get()
        while newest is not None:
            try:
                following = self._requests.get_nowait()
            except Empty:
                break
            self.skipped += following is not None
            newest = following if following is None else replaced(newest, following)
        return newest


def replaced(request: Request, newer: Request) -> Request:
    """The newer of two requests, with the orders of both."""
    return newer[0], [*request[1], *newer[1]]


def failure(time: float, error: BaseException) -> RuntimeError:
    """What to raise when the planner raised `error` on the snapshot of `time` [s]."""
    return RuntimeError(f"the planner ended on the snapshot of {time:.3f} s: {type(error).__name__}: {error}")
