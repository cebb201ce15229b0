"""The person at the controls, as the real-time loop sees them: deeds in the window become pushes and orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter, sleep

import numpy as np

from wbmpc.interact.controls import Controls, Wish
from wbmpc.interact.exchange import Frame, Inputs, MousePush
from wbmpc.interact.window import AnyWindow
from wbmpc.loop import Session
from wbmpc.scenario import Impulse, ReachTask, Scenario
from wbmpc.scenario.random_streams import Stream, generator
from wbmpc.signals import SIDES, TargetMove, Vector
from wbmpc.slots import Slots

PERIOD = 1 / 60  # [s] of the wall clock between two looks at the window
TICKS_SHARE = 3.0  # times as long for the ticks as a window of this process took for its frame
PUSH = 0.25  # [N·s/kg] of the robot: what the push of a key gives its torso
PUSH_TIME = 0.1  # [s]


class Operator:
    """Attends a run; see `wbmpc.realtime.Operator`. One run, one operator; the window may outlive both."""

    def __init__(self, window: AnyWindow, scenario: Scenario, *, pace: float = 1.0) -> None:
        """`pace`, of real time, is what the run begins at."""
        reaches = {k: np.array(task.target) for k, task in enumerate(scenario.tasks) if isinstance(task, ReachTask)}
        self.controls = Controls(reaches, pace=pace)
        self.again = False  # whether another run was asked for
        self.pushes: list[Impulse] = []  # all of this run, by mouse and by key
        self._window, self._random = window, generator(scenario.seed, Stream.OPERATOR)
        self._orders: dict[int, TargetMove] = {}  # the last one of each task
        self._held: MousePush | None = None
        self._since = self._begun = 0.0  # [s] simulated: since when this force, since when this drag
        self._drag = np.zeros(3)  # [N·s] of this drag
        self._frame_shown: Frame | None = None
        self._next = 0.0  # [s] of the wall clock
        self._over = False

    # ------------------------------------------------------------------ for the loop

    def attend(self, session: Session, slots: Slots, tick: int) -> bool:
        """See `wbmpc.realtime.Operator`: a glance at the clock, and sixty times a second one at the window."""
        if perf_counter() < self._next:
            return True
        pace, stopped = self.controls.pace if tick else 1.0, False
        while True:
            begun = perf_counter()
            self._frame_shown = self._frame(session)
            inputs = self._window.exchange(self._frame_shown)
            now = perf_counter()
            self._next = now + max(PERIOD, TICKS_SHARE * (now - begun))
            if inputs is not None:
                self._take(inputs, session)
            if self._over or not self.controls.paused:
                break
            stopped = True
            sleep(PERIOD)
        if self._over:
            self._let_go(session)
        elif stopped or self.controls.pace != pace:
            slots.go_on(tick, self.controls.pace, at=perf_counter() if stopped else None)
        return not self._over

    def orders(self) -> Sequence[TargetMove]:
        """See `wbmpc.realtime.Operator`."""
        if not self._orders:
            return ()
        orders, self._orders = tuple(self._orders.values()), {}
        return orders

    def ask(self, note: str) -> bool:
        """After a run that ended by itself: wait until the person begins anew (True) or has had enough."""
        while not self._over:
            assert self._frame_shown is not None
            inputs = self._window.exchange(replace(self._frame_shown, caption=(note, "")))
            wishes = [self.controls.press(code) for code in inputs.keys] if inputs is not None else []
            self.again = Wish.RESET in wishes
            self._over = self.again or Wish.QUIT in wishes or (inputs is not None and bool(inputs.closed))
            sleep(PERIOD)
        return self.again

    # ------------------------------------------------------------------ what was done

    def _take(self, inputs: Inputs, session: Session) -> None:
        if inputs.closed:
            session.recorder.event(session.plant.time, inputs.closed)
            self._over = True
        for code in inputs.keys:
            wish = self.controls.press(code)
            if isinstance(wish, TargetMove):
                self._orders[wish.task] = wish
            elif wish is Wish.PUSH:
                self._push(session)
            elif wish is not None:
                self._over, self.again = True, wish is Wish.RESET
        self._hold(inputs.push, session)

    def _push(self, session: Session) -> None:
        """A push of the torso from a random direction."""
        angle, size = self._random.uniform(0.0, 2.0 * np.pi), PUSH * session.robot.mass
        impulse = (float(size * np.cos(angle)), float(size * np.sin(angle)), 0.0)
        time = session.plant.time
        push = Impulse(kind="impulse", body="torso", time=time, duration=PUSH_TIME, impulse=impulse)
        session.plant.push(push)
        self.pushes.append(push)
        session.recorder.event(time, f"push by key: torso, {_text(np.array(impulse))} N·s in {PUSH_TIME:g} s")

    def _hold(self, push: MousePush | None, session: Session) -> None:
        """The mouse pulls, pulls otherwise, or has let go."""
        if push is None and self._held is None:
            return
        model, time = session.plant.model, session.plant.time
        if push is not None and model.body_rootid[push.body] != model.jnt_bodyid[0]:
            push = None  # what lies in the world is not the robot's: no disturbance of it
        self._count(session)
        if push is not None and self._held is None:
            self._begun, self._drag = time, np.zeros(3)
            session.recorder.event(time, f"pull by mouse begins: {model.body(push.body).name}")
        self._held, self._since = push, time
        if push is not None:
            session.plant.hold(push.body, push.force, push.point)
        else:
            self._let_go(session)

    def _let_go(self, session: Session) -> None:
        self._count(session)
        self._held = None
        session.plant.let_go()
        if self._drag.any():
            seconds = session.plant.time - self._begun
            session.recorder.event(
                session.plant.time, f"pull by mouse ends: {_text(self._drag)} N·s in {seconds:.2f} s"
            )
            self._drag = np.zeros(3)

    def _count(self, session: Session) -> None:
        """Note the force that has acted until now."""
        held, duration = self._held, session.plant.time - self._since
        if held is None or duration <= 0.0:
            return
        given = held.force * duration
        self._drag = self._drag + given
        self.pushes.append(
            Impulse(
                kind="impulse",
                body=session.plant.model.body(held.body).name,
                time=self._since,
                duration=duration,
                impulse=_three(given),
                point=_three(held.point),
            )
        )

    # ------------------------------------------------------------------ what is shown

    def _frame(self, session: Session) -> Frame:
        data, plan, controls = session.plant.data, session.recorder.plans[-1], self.controls
        ground = min(float(data.site(f"{side}_sole").xpos[2]) for side in SIDES)
        targets = controls.places
        state = "paused" if controls.paused else f"{controls.pace:g} x"
        lines = {
            "time": f"{data.time:.1f} s",
            "pace": state,
            "missed ticks": str(session.recorder.timing.missed_deadlines),
        }
        if len(targets):
            lines["target"] = "({:.2f}, {:.2f}, {:.2f}) m".format(*targets[controls.chosen])
        if self._held is not None:
            lines["pull"] = f"{np.linalg.norm(self._held.force):.1f} N"
        return Frame(
            qpos=data.qpos.copy(),
            qvel=data.qvel.copy(),
            control=data.ctrl.copy(),
            com=plan.com,
            zmp=_at(plan.zmp, ground),
            support=_at(plan.support_polygon, ground),
            targets=targets,
            chosen=controls.chosen if len(targets) else -1,
            patches=tuple(name for name in plan.contact_patch if name),
            plan_shown=controls.plan_shown,
            caption=("\n".join(lines), "\n".join(lines.values())),
        )


def _at(points: Vector, height: float) -> Vector:
    """(n, 2) -> (n, 3) [m]"""
    return np.column_stack([points, np.full(len(points), height)])


def _three(vector: Vector) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _text(vector: Vector) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in vector) + ")"
