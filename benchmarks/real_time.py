"""The whole loop against real time: lockstep with and without a recording, and the wall clock with and without a
planner.

python -m benchmarks realtime
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.replaced import replaced
from benchmarks.report import Section, Table
from benchmarks.stopwatch import timed
from wbmpc.loop import LoopTiming
from wbmpc.planner_process import PlannerProcess
from wbmpc.realtime import run_realtime
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink import RerunSink
from wbmpc.robot import Robot
from wbmpc.scenario import load_scenario, robot_path
from wbmpc.session import run_scenario
from wbmpc.signals import RobotState, TargetMove

SCENARIOS = Path(__file__).parents[1] / "scenarios"
ROUNDS = 3  # of every kind of run, in turn
LOCKSTEP = ("stand", "reach")
WALL_CLOCK = "reach"  # given one fixed plan, its robot stands
NOTE = """Lockstep: simulated over wall time, above 1 is faster than real time. Kept in memory: `Recorder.append`,
which every run needs, because checks judge it; written: the flushes of the `.rrd`. Wall clock: ticks that began more
than a timestep late, and by how much the run ended late. *One fixed plan* is the same loop whose planner is asked for
nothing after the first plan: what the machine and the tick itself miss."""


def idle_planner() -> AbstractContextManager[None]:
    """Inside, no snapshot reaches the planner: the loop follows its first plan."""

    def ignore(planner: PlannerProcess, snapshot: RobotState, orders: Sequence[TargetMove] = ()) -> None:
        """Nothing is asked for."""

    return replaced(PlannerProcess, "request", lambda request: ignore)


def lockstep(name: str) -> tuple[Table, bool]:
    """Runs with and without a recording in turn; whether all of them moved alike, bit for bit."""
    factors: dict[str, list[float]] = {"with a recording": [], "without": []}
    costs: dict[str, list[tuple[float, float]]] = {kind: [] for kind in factors}  # [µs a tick]
    hashes = set()
    for _ in range(ROUNDS):
        for kind, kept in factors.items():
            scenario = load_scenario(SCENARIOS / f"{name}.yaml")
            with (
                TemporaryDirectory() as folder,
                timed((Recorder, "append"), (RerunSink, "flush")) as (appends, flushes),
            ):
                recording = Path(folder) / "run.rrd" if kind == "with a recording" else None
                verdict = run_scenario(scenario, name=name, recording=recording).verdict
            kept.append(verdict.real_time_factor)
            hashes.add(verdict.state_sha256)
            costs[kind].append((1e6 * sum(appends) / len(appends), 1e6 * sum(flushes) / len(appends)))
    columns = ("real-time factor, p50", "least", "most", "kept in memory, µs a tick", "written, µs a tick")
    table = Table((f"lockstep, {name}", *columns))
    for kind, values in factors.items():
        kept_cost, written = (f"{cost:.1f}" for cost in np.median(costs[kind], axis=0))
        table.rows.append(
            (kind, f"{np.median(values):.2f}", f"{min(values):.2f}", f"{max(values):.2f}", kept_cost, written)
        )
    return table, len(hashes) == 1


def wall_clock(name: str, planner: str) -> LoopTiming:
    """One `--realtime` run of a shipped scenario, not recorded to a file; `planner`: `loop.realtime_planner`."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml", {"loop.realtime_planner": planner})
    robot = Robot.load(robot_path(scenario))
    ticks = round(scenario.duration * scenario.loop.physics_rate)
    return run_realtime(scenario, robot=robot, recorder=Recorder(robot, expected_ticks=ticks))


def measure() -> Section:
    """Lockstep first, then the wall clock."""
    tables, same = zip(*(lockstep(name) for name in LOCKSTEP), strict=True)
    table = Table(
        (
            f"wall clock, {WALL_CLOCK}",
            "missed ticks",
            "worst run",
            "late plans",
            "skipped",
            "ready p99, ms",
            "drift, ms",
        )
    )
    kinds: dict[str, tuple[str, Callable[[], AbstractContextManager[None]]]] = {
        "planner in a process": ("process", nullcontext),
        "planner in the thread": ("thread", nullcontext),
        "one fixed plan": ("process", idle_planner),
    }
    timings: dict[str, list[LoopTiming]] = {kind: [] for kind in kinds}
    for _ in range(ROUNDS):
        for kind, (where, planner) in kinds.items():
            with planner():
                timings[kind].append(wall_clock(WALL_CLOCK, where))
    ticks = round(1e3 * timings["one fixed plan"][0].simulated_time)
    for kind, runs in timings.items():
        missed = [run.missed_deadlines for run in runs]
        late, skipped = (sum(getattr(run, name) for run in runs) for name in ("late_plans", "skipped_plans"))
        plans = sum(len(run.plan_latency) for run in runs)
        table.rows.append(
            (
                kind,
                *(f"{100.0 * share / ticks:.2f} %" for share in (np.median(missed), max(missed))),
                f"{late} of {plans}",
                str(skipped),
                f"{1e3 * np.median([np.percentile(run.plan_ready, 99) for run in runs]):.0f}" if plans else "",
                f"{1e3 * np.median([run.drift for run in runs]):.1f}",
            )
        )
    bits = f"Same motion with and without a recording, bit for bit: {'yes' if all(same) else 'NO'}."
    return Section("realtime", "The whole loop against real time", [*tables, table], [NOTE, bits])
