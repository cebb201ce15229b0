"""One scenario from end to end: robot, world, recorder, loop, checks, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import mujoco
import numpy as np

from wbmpc.checks.context import CheckContext
from wbmpc.checks.fall import FallWatch
from wbmpc.checks.registry import evaluate_checks
from wbmpc.facts import facts_of
from wbmpc.loop import run_lockstep
from wbmpc.metrics import metrics_of
from wbmpc.provenance import document_of
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose, Scenario, build_world, resolve_patches, robot_path
from wbmpc.signals import Vector
from wbmpc.timing import LoopTiming
from wbmpc.verdict import Verdict, solver_statistics
from wbmpc.versions import versions
from wbmpc.warm_up import compile_kernels

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
    realtime: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> RunResult:
    """Run one scenario and judge it.

    Args:
        scenario: valid, all overrides applied.
        name: of the run, in its verdict and recording.
        recording: the .rrd file to write; None writes none and changes nothing else.
        realtime: against the wall clock, the planner in its own thread; otherwise in lockstep.
        on_progress: called now and then with the simulated time [s].

    Raises:
        WbmpcError: the robot cannot be read, or the recording not written.
    """
    started = perf_counter()
    compile_kernels()
    robot = Robot.load(robot_path(scenario))
    model = build_world(scenario, robot_path(scenario))
    patches = resolve_patches(scenario)
    ticks = round(scenario.duration * scenario.loop.physics_rate)
    recorder = Recorder(robot, expected_ticks=ticks, plant_nq=model.nq, plant_nv=model.nv)
    run = _loop(realtime)
    with _sink(recording, name, scenario, model, robot, recorder, patches, realtime) as sink:
        fallen = FallWatch(recorder, scenario.universal.no_fall, timestep=model.opt.timestep)
        timing = run(
            scenario,
            robot=robot,
            recorder=recorder,
            model=model,
            sink=sink,
            on_progress=on_progress,
            ended=fallen,
        )
        context = CheckContext(recorder, facts_of(model, robot, scenario, patches))
        verdict = Verdict(
            scenario=name,
            seed=scenario.seed,
            checks=evaluate_checks(context, universal=scenario.universal, checks=scenario.checks),
            metrics=metrics_of(context),
            solver=solver_statistics(recorder),
            timing=timing.summary(),
            state_sha256=recorder.state_sha256,
        )
        if sink is not None:
            sink.finish(verdict.as_dict())
    return RunResult(verdict, recorder, perf_counter() - started)


def _loop(realtime: bool) -> Callable[..., LoopTiming]:
    if not realtime:
        return run_lockstep
    from wbmpc.realtime import run_realtime  # threads and their settings: only for those who ask for them

    return run_realtime


def _sink(  # type: ignore[no-untyped-def]  # a context manager of a RerunSink, or of None
    path: Path | None,
    name: str,
    scenario: Scenario,
    model: mujoco.MjModel,
    robot: Robot,
    recorder: Recorder,
    patches: Sequence[PatchPose],
    realtime: bool,
):
    if path is None:
        return nullcontext(None)
    from wbmpc.rerun_sink import Patch, RerunSink  # rerun takes a second to import: only for those who record

    return RerunSink(
        path,
        model,
        recorder,
        joint_names=robot.joint_names,
        scenario_name=name,
        scenario_text=scenario.to_yaml(),
        seed=scenario.seed,
        tick_rate=scenario.loop.physics_rate,
        rate=scenario.recording.rate,
        knot_period=scenario.planner.horizon_step,
        patches=[Patch(patch.name, _square(patch), patch.normal) for patch in patches],
        versions=versions(),
        replay=document_of(scenario, name, realtime=realtime),
    )


def _square(patch: PatchPose) -> Vector:
    """(4, 3) [m] corners of a square on the surface around the patch's centre."""
    along = np.eye(3)[np.argmin(np.abs(patch.normal))]
    first = np.cross(patch.normal, along)
    first /= np.linalg.norm(first)
    second = np.cross(patch.normal, first)
    return patch.position + PATCH_DRAWN * np.array([first + second, -first + second, -first - second, first - second])
