"""Compiling the hot loops before anything is timed: `python -m wbmpc.warm_up`, and the start of every run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Timer

from wbmpc.jit import forget_sources
from wbmpc.loop import run_lockstep
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import robot_path
from wbmpc.scenario.validate import validate

PATIENCE = 5.0  # [s] before a word is said; code that is cached is there sooner
BRIEF = 0.021  # [s] three plans
EVERYTHING = {  # a contact is needed and chosen in the first plan, a step asked for in the third
    "name": "warm_up",
    "duration": 5.0,
    "world": {"objects": {"table": {"kind": "box", "size": [0.20, 0.60, 0.20], "position": [0.30, 0.0]}}},
    "patches": {"table": {"on": "table", "face": "top", "offset": [-0.06, -0.11]}},
    "tasks": [
        {"kind": "reach", "target": [0.44, 0.05, 0.30], "start": 0.0, "arrive_by": 1.0, "hold": 0.5},
        {"kind": "walk", "commands": [{"time": 0.02, "velocity": [0.01, 0.0]}]},
    ],
    "checks": [{"kind": "upright_at_end"}],
}


@cache
def compile_kernels() -> None:
    """Make a few ticks and plans in memory, which compiles every kernel or loads it; says so when it takes a while.

    Once in a process; a second call does nothing.
    """
    scenario, findings = validate(EVERYTHING, source=Path("warm_up"))
    assert scenario is not None, findings
    brief = scenario.model_copy(update={"duration": BRIEF})
    with _announced():
        robot = Robot.load(robot_path(brief))
        run_lockstep(brief, robot=robot, recorder=Recorder(robot, expected_ticks=round(BRIEF * 1e3)))
    forget_sources()


@contextmanager
def _announced() -> Iterator[None]:
    timer = Timer(PATIENCE, print, ["compiling the hot loops, once: this takes about a minute"], {"file": sys.stderr})
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


if __name__ == "__main__":
    compile_kernels()
