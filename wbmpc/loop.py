"""The tick and the lockstep loop: the only file that knows rates."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

import mujoco
import numpy as np

from wbmpc.estimator import Estimator
from wbmpc.initial import initial_posture
from wbmpc.jit import short_kernel
from wbmpc.mailbox import Mailbox
from wbmpc.planner.planner import Planner
from wbmpc.plant import Plant
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world, resolve_ground, resolve_loads, resolve_obstacles, resolve_patches
from wbmpc.signals import RobotState, Vector
from wbmpc.timing import LoopTiming, Schedule
from wbmpc.tracker.tracker import Tracker

DIVERGED = 1e6  # [rad/s, m/s] no robot moves so fast: the simulation has lost it
FLUSH_TICKS = 500  # ticks between two flushes of the recording, and two questions whether to go on


@short_kernel
def within(values: Vector, limit: float) -> bool:
    """Whether every value is smaller than `limit`; nan and inf are not."""
    for value in values:  # noqa: SIM110 - numba compiles no generators
        if not abs(value) < limit:
            return False
    return True


class Sink(Protocol):
    """Where a recording goes; it reads the recorder."""

    def flush(self, now: float) -> None:
        """Write what was recorded up to `now` [s]."""
        ...


class Session:
    """Plant, estimator, planner, tracker and recorder of one run, wired as in the block diagram."""

    def __init__(self, scenario: Scenario, *, robot: Robot, model: mujoco.MjModel, recorder: Recorder) -> None:
        """Everything at rest in the scenario's initial posture."""
        self.scenario, self.robot, self.recorder = scenario, robot, recorder
        loop = scenario.loop
        self.step, self.ticks = loop.timestep, round(scenario.duration * loop.physics_rate)
        qpos = initial_posture(scenario, robot, model)
        q = robot.q_from_qpos(qpos[: robot.nq])
        self.plant = Plant(
            model,
            robot,
            disturbances=scenario.disturbances,
            sensors=scenario.sensors,
            qpos=qpos,
            seed=scenario.seed,
        )
        self.estimator = Estimator(robot, q=q, step=self.step)
        self.planner = Planner(
            robot,
            scenario.planner,
            tasks=scenario.tasks,
            patches=resolve_patches(scenario),
            obstacles=resolve_obstacles(scenario),
            ground=resolve_ground(scenario),
            loads=resolve_loads(scenario),
            q=q,
            period=loop.planner_period_ticks * self.step,
        )
        self.tracker = Tracker(robot, scenario.tracker, step=self.step)
        self.mailbox = Mailbox()
        # The first plan is there before the robot is let go.
        still = RobotState(
            time=0.0,
            q=q,
            v=np.zeros(robot.nv),
            sole_wrench_in_world=np.zeros((2, 6)),
            palm_force_in_world=np.zeros((2, 3)),
            mass_scale=1.0,
        )
        first = self.planner.solve(still)
        self.mailbox.post(first, available_at=0.0)
        recorder.append_plan(first.report)

    def tick(self, plan: Callable[[RobotState], None] | None) -> bool:
        """One tick of either loop; False: the state is not finite, or MuJoCo has reset itself because it found so.

        `plan` is called with the new state before the setpoint is sampled: what it posts may take effect in this tick.
        """
        state = self.estimator.update(self.plant.measure())
        if plan is not None:
            plan(state)
        latest = self.mailbox.latest(state.time)
        assert latest is not None
        setpoint = latest.sample(state.time)
        command = self.tracker.solve(state, setpoint)
        truth = self.plant.step(command.torque)
        self.recorder.append(truth, state, setpoint, command)
        return within(command.torque, DIVERGED) and within(truth.qvel, DIVERGED)


@dataclass(frozen=True, slots=True)
class Turn:
    """A change in the middle of a run."""

    tick: int  # which is the first one after it
    change: Callable[[Session], None]


def run_lockstep(
    scenario: Scenario,
    *,
    robot: Robot,
    recorder: Recorder,
    model: mujoco.MjModel | None = None,
    sink: Sink | None = None,
    on_progress: Callable[[float], None] | None = None,
    ended: Callable[[], str | None] | None = None,
    schedule: Schedule | None = None,
    turn: Turn | None = None,
) -> LoopTiming:
    """Run a scenario in simulated time: the same seed gives the same bits on any machine, however slow.

    A plan takes effect `loop.planner_delay` after its snapshot, in simulated time, or when a schedule says so. A state
    that is not finite ends the run early; the recorder then holds fewer ticks than the scenario asks for, and the
    checks say so.

    Args:
        model: the world; built from the scenario when not given.
        sink: flushed every half simulated second.
        on_progress: called with the simulated time [s] at every flush.
        ended: asked at every flush; a reason, which goes to the recorder's events, ends the run.
        schedule: when plans take effect, such as a threaded run's recorded one, which then repeats bit for bit; every
            planner period with the scenario's delay when not given.
        turn: a change to make on the way.

    Returns:
        The recorder's `timing`.
    """
    if model is None:
        model = build_world(scenario, robot.path)
    session = Session(scenario, robot=robot, model=model, recorder=recorder)
    loop, timing = scenario.loop, recorder.timing
    if schedule is None:
        schedule = Schedule.constant(
            period=loop.planner_period_ticks, delay=loop.planner_delay_ticks, ticks=session.ticks
        )
    effects = schedule.effects
    timing.begin(timestep=session.step, realtime=False)

    def plan(state: RobotState) -> None:
        tick = recorder.ticks  # which is being made
        solved = session.planner.solve(state)
        session.mailbox.post(solved, available_at=state.time + (effects[tick] - tick) * session.step)
        recorder.append_plan(solved.report, state)
        timing.plan(snapshot=tick, effect=effects[tick])

    def ticks(first: int, end: int) -> bool:
        """Make the ticks from `first` to before `end`; False: the run has ended on the way."""
        for k in range(first, end):
            began = perf_counter()
            sound = session.tick(plan if k in effects else None)
            timing.tick(0.0, perf_counter() - began)
            if not sound:
                recorder.event(session.plant.time, "state is not finite, run ended")
                return False
            if (k + 1) % FLUSH_TICKS == 0:
                if sink is not None:
                    sink.flush(session.plant.time)
                if on_progress is not None:
                    on_progress(session.plant.time)
                if ended is not None and (reason := ended()):
                    recorder.event(session.plant.time, f"{reason}, run ended")
                    return False
        return True

    with no_garbage_collection():
        start = perf_counter()
        if turn is None:
            ticks(0, schedule.ticks)
        elif ticks(0, turn.tick):
            turn.change(session)
            ticks(turn.tick, schedule.ticks)
        timing.wall_time, timing.simulated_time = perf_counter() - start, session.plant.time
    return timing


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Only reference counts free memory inside: a tick leaves no cycles behind, and looking for them takes its time."""
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
