"""Where the time of a run goes.

    python -m benchmarks [--scenarios stand,reach]

One lockstep run of each scenario with a recording and one without, then the recorded QPs on every backend. Nothing
here is a threshold: the numbers are the machine's. Compare them with the yardstick, a fixed numpy kernel timed before
and after, and trust ratios within one run more than milliseconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.qp_backends import measure
from benchmarks.qp_families import recorded
from benchmarks.stopwatch import timed, yardstick
from benchmarks.taps import tapped
from wbmpc.estimator import Estimator
from wbmpc.plant import Plant
from wbmpc.qp import MIQP_BACKENDS
from wbmpc.qp.workspace import qp_backend_names
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink import RerunSink
from wbmpc.scenario import load_scenario
from wbmpc.session import run_scenario
from wbmpc.signals import SolveStatus

ROOT = Path(__file__).parents[1]
TICK_PARTS = (
    ("sensors", Plant, "measure"),
    ("estimator", Estimator, "update"),
    ("physics and truth", Plant, "step"),
    ("recorder", Recorder, "append"),
)
QPS = {  # the QPs inside the stages, by tap (benchmarks/taps.py)
    "ComHeightStage 1": "  stage 1: QP",
    "WholeBodyStage 1": "  stage 2: QP of the need",
    "WholeBodyStage 2": "  stage 2: QP of the motion",
    "ContactChoice 1": "  stage 3: MIQP at firing",
    "ContactForce 1": "  stage 3: QP of the forces",
    "Tracker 1": "  tracker: QP",
}
STEPS = 60  # solves of each backend on each recorded QP


def _row(table: Table, name: str, seconds: Sequence[float]) -> None:
    if not len(seconds):
        table.add_row(name, "-", "-", "-", "0")
        return
    p50, p99, most = 1e3 * np.percentile(seconds, [50, 99, 100])
    table.add_row(name, f"{p50:.3f}", f"{p99:.3f}", f"{most:.3f}", str(len(seconds)))


def report_run(console: Console, name: str) -> None:
    """Times of one scenario, stage by stage, and how fast it ran with a recording and without."""
    path = ROOT / "scenarios" / f"{name}.yaml"
    methods = [(owner, method) for _, owner, method in TICK_PARTS]
    with TemporaryDirectory() as folder, tapped() as taps, timed(*methods, (RerunSink, "flush")) as parts:
        result = run_scenario(load_scenario(path), name=name, recording=Path(folder) / f"{name}.rrd")
    bare = run_scenario(load_scenario(path), name=name)

    recorder, flushes = result.recorder, parts[-1]
    table = Table(title=f"{name}: wall times in ms", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for header in ("p50", "p99", "max", "calls"):
        table.add_column(header, justify="right")
    _row(table, "tracker tick (1 kHz)", recorder.command_solve_time)
    _row(table, QPS["Tracker 1"], taps["Tracker 1"].seconds)
    for (part, _, _), seconds in zip(TICK_PARTS, parts, strict=False):
        _row(table, part, seconds)
    _row(table, "recording flushed (2 Hz)", flushes)
    _row(table, "whole plan (100 Hz)", [plan.plan_time for plan in recorder.plans])
    for stage in ("stage1", "stage2", "stage3"):
        ran = [r for plan in recorder.plans if (r := getattr(plan, stage)).status != SolveStatus.NOT_RUN]
        _row(table, f"stage {stage[-1]}", [report.solve_time for report in ran])
        for label, title in QPS.items():
            if title.startswith(f"  stage {stage[-1]}") and label in taps:
                _row(table, title, taps[label].seconds)
    console.print(table)
    ticks = len(recorder.command_solve_time)
    console.print(f"recording: {1e6 * (sum(parts[3]) + sum(flushes)) / ticks:.1f} µs a tick, flushes included")
    factors = [run.verdict.real_time_factor for run in (result, bare)]
    console.print(f"lockstep real-time factor: {factors[0]:.2f} with a recording, {factors[1]:.2f} without")
    same = result.verdict.state_sha256 == bare.verdict.state_sha256
    console.print(f"same motion in both, bit for bit: {'yes' if same else 'NO'}\n")


def report_backends(console: Console) -> None:
    """The default backend on the recorded QPs, and every other as a multiple of it."""
    native = [name for name in qp_backend_names() if name != "daqp"]
    table = Table(
        title="recorded QPs, warm-started: p50, the others as multiples of it",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for header in ("problem", "variables × rows", "daqp, ms", *native, "highs (MIQP)"):
        left = header == "problem"
        table.add_column(header.replace(":", ":\n"), justify="left" if left else "right", no_wrap=left)
    for path in sorted((ROOT / "tests" / "qp" / "instances").glob("*.npz")):
        family = recorded(path)
        mixed = bool(family.problem.binary.size)
        results = measure(family, list(MIQP_BACKENDS) if mixed else ["daqp", *native], STEPS)
        reference = float(np.median(results["daqp"].seconds))
        cells = []
        for name in (*native, "highs"):
            if name not in results:
                cells.append("")
            elif results[name].failures and not results["daqp"].failures:
                cells.append("refused")
            else:
                cells.append(f"{float(np.median(results[name].seconds)) / reference:.1f}")
        size = f"{family.problem.variables} × {family.problem.rows}"
        table.add_row(path.stem, size, f"{1e3 * reference:.3f}", *cells)
    console.print(table)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Where the time of a run goes.")
    parser.add_argument("--scenarios", default="stand,reach", help="comma-separated names")
    names = parser.parse_args().scenarios.split(",")
    console = Console(width=110, highlight=False)
    before = yardstick()
    for name in names:
        report_run(console, name)
    report_backends(console)
    after = yardstick()
    console.print(
        f"yardstick (64 × 64 product and Cholesky), p50: {1e6 * before:.0f} µs before, {1e6 * after:.0f} after"
    )


if __name__ == "__main__":
    main()
