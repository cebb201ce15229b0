"""Deeds at the window become pushes, orders, paces and ends; no display, and a clock of the tests' own."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest
from fake_window import FakeWindow
from numpy.testing import assert_allclose
from short_run import ROBOT, new_recorder, new_session, short

from wbmpc.checks.context import CheckContext
from wbmpc.checks.momentum import MomentumBalanceCheck
from wbmpc.facts import facts_of
from wbmpc.interact import operator as operating
from wbmpc.interact.controls import Key
from wbmpc.interact.exchange import Inputs, MousePush
from wbmpc.interact.operator import Operator
from wbmpc.loop import Session
from wbmpc.mailbox import Mailbox
from wbmpc.planner.plan import Plan
from wbmpc.planner_process import PlannerProcess
from wbmpc.realtime import run_realtime
from wbmpc.recorder import Recorder
from wbmpc.scenario import Scenario, build_world, resolve_patches, robot_path
from wbmpc.signals import RobotState, TargetMove
from wbmpc.slots import Slots

FORCE, POINT = np.array([2.0, -1.0, 0.5]), np.array([0.02, 0.0, 0.05])
NEAR = [0.15, 0.13, 0.30]  # a target that needs no contact


def near_reach(duration: float, *, where: str = "thread") -> Scenario:
    changes = {"loop__realtime_planner": where, "tasks__0__start": 0.1, "tasks__0__arrive_by": 1.0}
    scenario = short("reach", duration=duration, **changes)
    task = scenario.tasks[0].model_copy(update={"target": tuple(NEAR), "hand": "left", "hold": 60.0})
    return scenario.model_copy(update={"tasks": (task,)})


class Clock:
    """Each look at it takes one period of the operator's: it is always time for the next frame."""

    def __init__(self) -> None:
        self.now, self.slept = 0.0, 0.0

    def perf_counter(self) -> float:
        self.now += 1.5 * operating.PERIOD
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(operating, "perf_counter", clock.perf_counter)
    monkeypatch.setattr(operating, "sleep", clock.sleep)
    monkeypatch.setattr(operating, "TICKS_SHARE", 0.0)
    return clock


def pull(session: Session, body: str = "torso") -> Inputs:
    return Inputs(push=MousePush(session.plant.model.body(body).id, FORCE, POINT))


def attended(session: Session, window: FakeWindow, ticks: int) -> Operator:
    """Ticks, each with a look at the window."""
    operator, slots = Operator(window, session.scenario), Slots(0.0, 1e-3)
    for k in range(ticks):
        if not operator.attend(session, slots, k):
            break
        session.tick(None)
    return operator


def test_a_pull_is_a_declared_disturbance_while_it_lasts(clock: Clock) -> None:
    session, recorder = new_session(near_reach(1.0))
    window = FakeWindow(lambda k: pull(session) if 5 <= k < 30 else Inputs())
    operator = attended(session, window, 60)
    pulled = recorder.external_force.any(axis=1)
    assert_allclose(np.flatnonzero(pulled), np.arange(5, 30))
    assert_allclose(recorder.external_force[5:30], np.tile(FORCE, (25, 1)))
    assert not session.plant.data.qfrc_applied.any()
    # what is noted is what has acted
    assert_allclose(sum(np.array(p.impulse) for p in operator.pushes), 0.025 * FORCE, rtol=1e-9)
    assert operator.pushes[0].time == pytest.approx(0.005)
    assert operator.pushes[-1].end == pytest.approx(0.030)
    assert {p.body for p in operator.pushes} == {"torso"}
    assert_allclose(operator.pushes[0].point, POINT)
    texts = [(round(e.time, 3), e.text) for e in recorder.events]
    assert [time for time, _ in texts] == [0.005, 0.030]
    assert texts[0][1] == "pull by mouse begins: torso"
    assert texts[1][1].startswith("pull by mouse ends: (0.05, -0.0")


def test_the_momentum_balance_knows_of_pulls_and_pushes(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """And would find them if they were not declared."""
    scenario = near_reach(0.4)
    session, recorder = new_session(scenario)

    def script(k: int) -> Inputs:
        if k == 20:
            return Inputs(keys=(Key.ENTER.value,))
        return pull(session, "left_forearm_link") if 60 <= k < 200 else Inputs()

    operator = attended(session, FakeWindow(script), 400)
    pushed = recorder.external_force[20:121]
    assert_allclose(np.linalg.norm(pushed[:40], axis=1), operating.PUSH * ROBOT.mass / operating.PUSH_TIME, rtol=1e-6)
    assert operator.pushes[0].body == "torso"
    model = build_world(scenario, robot_path(scenario))
    context = CheckContext(recorder, facts_of(model, ROBOT, scenario, resolve_patches(scenario)))
    check = MomentumBalanceCheck(scenario.universal.momentum_balance)
    result = check.evaluate(context, "momentum_balance")
    assert result.passed, result.message
    monkeypatch.setattr(Recorder, "external_force", np.zeros((recorder.ticks, 3)), raising=False)
    assert not check.evaluate(CheckContext(recorder, context.facts), "momentum_balance").passed


def test_what_lies_in_the_world_is_not_pulled(clock: Clock) -> None:
    session, recorder = new_session(near_reach(1.0))
    attended(session, FakeWindow(lambda k: Inputs(push=MousePush(0, FORCE, POINT))), 5)
    assert not recorder.external_force.any()
    assert recorder.events == []
    with pytest.raises(ValueError, match="no body of the robot"):
        session.plant.hold(0, FORCE, POINT)


def test_pushes_by_key_come_from_the_seed(clock: Clock) -> None:
    sessions = [new_session(near_reach(1.0).model_copy(update={"seed": seed}))[0] for seed in (3, 3, 4)]
    enter = Inputs(keys=(Key.ENTER.value, Key.ENTER.value))
    first, second, other = (
        attended(s, FakeWindow(lambda k: enter if k == 0 else Inputs()), 2).pushes for s in sessions
    )
    assert first == second != other
    assert first[0].impulse != first[1].impulse


def test_orders_are_given_once_and_the_last_counts(clock: Clock) -> None:
    session, _ = new_session(near_reach(1.0))
    keys = Inputs(keys=(Key.UP.value, Key.UP.value, Key.LEFT.value))
    operator = attended(session, FakeWindow(lambda k: keys if k == 1 else Inputs()), 4)
    (order,) = operator.orders()
    assert order.task == 0
    assert_allclose(order.target, np.add(NEAR, [0.02, 0.01, 0.0]))
    assert operator.orders() == ()


def test_a_pause_stops_the_ticks_and_moves_their_slots(clock: Clock) -> None:
    session, recorder = new_session(near_reach(1.0))
    space = Inputs(keys=(Key.SPACE.value,))
    window = FakeWindow(lambda k: space if k in (3, 10) else Inputs())
    operator, slots = Operator(window, session.scenario), Slots(0.0, 1e-3)
    for k in range(6):
        frames = len(window.frames)
        assert operator.attend(session, slots, k)
        assert len(window.frames) == frames + (8 if k == 3 else 1)  # shown, and asked, all the while
        session.tick(None)
    assert recorder.ticks == 6
    assert clock.slept == pytest.approx(7 * operating.PERIOD)
    assert slots.of(4) > 1e-3 * 4 + clock.slept


def test_slow_motion_spreads_the_slots(clock: Clock) -> None:
    session, _ = new_session(near_reach(1.0))
    operator, slots = Operator(FakeWindow(), session.scenario, pace=0.5), Slots(0.0, 1e-3)
    assert operator.attend(session, slots, 0)
    assert slots.of(10) == pytest.approx(0.020)
    operator.controls.press(Key.EQUAL.value)
    operator.controls.press(Key.MINUS.value)
    operator.controls.press(Key.MINUS.value)
    assert operator.attend(session, slots, 10)
    assert operator.controls.pace == 0.25


@pytest.mark.parametrize(
    ("inputs", "again"),
    [
        (Inputs(closed="the window was closed"), False),
        (Inputs(keys=(Key.END.value,)), False),
        (Inputs(keys=(Key.BACKSPACE.value,)), True),
    ],
)
def test_ends(clock: Clock, inputs: Inputs, again: bool) -> None:
    session, recorder = new_session(near_reach(1.0))
    operator = attended(session, FakeWindow(lambda k: inputs if k == 7 else pull(session)), 60)
    assert recorder.ticks == 7
    assert operator.again == again == operator.ask("over")
    assert not session.plant.data.qfrc_applied.any()


def test_after_the_end_the_window_waits_for_an_answer(clock: Clock) -> None:
    session, _ = new_session(near_reach(1.0))
    window = FakeWindow(lambda k: Inputs(keys=(Key.BACKSPACE.value,)) if k == 9 else None if k % 2 else Inputs())
    operator = attended(session, window, 5)
    assert operator.ask("over")
    assert len(window.frames) == 10
    assert window.frames[-1].caption == ("over", "")


@pytest.mark.parametrize("where", ["thread", "process"])
def test_a_moved_target_reaches_the_plans(where: str) -> None:
    """Through the whole real-time loop, which goes on until it has happened: no machine is too slow."""
    recorder = new_recorder(scenario := near_reach(60.0, where=where))

    def person(frame: int) -> Inputs:
        if frame == 5:
            return Inputs(keys=(Key.UP.value,) * 3 + (Key.PAGE_UP.value,))
        return Inputs(closed="seen enough" if recorder.plans[-1].time > 0.8 else "")

    run_realtime(scenario, robot=ROBOT, recorder=recorder, operator=Operator(FakeWindow(person), scenario))
    moved = [event for event in recorder.events if "target moved" in event.text]
    assert [event.text for event in moved] == ["reach left: target moved to (0.180, 0.130, 0.310) m"]
    assert any(event.text in plan.events for event in moved for plan in recorder.plans)
    assert recorder.plans[-1].hand_reference[0, :, 0].max() > NEAR[0] + 0.01


def test_orders_of_a_skipped_snapshot_are_kept() -> None:
    """A planner in its process: two orders, one plan."""
    scenario = near_reach(1.0, where="process")
    still = [
        RobotState(time, ROBOT.home_q, np.zeros(ROBOT.nv), np.zeros((2, 6)), np.zeros((2, 3)), 1.0)
        for time in (0.01, 0.02, 0.03, 0.04)
    ]
    mailbox, plans = Mailbox(), list[Plan]()
    with PlannerProcess(scenario, mailbox) as planner:
        planner.request(still[0])
        for state, x in zip(still[1:], (0.2, 0.21, 0.22), strict=True):  # none of these waits for the planner
            planner.request(state, [TargetMove(0, np.array([x, 0.1, 0.3]))])
        assert mailbox.latest(9.0) is None
        give_up = perf_counter() + 60.0
        while len(plans) < 2:
            assert perf_counter() < give_up
            planner.check()
            plans += mailbox.arrived(9.0)
    assert [plan.report.time for plan in plans] == [0.01, 0.04]
    assert planner.skipped == 2
    assert [event for event in plans[1].report.events if "target moved" in event] == [
        f"reach left: target moved to ({x:.3f}, 0.100, 0.300) m" for x in (0.2, 0.21, 0.22)
    ]
