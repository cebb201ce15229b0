"""The real-time loop: scheduling against a made-up clock, planners beside the ticks, and a replay in lockstep."""

from __future__ import annotations

import gc
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from threading import Event, Semaphore, active_count
from time import perf_counter, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from short_run import ROBOT, finished, new_recorder, stand

from wbmpc import realtime
from wbmpc.mailbox import Mailbox
from wbmpc.planner.planner import Planner
from wbmpc.planner_process import PlannerProcess
from wbmpc.planner_thread import PlannerThread
from wbmpc.realtime import run_realtime
from wbmpc.signals import RobotState
from wbmpc.timing import LoopTiming, Schedule

STAND = stand(loop__realtime_planner="thread")


def test_a_standing_robot_in_real_time() -> None:
    scenario = stand(duration=0.5, loop__realtime_planner="thread")
    threads, progress = active_count(), []
    timing, recorder = finished(scenario, run=run_realtime, on_progress=progress.append)
    assert recorder.ticks == 500
    np.testing.assert_allclose(np.diff(recorder.time), 1e-3, atol=1e-12)  # no tick is skipped, however late
    assert recorder.torso_up.min() > 0.999
    assert timing.wall_time > 0.498
    assert timing.drift == pytest.approx(timing.wall_time - 0.5)
    assert 0 <= timing.missed_deadlines <= 500
    assert progress == pytest.approx([0.5])
    # 49 snapshots are due; each is planned, skipped, or still in work at the end
    planned = len(recorder.plans) - 1
    assert 1 <= planned <= 49
    assert 47 <= planned + timing.skipped_plans <= 49
    latency = np.array(timing.plan_latency)
    assert len(latency) == planned
    assert latency.min() > 0.0
    assert timing.late_plans == np.sum(latency > 0.0105)
    assert active_count() == threads


@pytest.mark.parametrize("where", ["process", "thread"])
def test_without_late_plans_it_is_the_lockstep_run(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks of 40 ms: the planner has 0.4 s for each plan, and every plan waits until its delay is over."""
    monkeypatch.setattr(realtime, "_wait_until", lambda deadline: sleep(0.04) or 0.0)  # type: ignore[func-returns-value]
    scenario = stand(duration=0.06, sensors__noise_scale=1.0, seed=5, loop__realtime_planner=where)
    timing, recorder = finished(scenario, run=run_realtime)
    if timing.late_plans or timing.skipped_plans:
        pytest.skip("no plan in 0.4 s: the machine is too slow to tell")
    _, lockstep = finished(scenario)
    assert recorder.state_sha256 == lockstep.state_sha256
    assert timing.effects == [snapshot + 10 for snapshot in timing.snapshots]
    assert timing.plan_ready.max() < 0.0105


def test_replay_in_lockstep_repeats_the_bits() -> None:
    """What makes a threaded run unrepeatable is when its plans are ready: charge that, and nothing else is left."""
    scenario = stand(duration=0.3, sensors__noise_scale=1.0, seed=5, loop__realtime_planner="thread")
    timing, recorder = finished(scenario, run=run_realtime)
    assert timing.effects
    assert all(effect > snapshot for snapshot, effect in zip(timing.snapshots, timing.effects, strict=True))
    schedule = Schedule(dict(zip(timing.snapshots, timing.effects, strict=True)), recorder.ticks)
    again, replayed = finished(scenario, schedule=schedule)
    assert replayed.state_sha256 == recorder.state_sha256
    assert (again.snapshots, again.effects) == (timing.snapshots, timing.effects)


def test_an_error_of_the_planner_surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    solve, calls = Planner.solve, 0

    def failing(planner: Planner, state: RobotState) -> Any:
        nonlocal calls
        calls += state.time > 0.0
        if calls == 3:
            raise ZeroDivisionError("the third plan")
        return solve(planner, state)

    monkeypatch.setattr(Planner, "solve", failing)
    threads, interval = active_count(), sys.getswitchinterval()
    recorder = new_recorder(scenario := stand(duration=2.0, loop__realtime_planner="thread"))
    with pytest.raises(RuntimeError, match=r"snapshot of 0.0\d0 s: ZeroDivisionError: the third plan") as raised:
        run_realtime(scenario, robot=ROBOT, recorder=recorder)
    assert isinstance(raised.value.__cause__, ZeroDivisionError)
    assert recorder.ticks < 1000  # at once, not at the end
    assert active_count() == threads
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval


class Clock:
    """Time passes when somebody sleeps, looks at the clock, or makes a tick."""

    def __init__(self) -> None:
        self.now = 100.0

    def perf_counter(self) -> float:
        self.now += 1e-6
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0.0
        self.now += seconds


def run_with_tick_times(durations: list[float]) -> tuple[Any, list[float]]:
    """A real-time run on a made-up clock whose ticks take the given times [s]; the begin of each tick [s]."""
    clock, begins = Clock(), []

    class FakeSession:
        step, ticks = 1e-3, len(durations)
        planner = None

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            self.mailbox = Mailbox()
            self.plant = SimpleNamespace(time=0.0)

        def tick(self, plan: Callable[[RobotState], None] | None) -> bool:
            begins.append(clock.now - 100.0)
            clock.now += durations[len(begins) - 1]
            self.plant.time += 1e-3
            return True

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(realtime, "Session", FakeSession)
        patch.setattr(realtime, "_warm_up", lambda *args: None)
        patch.setattr(realtime, "perf_counter", clock.perf_counter)
        patch.setattr(realtime, "sleep", clock.sleep)
        recorder: Any = SimpleNamespace(timing=LoopTiming(expected_ticks=8))
        timing = run_realtime(STAND, robot=ROBOT, recorder=recorder, model=object())  # type: ignore[arg-type]
    return timing, begins


@settings(max_examples=50, deadline=None)
@given(st.lists(st.sampled_from([2e-4, 8e-4, 1.7e-3, 4.3e-3]), min_size=1, max_size=40))
def test_ticks_begin_at_their_slot_or_as_soon_as_the_last_one_ends(durations: list[float]) -> None:
    timing, begins = run_with_tick_times(durations)
    free, expected = 0.0, []
    for k, duration in enumerate(durations):
        expected.append(max(1e-3 * k, free))
        free = expected[-1] + duration
    margin = 4e-4  # looking at the made-up clock takes time on it
    np.testing.assert_allclose(begins, expected, atol=margin)
    late = np.array(expected) - 1e-3 * np.arange(len(durations))
    assert np.sum(late > 1e-3 + 1e-9) <= timing.missed_deadlines <= np.sum(late > 1e-3 - margin)
    assert timing.wall_time == pytest.approx(free, abs=margin)
    np.testing.assert_allclose(timing.tick_late, late, atol=margin)
    np.testing.assert_allclose(timing.tick_time, durations, atol=margin)
    assert timing.summary()["tick_late_max"] == timing.tick_late.max()


class GatedPlanner:
    """Starts a plan when asked, ends it when let."""

    def __init__(self) -> None:
        self.solved: list[float] = []
        self.started, self.gate, self.ended = Event(), Event(), Semaphore(0)

    def solve(self, state: Any) -> Any:
        self.started.set()
        assert self.gate.wait(5.0)
        self.solved.append(state.time)
        self.ended.release()
        return state


def test_the_planner_takes_the_newest_snapshot_and_leaves_out_older_ones() -> None:
    planner, mailbox = GatedPlanner(), Mailbox()
    with PlannerThread(planner, mailbox) as worker:  # type: ignore[arg-type]
        worker.request(SimpleNamespace(time=1.0))
        assert planner.started.wait(5.0)
        for time in (2.0, 3.0, 4.0):  # none of these waits for the planner
            worker.request(SimpleNamespace(time=time))
        assert mailbox.latest(9.0) is None
        planner.gate.set()
        assert all(planner.ended.acquire(timeout=5.0) for _ in range(2))
    assert planner.solved == [1.0, 4.0]
    assert mailbox.latest(9.0).time == 4.0  # type: ignore[union-attr]
    assert worker.skipped == 2


def test_snapshots_that_were_replaced_are_forgotten() -> None:
    asked = deque(SimpleNamespace(time=0.01 * k) for k in range(1, 6))
    third, fourth = asked[2], asked[3]
    plan = SimpleNamespace(report=SimpleNamespace(time=third.time))
    assert realtime._snapshot_of(plan, asked) is third  # type: ignore[arg-type]
    assert asked[0] is fourth
    assert len(asked) == 2


def test_a_slow_planner_is_late_and_holds_no_tick_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """However fast the machine, each plan waits for 35 ticks: they go on, on the tail of the plan before."""
    solve, recorder = Planner.solve, new_recorder(scenario := stand(duration=0.4, loop__realtime_planner="thread"))
    give_up = perf_counter() + 120.0

    def slow(planner: Planner, state: RobotState) -> Any:
        while state.time > 0.0 and recorder.ticks < min(round(1e3 * state.time) + 35, 400):
            assert perf_counter() < give_up
            sleep(1e-3)
        return solve(planner, state)

    monkeypatch.setattr(Planner, "solve", slow)
    timing = run_realtime(scenario, robot=ROBOT, recorder=recorder)
    assert recorder.ticks == timing.ticks == 400
    assert recorder.torso_up.min() > 0.99
    assert timing.plan_latency.min() > 0.0345
    assert timing.late_plans == len(timing.effects) == len(recorder.plans) - 1 >= 1
    assert timing.skipped_plans >= 2 * (timing.late_plans - 1)  # between two that are planned, 35 ticks or more apart
    assert [state.time for state, _ in recorder.planned] == [plan.time for plan in recorder.plans[1:]]
    summary = timing.summary()
    assert summary["late_plans"] == summary["plans"]
    assert summary["plan_latency_max"] >= summary["plan_latency_p50"] > 0.0345


def test_mailbox_gives_each_plan_once_and_never_early() -> None:
    mailbox: Any = Mailbox()
    for name, ready in (("a", 0.0), ("b", 0.010), ("c", 0.012)):
        mailbox.post(name, available_at=ready)
    assert mailbox.arrived(0.0) == ["a"]
    assert mailbox.arrived(0.009) == []
    assert mailbox.latest(0.009) == "a"
    assert mailbox.arrived(0.020) == ["b", "c"]
    assert mailbox.latest(0.020) == "c"
    assert mailbox.arrived(0.030) == []


def test_a_planner_that_dies_in_its_process_is_missed() -> None:
    with PlannerProcess(STAND, Mailbox()) as planner:
        planner._worker.process.kill()
        planner.request(still(0.01))
        with pytest.raises(RuntimeError, match=r"snapshot of 0.010 s: .*gone: its process was killed by SIGKILL"):
            checked_until(planner, lambda: False)
    assert not planner._worker.process.is_alive()


def test_a_plan_that_is_in_work_at_the_end_is_given_up() -> None:
    with PlannerProcess(STAND, Mailbox()) as planner:
        planner.request(still(0.01))
    planner.check()  # as the loop does, for an error of the last plan


def test_what_a_planner_raises_in_its_process_says_on_which_snapshot() -> None:
    with PlannerProcess(STAND, Mailbox()) as planner:
        planner.request(replace(still(0.01), q=np.zeros(3)))
        with pytest.raises(RuntimeError, match=r"snapshot of 0.010 s: ValueError: ") as raised:
            checked_until(planner, lambda: False)
    assert isinstance(raised.value.__cause__, ValueError)


def still(time: float) -> RobotState:
    return RobotState(time, ROBOT.home_q, np.zeros(ROBOT.nv), np.zeros((2, 6)), np.zeros((2, 3)), 1.0)


def checked_until(planner: PlannerProcess, done: Callable[[], bool]) -> None:
    give_up = perf_counter() + 60.0
    while not done():
        assert perf_counter() < give_up
        planner.check()
