"""A recorded run that takes another turn: the same state at one tick, one change, and both futures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from wbmpc.checks.fall import FallWatch
from wbmpc.explain.changes import Change
from wbmpc.explain.explanation import apply
from wbmpc.explain.past import Past
from wbmpc.loop import Session, Turn, run_lockstep
from wbmpc.parting import Parting, partings
from wbmpc.provenance import document_of
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.rerunning import checksums
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world
from wbmpc.session import open_sink, verdict_of
from wbmpc.timing import Schedule
from wbmpc.tracker.tracker import Tracker
from wbmpc.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Future:
    """One run to its end."""

    recorder: Recorder
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Branch:
    """Both futures of a run."""

    tick: int  # the first one after the change
    original: Future
    changed: Future
    unlike_recording: int | None  # first tick at which the original is not the recorded run; None: it is
    partings: Sequence[Parting]  # what diverged, in order of time


def branch(
    past: Past,
    change: Change,
    *,
    at: float,
    recording: Path | None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Branch:
    """Make the recorded run again, to its end as it was and, from `at` [s] on, with `change`.

    Plans take effect when they did in the recording, however late that was; where it ends, and after a change of the
    delay, as in lockstep.

    Args:
        recording: the .rrd file of both, the changed future under /branch; None writes none.
        on_progress: called with the name of the future and its simulated time [s].

    Raises:
        WbmpcError: the time is outside the recording, or the file cannot be written.
    """
    scenario, recorded = past.run.scenario, past.run.run
    tick, ticks = past.tick_at(at), round(scenario.duration * scenario.loop.physics_rate)
    report = on_progress or (lambda name, time: None)

    def make(name: str, changed: Change | None, sink: Any = None, **parts: Any) -> Future:
        turn = None if changed is None else Turn(tick, lambda session: _turn(session, changed, past))
        made = scenario if changed is None else changed.scenario
        recorder = parts["recorder"]
        run_lockstep(
            scenario,
            **parts,
            sink=sink,
            schedule=_schedule(
                recorded.schedule, made, since=tick if made.loop != scenario.loop else None, ticks=ticks
            ),
            turn=turn,
            ended=FallWatch(recorder, scenario.universal.no_fall, timestep=scenario.loop.timestep),
            on_progress=lambda time: report(name, time),
        )
        model = parts["model"]
        return Future(recorder, verdict_of(recorder, made, name=name, model=model, robot=past.robot))

    changed = make("branch", change, **_parts(scenario, past.robot, ticks))
    parts = _parts(scenario, past.robot, ticks)
    document = document_of(scenario, past.run.name, realtime=False)
    with open_sink(recording, past.run.name, scenario, **parts, replay=document) as sink:
        original = make(past.run.name, None, sink, **parts)
        if sink is not None:
            sink.finish(original.verdict.as_dict())
            sink.beside(
                changed.recorder,
                build_world(change.scenario, past.robot.path),
                changed.verdict.as_dict(),
                change.words,
                tick=tick,
            )
    return Branch(
        tick=tick,
        original=original,
        changed=changed,
        unlike_recording=_first_difference(original.recorder, recorded.checksums),
        partings=partings(original.recorder, changed.recorder, joint_names=past.robot.joint_names),
    )


def _parts(scenario: Scenario, robot: Robot, ticks: int) -> dict[str, Any]:
    model: Any = build_world(scenario, robot.path)
    recorder = Recorder(robot, expected_ticks=ticks, plant_nq=model.nq, plant_nv=model.nv)
    return {"robot": robot, "model": model, "recorder": recorder}


def _turn(session: Session, change: Change, past: Past) -> None:
    """Change a run that goes on."""
    before, after = past.run.scenario, change.scenario
    apply(change, session.planner, past)
    if after.tracker != before.tracker:
        tracker = Tracker(session.robot, after.tracker, step=session.step)
        tracker.continue_from(session.tracker)
        session.tracker = tracker
    of_the_plant = ("world", "plant", "sensors", "disturbances")
    if any(getattr(after, part) != getattr(before, part) for part in of_the_plant):
        model: mujoco.MjModel = build_world(after, session.robot.path)
        session.plant.change(model, sensors=after.sensors, disturbances=after.disturbances)


def _schedule(recorded: Schedule, scenario: Scenario, *, since: int | None, ticks: int) -> Schedule:
    """The recorded schedule up to the tick `since` (None: to its end), then lockstep with the scenario's delay."""
    end = recorded.ticks if since is None else since
    loop = scenario.loop
    rest = Schedule.constant(period=loop.planner_period_ticks, delay=loop.planner_delay_ticks, ticks=ticks).effects
    effects = {k: effect for k, effect in recorded.effects.items() if k < end}
    return Schedule(effects | {k: effect for k, effect in rest.items() if k >= end}, ticks)


def _first_difference(recorder: Recorder, recorded: Any) -> int | None:
    made = checksums(recorder)
    common = min(len(made), len(recorded))
    different = np.flatnonzero(made[:common] != recorded[:common])
    if len(different):
        return int(different[0])
    return None if len(made) >= len(recorded) else common
