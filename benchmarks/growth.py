"""How times grow: the planner's stages with the horizon, the tracker with the joints.

    python -m benchmarks growth

All sizes take turns, block by block, on the same snapshots and ticks.
"""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib import pyplot

from benchmarks.braced_states import REACH, Ticks, record
from benchmarks.longer_robot import lengthened, with_chain
from benchmarks.plan_peer import planner, snapshots
from benchmarks.report import Section, Table, micro, ratio
from wbmpc.loop import no_garbage_collection
from wbmpc.robot import Robot
from wbmpc.scenario import load_scenario, robot_path
from wbmpc.signals import PlanReport
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tracker import Tracker

HORIZONS = (8, 16, 24, 32, 48, 64)  # N, knots of 0.1 s
USUAL_HORIZON = 16
JOINTS = (23, 27, 31, 35, 40)
SNAPSHOTS, PLANS = 100, 10  # of all snapshots, and in one block
BLOCK = 50  # ticks
STAGES = {
    "stage 1": lambda plan: plan.stage1.solve_time,
    "stage 2": lambda plan: plan.stage2.solve_time,
    "whole plan": lambda plan: plan.plan_time,
}
NOTE = """Knots are 0.1 s apart for every N: a longer horizon, not a finer one. The snapshots are the first second of
`reach`, in which its contact is needed and chosen; stage 2 is both of its solves, assembly included. Joints beyond 23
are a chain of one-gram links on the robot's back, because a real arm with wrists would be another robot with other
motions: the ticks are those of `reach` while a hand braces, the chain rests. Exponents are fitted to the p50s of the
larger half of the sizes: below, what does not grow hides what does."""


def horizons() -> dict[str, dict[int, list[list[float]]]]:
    """Seconds of every stage and N, in blocks."""
    scenario = load_scenario(REACH)
    robot = Robot.load(robot_path(scenario))
    states = snapshots(scenario, robot, SNAPSHOTS)
    planners = {n: planner(load_scenario(REACH, {"planner.horizon_steps": n}), robot) for n in HORIZONS}
    blocks: dict[str, dict[int, list[list[float]]]] = {stage: {n: [] for n in HORIZONS} for stage in STAGES}
    for first in range(0, len(states), PLANS):
        for n, solver in planners.items():
            plans: list[PlanReport] = [solver.solve(state).report for state in states[first : first + PLANS]]
            for stage, seconds in STAGES.items():
                blocks[stage][n].append([seconds(plan) for plan in plans])
    return blocks


def joints(ticks: Ticks, folder: Path) -> dict[int, list[list[float]]]:
    """Seconds of a tracker's tick for every number of joints, in blocks."""
    asked = {}
    for count in JOINTS:
        robot = with_chain(ticks.robot, count - ticks.robot.nj, folder)
        asked[count] = (Tracker(robot, TrackerSettings(), step=ticks.step), lengthened(ticks, robot))
    blocks: dict[int, list[list[float]]] = {count: [] for count in JOINTS}
    for turn in range(2):  # the first one warms up
        for first in range(0, len(ticks.states), BLOCK):
            for count, (tracker, own) in asked.items():
                pairs = zip(own.states[first : first + BLOCK], own.setpoints[first : first + BLOCK], strict=True)
                seconds = [tracker.solve(state, setpoint).solve_time for state, setpoint in pairs]
                if turn:
                    blocks[count].append(seconds)
    return blocks


def measure() -> Section:
    """Tables and two plots."""
    with no_garbage_collection(), TemporaryDirectory() as folder:
        by_horizon = horizons()
        by_joints = joints(record(), Path(folder))
    section = Section("growth", "Growth with the horizon and the joints", notes=[NOTE])
    for stage, blocks in by_horizon.items():
        table = Table((f"{stage}, N", "p50, µs", "p99, µs", f"× N = {USUAL_HORIZON}"))
        section.tables.append(_filled(table, blocks, USUAL_HORIZON))
    table = Table(("tracker, joints", "p50, µs", "p99, µs", f"× {JOINTS[0]} joints"))
    section.tables.append(_filled(table, by_joints, JOINTS[0]))
    section.pictures = {
        "growth_horizon.svg": plot(by_horizon, "N, knots of the horizon"),
        "growth_joints.svg": plot({"tracker": by_joints}, "joints"),
    }
    return section


def _filled(table: Table, blocks: dict[int, list[list[float]]], usual: int) -> Table:
    for size, kept in blocks.items():
        every = np.concatenate(kept)
        table.rows.append((str(size), micro(every, 50), micro(every, 99), ratio(kept, blocks[usual])))
    return table


def plot(curves: dict[str, dict[int, list[list[float]]]], label: str) -> str:
    """p50 against size on logarithmic axes, p10 to p90 as bands, with exponents fitted to the larger half: an SVG."""
    figure, axes = pyplot.subplots(figsize=(5.2, 3.4), layout="constrained")
    for name, blocks in curves.items():
        sizes = list(blocks)
        low, middle, high = np.array([_percentiles(np.concatenate(blocks[size])) for size in sizes]).T
        larger = slice(len(sizes) // 2, None)
        exponent = np.polyfit(np.log(sizes[larger]), np.log(middle[larger]), 1)[0]
        (line,) = axes.loglog(sizes, middle, marker="o", markersize=3, label=f"{name}: exponent {exponent:.1f}")
        axes.fill_between(sizes, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.set(xlabel=label, ylabel="time [ms]")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    pyplot.close(figure)
    return text.getvalue()


def _percentiles(seconds: np.ndarray) -> np.ndarray:
    return 1e3 * np.percentile(seconds, [10, 50, 90])
