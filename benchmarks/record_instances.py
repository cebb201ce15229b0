"""Record QPs of the real planner and tracker, for the conformance tests and benchmarks of the backends.

    python -m benchmarks.record_instances [--out tests/qp/instances]

Runs `two_hands` in lockstep, and `reach`, as it is and with a table that bears 0.05 N, and keeps one problem for each
line of MOMENTS: the first one that a solver answers at or after the stated time. Run it again when a problem's shape
changes.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.taps import Tap, tapped
from wbmpc.loop import run_lockstep
from wbmpc.qp import QpSolution, load_instance, save_instance
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import load_scenario, robot_path
from wbmpc.signals import SolveStatus

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Moment:
    """Which problem to keep."""

    name: str  # of the file
    tap: str  # see benchmarks/taps.py; without a number any of its class
    time: float  # [s]
    status: SolveStatus = SolveStatus.SOLVED
    run: str = "reach"  # of RUNS
    variables: int = 0  # of the problem at least


class _Enough(Exception):
    """Nothing is left to keep of this run."""


RUNS: dict[str, tuple[str, dict[str, Any]]] = {  # scenario, and what is changed of it
    "reach": ("reach", {}),
    "weak_table": (
        "reach",
        {
            "patches": {"weak": {"on": "table", "offset": [-0.06, -0.11], "force_cap": 0.05}},
            "checks": [{"kind": "upright_at_end"}],
        },
    ),
    "two_hands": ("two_hands", {}),
}
MOMENTS = (
    Moment("stage1_start", "ComHeightStage 1", 0.0),
    Moment("stage1_lean", "ComHeightStage 1", 6.0),
    Moment("stage2_com_start", "HorizontalMotion", 0.0),
    Moment("stage2_com_lean", "HorizontalMotion", 8.5, variables=33),  # ΔZ is not zero
    Moment("stage2_joints_approach", "JointVelocities 1", 3.0),
    Moment("stage2_joints_lean", "JointVelocities 1", 8.5),
    Moment("stage3_choice", "ContactChoice 1", 0.0),  # the mixed-integer problem when a contact is needed
    Moment("stage3_hopeless", "ContactChoice 1", 0.0, SolveStatus.INFEASIBLE, run="weak_table"),  # no candidate helps
    Moment("stage3_two", "ContactChoice 1", 0.0, run="two_hands"),  # one contact is not enough
    Moment("stage3_force_ramp", "ContactForce 1", 4.0),
    Moment("stage3_force_lean", "ContactForce 1", 8.5),
    Moment("stage3_force_two", "ContactForce 1", 7.0, run="two_hands"),
    Moment("tracker_stand", "Tracker 1", 1.0),
    Moment("tracker_braced", "Tracker 1", 8.5),
)


def record(run: str, out: Path) -> None:
    """Save the moments of one run in the folder `out`."""
    name, changes = RUNS[run]
    plain = {"planner.miqp_backend": "daqp"}  # stage 3 as the QPs of `QuadraticProgram`
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", {**changes, **plain})
    robot = Robot.load(robot_path(scenario))
    recorder = Recorder(robot, expected_ticks=round(scenario.duration * scenario.loop.physics_rate))
    left = {moment.name: moment for moment in MOMENTS if moment.run == run}

    def keep(tap: Tap, solution: QpSolution) -> None:
        time = recorder.plans[-1].time if recorder.plans else 0.0
        for name, moment in list(left.items()):
            there = moment.tap in (tap.label, tap.maker) and tap.problem.variables >= moment.variables
            if there and time >= moment.time and solution.status is moment.status:
                save_instance(tap.problem, out / f"{name}.npz")
                del left[name]
        if not left:
            raise _Enough

    with tapped(keep), suppress(_Enough):
        run_lockstep(scenario, robot=robot, recorder=recorder)
    for moment in left.values():
        print(f"{moment.name}: {moment.tap} had no {moment.status.name} problem from {moment.time:g} s on")


def main() -> None:
    """Run and save."""
    parser = argparse.ArgumentParser(description="Record QPs of a reach.")
    parser.add_argument("--out", type=Path, default=ROOT / "tests" / "qp" / "instances")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for run in RUNS:
        record(run, out)
    for path in sorted(out.glob("*.npz")):
        problem = load_instance(path)
        print(f"{path.name}: {problem.variables} variables, {problem.rows} rows, {path.stat().st_size / 1e3:.1f} kB")


if __name__ == "__main__":
    main()
