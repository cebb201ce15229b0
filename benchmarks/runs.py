"""Where the time of a run goes: every stage and every part of the tick, in two lockstep runs of each scenario."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.report import Section, Table
from benchmarks.stopwatch import timed
from benchmarks.taps import tapped
from wbmpc.estimator import Estimator
from wbmpc.planner.contact_sets import ContactSets
from wbmpc.planner.knot_forces import KnotForces
from wbmpc.plant import Plant
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink import RerunSink
from wbmpc.scenario import load_scenario
from wbmpc.session import run_scenario
from wbmpc.signals import SolveStatus

SCENARIOS = Path(__file__).parents[1] / "scenarios"
NAMES = ("stand", "reach")
TICK_PARTS = (
    ("sensors", Plant, "measure"),
    ("estimator", Estimator, "update"),
    ("physics and truth", Plant, "step"),
    ("recorder", Recorder, "append"),
    ("recording flushed (2 Hz)", RerunSink, "flush"),
    ("stage 3: choice at firing", ContactSets, "solve"),
    ("stage 3: forces", KnotForces, "solve"),
)
NOTE = """*: from a second run, with a stopwatch around each part and each solve, which themselves take time."""
QPS = {  # the QPs inside the stages, by tap, or by the class that made several (benchmarks/taps.py)
    "ComHeightStage 1": "stage 1: QP",
    "HorizontalMotion": "stage 2: QPs of the CoM",
    "JointVelocities 1": "stage 2: QP of the joints",
    "Tracker": "tracker: QPs, without torque rows and with them",
}


def report_run(name: str) -> Table:
    """Times of one scenario with a recording: what the loop itself measures, then a second run with stopwatches."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    methods = [(owner, method) for _, owner, method in TICK_PARTS]
    with TemporaryDirectory() as folder:
        recorder = run_scenario(scenario, name=name, recording=Path(folder) / f"{name}.rrd").recorder
        with tapped() as taps, timed(*methods) as parts:
            run_scenario(scenario, name=name, recording=Path(folder) / f"{name}.rrd")
    table = Table((f"{name}, wall times in ms", "p50", "p99", "max", "calls"))

    def row(label: str, seconds: Sequence[float] | np.ndarray) -> None:
        numbers = 1e3 * np.percentile(seconds, [50, 99, 100]) if len(seconds) else ()
        table.rows.append((label, *(f"{x:.3f}" for x in numbers), *[""] * (3 - len(numbers)), str(len(seconds))))

    row("tracker tick (1 kHz)", recorder.command_solve_time)
    row("whole plan (100 Hz)", [plan.plan_time for plan in recorder.plans])
    for stage in ("stage1", "stage2", "stage3"):
        reports = [getattr(plan, stage) for plan in recorder.plans]
        ran = [report.solve_time for report in reports if report.status != SolveStatus.NOT_RUN]
        row(f"stage {stage[-1]}, assembly included", ran)
    for (part, _, _), seconds in zip(TICK_PARTS, parts, strict=True):
        row(f"{part}*", seconds)
    for label, title in QPS.items():
        row(f"{title}*", [s for tap in taps.values() if label in (tap.label, tap.maker) for s in tap.seconds])
    return table


def measure() -> Section:
    """All scenarios of NAMES."""
    return Section("runs", "Where the time of a run goes", [report_run(name) for name in NAMES], [NOTE])
