"""The whole plan on this project's QP workspaces against the same stages on OSQP through qpsolvers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from copy import deepcopy
from pathlib import Path

import numpy as np

from benchmarks.braced_states import REACH
from benchmarks.qp_families import silent
from benchmarks.replaced import replaced
from benchmarks.report import Section, Table, micro, ratio
from wbmpc.initial import initial_posture
from wbmpc.loop import no_garbage_collection, run_lockstep
from wbmpc.planner.plan import Plan
from wbmpc.planner.planner import Planner
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import (
    Scenario,
    build_world,
    load_scenario,
    resolve_ground,
    resolve_loads,
    resolve_obstacles,
    resolve_patches,
    robot_path,
)
from wbmpc.signals import PlanReport, RobotState, SolveStatus

SNAPSHOTS = 800  # from the start of `reach` to the middle of its hold
BLOCK = 20  # plans
BACKENDS = ("daqp", "qpsolvers:osqp")
TOLERANCE = 1e-3  # [m] of the planned CoM
NOTE = f"""The snapshots are those of a lockstep run of `reach`; both planners see all of them, {BLOCK} in turn. A
planner remembers what it has planned, so a difference of one plan lives on in the next. Stage 3 is daqp's in both."""


class _Enough(Exception):
    """All snapshots are recorded."""


def snapshots(scenario: Scenario, robot: Robot, count: int) -> list[RobotState]:
    """The first states that a lockstep run hands to its planner."""
    states: list[RobotState] = []
    recorder = Recorder(robot, expected_ticks=round(scenario.duration * scenario.loop.physics_rate))

    def listening(solve: Callable[..., Plan]) -> Callable[..., Plan]:
        def listen(planner: Planner, state: RobotState) -> Plan:
            if len(states) == count:
                raise _Enough
            states.append(deepcopy(state))
            return solve(planner, state)

        return listen

    with replaced(Planner, "solve", listening), suppress(_Enough):
        run_lockstep(scenario, robot=robot, recorder=recorder)
    return states


def planner(scenario: Scenario, robot: Robot) -> Planner:
    """A planner at the start of `scenario`, as a session makes it."""
    qpos = initial_posture(scenario, robot, build_world(scenario, robot.path))
    return Planner(
        robot,
        scenario.planner,
        tasks=scenario.tasks,
        patches=resolve_patches(scenario),
        obstacles=resolve_obstacles(scenario),
        ground=resolve_ground(scenario),
        loads=resolve_loads(scenario),
        q=robot.q_from_qpos(qpos[: robot.nq]),
        period=scenario.loop.planner_period_ticks * scenario.loop.timestep,
    )


def measure(path: Path = REACH, count: int = SNAPSHOTS) -> Section:
    """Record, alternate, compare."""
    scenario = load_scenario(path)
    robot = Robot.load(robot_path(scenario))
    states = snapshots(scenario, robot, count)
    planners = {backend: planner(load_scenario(path, {"planner.qp_backend": backend}), robot) for backend in BACKENDS}
    reports: dict[str, list[PlanReport]] = {backend: [] for backend in BACKENDS}
    blocks: dict[str, list[list[float]]] = {backend: [] for backend in BACKENDS}
    with silent(), no_garbage_collection():
        for first in range(0, len(states), BLOCK):
            for backend, solver in planners.items():
                plans = [solver.solve(state).report for state in states[first : first + BLOCK]]
                reports[backend] += plans
                blocks[backend].append([plan.plan_time for plan in plans])
    table = Table(("whole plan", "p50, µs", "p99, µs", "× daqp", "plans with a failed stage"))
    for backend in BACKENDS:
        every = np.concatenate(blocks[backend])
        failed = sum(_failed(report) for report in reports[backend])
        row = (backend, micro(every, 50), micro(every, 99), ratio(blocks[backend], blocks["daqp"]), str(failed))
        table.rows.append(row)
    difference = np.array(
        [np.abs(a.com - b.com).max() for a, b in zip(*(reports[backend] for backend in BACKENDS), strict=True)]
    )
    share = 100.0 * np.mean(difference < TOLERANCE)
    answers = Table(("planned CoM over the horizon, difference", "p50, mm", "largest, mm", f"below {TOLERANCE:g} m"))
    p50, most = 1e3 * np.nanmedian(difference), 1e3 * np.nanmax(difference)
    answers.rows.append((f"of {len(states)} plans", f"{p50:.4f}", f"{most:.4f}", f"{share:.0f} %"))
    return Section("plan", "The whole plan against qpsolvers with OSQP", [table, answers], [NOTE])


def _failed(report: PlanReport) -> bool:
    done = (SolveStatus.SOLVED, SolveStatus.NOT_RUN)
    return any(stage.status not in done for stage in (report.stage1, report.stage2, report.stage3))
