"""A recorded run once more, in lockstep, each plan in effect from the tick at which it was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbmpc.errors import WbmpcError
from wbmpc.loop import run_lockstep
from wbmpc.provenance import same_source, scenario_of
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import RecordedRun, checksums, recorded_run
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world


@dataclass(frozen=True, slots=True)
class Replayable:
    """A recorded run and its scenario, ready to be made again."""

    name: str
    run: RecordedRun
    scenario: Scenario
    realtime: bool
    same_source: bool  # whether this is the program, to the letter, that made it

    @property
    def whole(self) -> bool:
        """Whether the recording reaches the end that the scenario asks for."""
        return self.run.schedule.ticks == round(self.scenario.duration * self.scenario.loop.physics_rate)


@dataclass(frozen=True, slots=True)
class Replay:
    """How a replay ended."""

    state_sha256: str
    first_difference: int | None  # tick; None: not one bit of any tick differs


def open_run(path: Path, *, robot: Path | None = None) -> Replayable:
    """Read a recording.

    Raises:
        WbmpcError: it is no recording, holds no schedule or no tick, or its run cannot be made by this program.
    """
    return run_of(Recording(path), robot=robot)


def run_of(recording: Recording, *, robot: Path | None = None) -> Replayable:
    """`open_run` of a recording that has been read."""
    run = recorded_run(recording)
    document = run.document
    try:
        scenario = scenario_of(document, robot=robot)
    except WbmpcError as error:
        raise WbmpcError(f"{recording.path}: {error}") from None
    return Replayable(document["name"], run, scenario, document["realtime"], same_source(document))


def replay(recorded: Replayable, on_progress: Callable[[float], None] | None = None) -> Replay:
    """Make the run again, as far as it was recorded, and compare every tick."""
    scenario, schedule = recorded.scenario, recorded.run.schedule
    robot = Robot.load(Path(scenario.robot))
    model: Any = build_world(scenario, robot.path)
    recorder = Recorder(robot, expected_ticks=schedule.ticks, plant_nq=model.nq, plant_nv=model.nv)
    run_lockstep(scenario, robot=robot, recorder=recorder, model=model, on_progress=on_progress, schedule=schedule)
    return Replay(recorder.state_sha256, _first_difference(recorded.run, recorder))


def _first_difference(run: RecordedRun, recorder: Recorder) -> int | None:
    if recorder.state_sha256 == run.state_sha256:
        return None
    made, common = checksums(recorder), min(recorder.ticks, len(run.checksums))
    different = np.flatnonzero(made[:common] != run.checksums[:common])
    return int(different[0]) if len(different) else common  # one of them ended early
