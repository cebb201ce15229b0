"""A planner in a process of its own, for the real-time loop: its Python takes no turns of the ticks' interpreter."""

from __future__ import annotations

from typing import Any

from wbmpc.loop import Session
from wbmpc.planner.plan import Plan
from wbmpc.planner.planner import Planner
from wbmpc.pool import Died, Worker, available_cores
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world, robot_path
from wbmpc.signals import RobotState, TargetMove
from wbmpc.warm_up import compile_kernels

_planner: Planner | None = None  # of this process, when it is the planner's


class PlannerProcess:
    """The planner of a scenario that has made its first plan, as `Session` does; a context manager.

    `solve` waits for the answer without the interpreter's lock. Snapshots and plans go through a pipe, which keeps
    every bit; the two planners of a run, this one and the session's, never meet.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Start the process and wait until it is ready.

        Raises:
            RuntimeError: the process has ended instead.
        """
        # On a machine of one core the ticks need what waiting would take.
        self._worker: Worker[Any, Any] = Worker(_serve, 0, scenario, awake=available_cores() > 1)
        self._answer()

    def order(self, move: TargetMove) -> None:
        """See `Tasks.order`; the process takes it before the next snapshot."""
        self._worker.give(0, move)
        self._answer()

    def solve(self, state: RobotState) -> Plan:
        """See `Planner.solve`.

        Raises:
            RuntimeError: the process has ended.
            Exception: whatever the planner raised.
        """
        self._worker.give(0, state)
        plan: Plan = self._answer()
        return plan

    def __enter__(self) -> PlannerProcess:
        return self

    def __exit__(self, *exception: object) -> None:
        self._worker.end()

    def _answer(self) -> Any:
        answer = self._worker.result()
        if isinstance(answer, Died):
            raise RuntimeError(f"the planner is gone: {answer.reason}")
        return answer


def _serve(item: Scenario | TargetMove | RobotState) -> Plan | None:
    """In the planner's process: take a scenario and get ready, or an order, or a snapshot and plan."""
    global _planner
    if isinstance(item, Scenario):
        compile_kernels()
        robot = Robot.load(robot_path(item))
        model = build_world(item, robot.path)
        recorder = Recorder(robot, expected_ticks=1, plant_nq=model.nq, plant_nv=model.nv)
        _planner = Session(item, robot=robot, model=model, recorder=recorder).planner
        return None
    assert _planner is not None
    if isinstance(item, TargetMove):
        _planner.order(item)
        return None
    return _planner.solve(item)
