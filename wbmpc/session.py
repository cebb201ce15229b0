"""One scenario from end to end: robot, world, recorder, loop, checks, verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from wbmpc.checks.context import CheckContext
from wbmpc.checks.fall import FallWatch
from wbmpc.checks.registry import evaluate_checks
from wbmpc.facts import facts_of
from wbmpc.jit import trim
from wbmpc.loop import run_lockstep
from wbmpc.metrics import metrics_of
from wbmpc.provenance import document_of
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose, Scenario, build_world, resolve_patches, robot_path
from wbmpc.signals import Vector
from wbmpc.timing import LoopTiming
from wbmpc.triage import Evidence, triage
from wbmpc.verdict import Verdict, solver_statistics
from wbmpc.versions import versions
from wbmpc.warm_up import compile_kernels

if TYPE_CHECKING:
    from wbmpc.realtime import Operator
    from wbmpc.rerun_sink import RerunSink

PATCH_DRAWN = 0.02  # [m] half edge of the square that stands for a candidate contact in the recording


@dataclass(frozen=True, slots=True)
class RunResult:
    """A finished run."""

    verdict: Verdict
    recorder: Recorder
    wall_time: float  # [s] of everything, set-up and checks included


def run_scenario(
    scenario: Scenario,
    *,
    name: str,
    recording: Path | None = None,
    viewer: str | None = None,
    realtime: bool = False,
    operator: Operator | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> RunResult:
    """Run one scenario and judge it.

    Args:
        scenario: valid, all overrides applied.
        name: of the run, in its verdict and recording.
        recording: the .rrd file to write; None writes none and changes nothing else.
        viewer: URL of a rerun viewer that shows the run as it goes on; changes nothing else but how fast it goes.
        realtime: against the wall clock, the planner in its own thread; otherwise in lockstep.
        operator: who takes part in a real-time run.
        on_progress: called now and then with the simulated time [s].

    Raises:
        WbmpcError: the robot cannot be read, or the recording not written.
    """
    started = perf_counter()
    compile_kernels()
    robot = Robot.load(robot_path(scenario))
    model = build_world(scenario, robot_path(scenario))
    ticks = round(scenario.duration * scenario.loop.physics_rate)
    stride = scenario.loop.physics_rate // scenario.recording.rate
    recorder = Recorder(robot, expected_ticks=ticks, stride=stride, plant_nq=model.nq, plant_nv=model.nv)
    # What a person did is not in the document: such a run cannot be made again from it.
    document = None if operator is not None else document_of(scenario, name, realtime=realtime)
    of_run = (name, scenario, model, robot, recorder, document)
    with open_sink(recording, *of_run) as file, open_sink(viewer, *of_run[:-1]) as view:
        fallen = FallWatch(recorder, scenario.universal.no_fall, timestep=model.opt.timestep)
        with _shown(view):
            _loop(realtime, operator)(
                scenario,
                robot=robot,
                recorder=recorder,
                model=model,
                sink=file,
                on_progress=on_progress,
                ended=fallen,
            )
        trim()  # what the loop has freed, before the checks ask for more
        verdict = verdict_of(recorder, scenario, name=name, model=model, robot=robot)
        trim()  # what the checks have freed, before the recording is finished
        for sink in (file, view):
            if sink is not None:
                sink.finish(verdict.as_dict())
    return RunResult(verdict, recorder, perf_counter() - started)


def verdict_of(recorder: Recorder, scenario: Scenario, *, name: str, model: mujoco.MjModel, robot: Robot) -> Verdict:
    """Judge what a run has left behind."""
    context = CheckContext(recorder, facts_of(model, robot, scenario, resolve_patches(scenario)))
    checks = evaluate_checks(context, universal=scenario.universal, checks=scenario.checks)
    return Verdict(
        scenario=name,
        seed=scenario.seed,
        checks=checks,
        triage=triage(Evidence(context, scenario, model), checks),
        metrics=metrics_of(context),
        solver=solver_statistics(recorder),
        timing=recorder.timing.summary(),
        state_sha256=recorder.state_sha256,
    )


def _loop(realtime: bool, operator: Operator | None) -> Callable[..., LoopTiming]:
    if not realtime:
        return run_lockstep
    from wbmpc.realtime import run_realtime  # threads and their settings: only for those who ask for them

    return run_realtime if operator is None else partial(run_realtime, operator=operator)


def open_sink(  # type: ignore[no-untyped-def]  # a context manager of a RerunSink, or of None
    target: Path | str | None,
    name: str,
    scenario: Scenario,
    model: mujoco.MjModel,
    robot: Robot,
    recorder: Recorder,
    replay: Mapping[str, Any] | None = None,
):
    """Where a run of `scenario` is recorded or, the target being a viewer's URL, shown; None for no target.

    `replay`: what the run was made of (`document_of`); None: it cannot be made again from the recording.
    """
    if target is None:
        return nullcontext(None)
    from wbmpc.rerun_sink import Patch, RerunSink  # rerun takes a second to import: only for those who record

    return RerunSink(
        target,
        model,
        recorder,
        joint_names=robot.joint_names,
        scenario_name=name,
        scenario_text=scenario.to_yaml(),
        seed=scenario.seed,
        tick_rate=scenario.loop.physics_rate,
        rate=scenario.recording.rate,
        knot_period=scenario.planner.horizon_step,
        patches=[
            Patch(patch.name, _square(patch), patch.normal, patch.friction) for patch in resolve_patches(scenario)
        ],
        versions=versions(),
        replay=replay,
    )


def _shown(view: RerunSink | None) -> AbstractContextManager[None]:
    if view is None:
        return nullcontext()
    from wbmpc.rerun_sink.live import shown

    return shown(view)


def _square(patch: PatchPose) -> Vector:
    """(4, 3) [m] corners of a square on the surface around the patch's centre."""
    along = np.eye(3)[np.argmin(np.abs(patch.normal))]
    first = np.cross(patch.normal, along)
    first /= np.linalg.norm(first)
    second = np.cross(patch.normal, first)
    return patch.position + PATCH_DRAWN * np.array([first + second, -first + second, -first - second, first - second])
