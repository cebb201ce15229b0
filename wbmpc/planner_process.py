"""A planner in a process of its own, for the real-time loop: its Python takes no turns of the ticks' interpreter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wbmpc.loop import Session
from wbmpc.mailbox import Mailbox
from wbmpc.planner.plan import Plan
from wbmpc.planner.planner import Planner
from wbmpc.planner_thread import Request, failure, replaced
from wbmpc.pool import Died, Worker, available_cores
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world, robot_path
from wbmpc.signals import RobotState, TargetMove
from wbmpc.warm_up import compile_kernels

_planner: Planner | None = None  # of this process, when it is the planner's


class PlannerProcess:
    """The planner of a scenario that has made its first plan, as `Session` does; to the ticks it is a `PlannerThread`.

    Snapshots and plans go through a pipe, which keeps every bit; the two planners of a run, this one and the session's,
    never meet. The ticks send and fetch themselves, in 0.1 ms: a thread that did it for them would have to wake up
    twice for each plan, and on two cores that are busy it waits up to a millisecond each time.
    """

    def __init__(self, scenario: Scenario, mailbox: Mailbox) -> None:
        """Start the process and wait until it is ready; `mailbox` receives its plans.

        Raises:
            RuntimeError: the process has ended instead.
        """
        # On a machine of one core the ticks need what waiting would take.
        self._worker: Worker[Any, Any] = Worker(_serve, 0, scenario, awake=available_cores() > 1)
        self._answer()
        self._mailbox = mailbox
        self._in_work: float | None = None  # [s] time of the snapshot that the process plans from
        self._waiting: Request | None = None
        self.skipped = 0  # snapshots that a newer one replaced

    def request(self, snapshot: RobotState, orders: Sequence[TargetMove] = ()) -> None:
        """Ask for a plan, under new orders; while one is being made, the newest request waits."""
        request: Request = snapshot, orders
        if self._in_work is None:
            self._send(request)
            return
        if self._waiting is not None:
            request = replaced(self._waiting, request)
            self.skipped += 1
        self._waiting = request

    def check(self) -> None:
        """Post the plan, if it is ready, and hand over what waits.

        Raises:
            RuntimeError: the planner raised, which is the cause, or its process has ended.
        """
        if self._in_work is None or not self._worker.ready():
            return
        try:
            plan: Plan = self._answer()
        except Exception as error:
            raise failure(self._in_work, error) from error
        # Ready is ready: whichever tick comes next may use it.
        self._mailbox.post(plan, available_at=self._in_work)
        self._in_work = None
        if self._waiting is not None:
            self._send(self._waiting)
            self._waiting = None

    def __enter__(self) -> PlannerProcess:
        return self

    def __exit__(self, *exception: object) -> None:
        self._in_work = None  # nobody asks for it any more
        self._worker.end()

    def _send(self, request: Request) -> None:
        self._in_work = request[0].time
        self._worker.give(0, request)

    def _answer(self) -> Any:
        answer = self._worker.result()
        if isinstance(answer, Died):
            raise RuntimeError(f"the planner is gone: {answer.reason}")
        return answer


def _serve(item: Scenario | Request) -> Plan | None:
    """In the planner's process: take a scenario and get ready, or orders and a snapshot, and plan."""
    global _planner
    if isinstance(item, Scenario):
        compile_kernels()
        robot = Robot.load(robot_path(item))
        model = build_world(item, robot.path)
        recorder = Recorder(robot, expected_ticks=1, plant_nq=model.nq, plant_nv=model.nv)
        _planner = Session(item, robot=robot, model=model, recorder=recorder).planner
        return None
    assert _planner is not None
    snapshot, orders = item
    for order in orders:
        _planner.order(order)
    return _planner.solve(snapshot)
