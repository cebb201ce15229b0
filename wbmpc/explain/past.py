"""A recorded run's plans made again: the planner is a function of its scenario and of the snapshots it was given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wbmpc.errors import WbmpcError
from wbmpc.loop import Session
from wbmpc.planner.planner import Planner
from wbmpc.recorder import Recorder
from wbmpc.replay import Replayable, run_of
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.snapshots import RecordedPlan, digest, recorded_plans
from wbmpc.robot import Robot
from wbmpc.scenario import Scenario, build_world
from wbmpc.signals import PlanReport, SolveStatus

HORIZONS = {"com": "/world/com/horizon", "zmp": "/world/zmp/horizon"}  # as drawn, in single precision


@dataclass(frozen=True)
class Past:
    """A recorded run and the snapshots that it planned from, in order."""

    recording: Recording
    run: Replayable
    plans: Sequence[RecordedPlan]

    @cached_property
    def robot(self) -> Robot:
        """Of the run."""
        return Robot.load(Path(self.run.scenario.robot))

    def tick_at(self, time: float) -> int:
        """Number of the tick at `time` [s].

        Raises:
            WbmpcError: it is not in the recording.
        """
        step, ticks = self.run.scenario.loop.timestep, self.run.run.schedule.ticks
        if not 0.0 <= time < (ticks - 0.5) * step:  # nan is not, either
            raise WbmpcError(f"--at {time:g}: outside the recording, which goes from 0 to {(ticks - 1) * step:g} s")
        return round(time / step)

    def index_at(self, time: float) -> int:
        """Number of the latest plan whose snapshot is not later than `time` [s].

        Raises:
            WbmpcError: there is none, or the recording ends earlier.
        """
        times = [plan.state.time for plan in self.plans]
        last = self.run.run.schedule.ticks * self.run.scenario.loop.timestep
        if not times[0] - 1e-9 <= time <= last + 1e-9:
            raise WbmpcError(
                f"--at {time:g}: outside the recording, which holds plans from {times[0]:g} s and ends at {last:g} s"
            )
        return int(np.searchsorted(times, time + 1e-9, side="right")) - 1

    def notable(self) -> list[tuple[int, str]]:
        """Plans at which something happened, in order: firings of stage 3, contacts, tasks, steps, failed solves."""
        times = np.array([plan.state.time for plan in self.plans])
        stamps, texts = self.recording.column("/log/events", "text")
        rows = [(float(t), str(text[0])) for t, text in zip(stamps, texts, strict=True)]
        for stage in ("stage1", "stage2", "stage3"):
            stamps, states = self.recording.column(f"/solver_status/{stage}", "state")
            sound = (SolveStatus.SOLVED.name, SolveStatus.NOT_RUN.name)
            rows += [
                (float(t), f"{stage} fails: {state[0]}")
                for t, state in zip(stamps, states, strict=True)
                if str(state[0]) not in sound
            ]
        at = [(int(np.abs(times - time).argmin()), time, text) for time, text in sorted(rows)]
        return [(k, text) for k, time, text in at if abs(times[k] - time) < 1e-6]

    def planner_before(
        self, index: int, on_progress: Callable[[int], None] | None = None
    ) -> tuple[Planner, int | None]:
        """The planner as it was before plan `index`, and the first plan on the way that was not the recorded one."""
        planner, parted = new_planner(self.run.scenario, self.robot), None
        for k, plan in enumerate(self.plans[:index]):
            report = planner.solve(plan.state).report
            if parted is None and digest(report) != plan.digest:
                parted = k
            if on_progress is not None:
                on_progress(k)
        return planner, parted

    def drawn_difference(self, report: PlanReport) -> dict[str, float]:
        """Largest distance [m] of a plan's CoM and ZMP horizons from the recorded ones, which are drawn to 1e-7 m."""
        differences = {}
        for name, entity in HORIZONS.items():
            times, strips = self.recording.column(entity, "strips")
            k = int(np.abs(times - report.time).argmin())
            drawn, made = np.asarray(strips[k], float).reshape(-1, 3), getattr(report, name)
            differences[name] = float(np.abs(drawn[:, : made.shape[1]] - made).max())
        return differences


def open_past(path: Path, *, robot: Path | None = None) -> Past:
    """Read a recording.

    Raises:
        WbmpcError: as `replay.open_run`, or the recording is older than the snapshots in it.
    """
    recording = Recording(path)
    run, plans = run_of(recording, robot=robot), recorded_plans(recording)
    if not plans:
        raise WbmpcError(
            f"{path}: holds no plan's snapshot (an older recording, or a run shorter than one plan); run it anew"
        )
    return Past(recording, run, plans)


def new_planner(scenario: Scenario, robot: Robot) -> Planner:
    """The planner of a run that has not begun: it has made the plan that is there before the robot is let go."""
    model: Any = build_world(scenario, robot.path)
    recorder = Recorder(robot, expected_ticks=1, plant_nq=model.nq, plant_nv=model.nv)
    return Session(scenario, robot=robot, model=model, recorder=recorder).planner
