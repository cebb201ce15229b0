"""The real-time loop: the tick of the lockstep loop against the wall clock, the planner beside it."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter, sleep
from typing import Protocol

import mujoco

from wbmpc.loop import FLUSH_TICKS, Session, Sink, no_garbage_collection
from wbmpc.mailbox import Mailbox
from wbmpc.planner.plan import Plan
from wbmpc.planner_process import PlannerProcess
from wbmpc.planner_thread import PlannerThread
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world
from wbmpc.signals import RobotState, TargetMove
from wbmpc.slots import Slots
from wbmpc.timing import LoopTiming

SPIN = 3e-4  # [s] before a deadline in which the tick thread no longer trusts a sleep to end in time
SWITCH_INTERVAL = 1e-4  # [s] after which the tick thread, awake, gets the interpreter back from the planner
PRIORITY = 10  # of SCHED_FIFO, 1 … 99: before everything ordinary, behind what the system itself does
WARM_UP_TICKS = 20  # made in a session that is thrown away: first calls load libraries and compile


def run_realtime(
    scenario: Scenario,
    *,
    robot: Robot,
    recorder: Recorder,
    model: mujoco.MjModel | None = None,
    sink: Sink | None = None,
    on_progress: Callable[[float], None] | None = None,
    ended: Callable[[], str | None] | None = None,
    operator: Operator | None = None,
) -> LoopTiming:
    """Run a scenario against the wall clock; `run_lockstep` has these arguments too, and makes the same ticks.

    The planner has a process of its own, or a thread of this one (`loop.realtime_planner`). A thread shares the
    interpreter with the ticks, and they wait for each other.

    Tick k belongs at `start + k · timestep`. It is never skipped: on a machine that cannot keep up, simulated time lags
    the wall clock, later ticks follow without a pause until the lag is made up, and every tick that begins more than a
    timestep late counts as a missed deadline.

    A plan takes effect `loop.planner_delay` after its snapshot, as in lockstep: a run whose plans are all ready by then
    is the lockstep run, bit for bit. A later one takes effect at the first tick after it is ready; until then the one
    before it is continued. Ticks count the loop's time, so that a lockstep run with the recorded `schedule` repeats
    what late plans have done. A plan that is ready neither by its delay nor within one planner period is counted as
    late, a snapshot that a newer one replaced before the planner came to it as skipped.

    Args:
        operator: asked before every tick; it may slow the clock down, push the robot, give orders, and end the run.
        sink: flushed once, after the last tick, because a flush waits for the file: a killed run leaves an empty one.

    Returns:
        The recorder's `timing`.

    Raises:
        RuntimeError: the planner raised in its thread; says what, and on which snapshot.
    """
    if model is None:
        model = build_world(scenario, robot.path)
    _warm_up(scenario, robot, model)
    session = Session(scenario, robot=robot, model=model, recorder=recorder)
    period, step, timing = scenario.loop.planner_period_ticks, session.step, recorder.timing
    delay = scenario.loop.planner_delay_ticks
    timing.begin(timestep=step, realtime=True)
    finished = Mailbox()  # the tracker sees a plan only when the tick has taken it over and counted its latency
    due = False
    asked: deque[RobotState] = deque()  # snapshots whose plans have not come, the oldest first

    def exchange(state: RobotState) -> None:
        """Take the plans that are ready, hand over a snapshot when one is due."""
        planner.check()
        for plan in finished.arrived(state.time):
            snapshot, ready = round(plan.time / step), recorder.ticks
            effect = max(ready, snapshot + delay)
            session.mailbox.post(plan, available_at=plan.time + (effect - snapshot) * step)
            recorder.append_plan(plan.report, _snapshot_of(plan, asked))
            timing.plan(snapshot=snapshot, effect=effect, ready=ready)
            timing.late_plans += ready - snapshot > max(delay, period)
        if due:
            asked.append(state)
            planner.request(state, operator.orders() if operator is not None else ())

    with (
        _planner(scenario, session, finished) as planner,
        _undisturbed(),
        ahead_of_others() as ahead,
    ):
        timing.realtime_priority = ahead
        slots = Slots(perf_counter(), step)
        for k in range(session.ticks):
            if operator is not None and not operator.attend(session, slots, k):
                recorder.event(session.plant.time, "ended by the operator")
                break
            slot = slots.of(k)
            late = _wait_until(slot)
            timing.missed_deadlines += late > step
            due = k % period == 0 and k > 0
            sound = session.tick(exchange)
            timing.tick(late, perf_counter() - slot - late)
            if not sound:
                recorder.event(session.plant.time, "state is not finite, run ended")
                break
            if (k + 1) % FLUSH_TICKS == 0:
                if on_progress is not None:
                    on_progress(session.plant.time)
                if ended is not None and (reason := ended()):
                    recorder.event(session.plant.time, f"{reason}, run ended")
                    break
        timing.wall_time, timing.simulated_time = perf_counter() - slots.start(timing.ticks), session.plant.time
    planner.check()
    timing.skipped_plans = planner.skipped
    if sink is not None:
        sink.flush(session.plant.time)
    return timing


class Operator(Protocol):
    """Somebody who watches a run against the wall clock and takes part in it."""

    def attend(self, session: Session, slots: Slots, tick: int) -> bool:
        """Called before every tick, so nearly always with nothing to do; False ends the run."""
        ...

    def orders(self) -> Sequence[TargetMove]:
        """What the planner is told with its next snapshot; each order is given once."""
        ...


def _snapshot_of(plan: Plan, asked: deque[RobotState]) -> RobotState:
    """Take out the snapshot that `plan` was made from and all before it: plans come in order, older ones never will."""
    while (snapshot := asked.popleft()).time < plan.report.time:
        pass
    return snapshot


def _wait_until(deadline: float) -> float:
    """Sleep, then spin until `deadline` [s]; returns by how much it is late [s]."""
    ahead = deadline - perf_counter()
    if ahead > SPIN:
        sleep(ahead - SPIN)
    while (now := perf_counter()) < deadline:
        sleep(0)  # gives the interpreter to the planner, which a bare spin would keep from it
    return now - deadline


def _planner(scenario: Scenario, session: Session, mailbox: Mailbox) -> PlannerThread | PlannerProcess:
    """Who plans beside the ticks, from entry to exit."""
    if scenario.loop.realtime_planner == "thread":
        return PlannerThread(session.planner, mailbox)
    return PlannerProcess(scenario, mailbox)


@contextmanager
def ahead_of_others() -> Iterator[bool]:
    """Real-time priority for this thread, if the system grants it; gives whether it did.

    Where every core has work, a thread like any other waits for its turn for several milliseconds, now and then.
    """
    if not hasattr(os, "sched_setscheduler"):
        yield False
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, *before)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """No garbage collection, and short turns of the interpreter, for as long as the loop runs."""
    interval = sys.getswitchinterval()
    with no_garbage_collection():
        sys.setswitchinterval(SWITCH_INTERVAL)
        try:
            yield
        finally:
            sys.setswitchinterval(interval)


def _warm_up(scenario: Scenario, robot: Robot, model: mujoco.MjModel) -> None:
    recorder = Recorder(robot, expected_ticks=WARM_UP_TICKS, plant_nq=model.nq, plant_nv=model.nv)
    session = Session(scenario, robot=robot, model=model, recorder=recorder)
    for _ in range(WARM_UP_TICKS):
        session.tick(None)
