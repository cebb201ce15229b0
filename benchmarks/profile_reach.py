"""Which functions one simulated second of `reach` is spent in: a table and a flame graph.

    python -m benchmarks profile

A timer interrupts the lockstep run several thousand times a second of wall time, and the Python stack is noted. A call
into C is interrupted when it returns: its time counts for the Python function that made it. Against cProfile, small
functions are not made to look expensive.
"""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from benchmarks.braced_states import REACH
from benchmarks.flame_graph import Stack, flame_graph
from benchmarks.report import Section, Table
from wbmpc.loop import run_lockstep
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import load_scenario, robot_path

BEGIN, END = 8.0, 9.0  # [s] of `reach`: leaning on its hand, all three stages at work
INTERVAL = 2e-4  # [s] of wall time between two looks at the stack
ROOT = "wbmpc.loop.run_lockstep"
SHOWN = 40  # functions in the table
NOTE = f"""From {BEGIN:g} to {END:g} s of a lockstep run without a recording. *own*: the stack ended in this function
or in the C code that it called (numpy, Pinocchio, MuJoCo, a QP solver); *with callees*: the function was on the
stack."""


class Sampler:
    """Counts stacks between `start` and `stop`."""

    def __init__(self) -> None:
        self.stacks: Counter[Stack] = Counter()

    @contextmanager
    def installed(self) -> Iterator[None]:
        """The timer's signal is this sampler's inside."""
        before = signal.signal(signal.SIGALRM, self._look)
        try:
            yield
        finally:
            self.stop()
            signal.signal(signal.SIGALRM, before)

    def start(self) -> None:
        """Begin to look."""
        signal.setitimer(signal.ITIMER_REAL, INTERVAL, INTERVAL)

    def stop(self) -> None:
        """Look no more."""
        signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _look(self, number: int, frame: FrameType | None) -> None:
        names = []
        while frame is not None:
            names.append(f"{frame.f_globals.get('__name__', '?')}.{frame.f_code.co_qualname}")
            frame = frame.f_back
        names.reverse()
        if ROOT in names and not names[-1].startswith(__name__):  # this very function can be interrupted, too
            self.stacks[tuple(names[names.index(ROOT) :])] += 1


def sample() -> Counter[Stack]:
    """Stacks of the second, from `run_lockstep` down, with how often each was seen."""
    scenario = load_scenario(REACH)
    robot = Robot.load(robot_path(scenario))
    recorder = Recorder(robot, expected_ticks=round(scenario.duration * scenario.loop.physics_rate))
    sampler = Sampler()

    def follow(time: float) -> None:
        if abs(time - BEGIN) < 1e-6:
            sampler.start()
        if abs(time - END) < 1e-6:
            sampler.stop()

    def ended() -> str | None:
        return "profiled" if recorder.time[-1] > END - 1e-6 else None

    with sampler.installed():
        run_lockstep(scenario, robot=robot, recorder=recorder, on_progress=follow, ended=ended)
    return sampler.stacks


def measure() -> Section:
    """Table and flame graph."""
    stacks = sample()
    total = sum(stacks.values())
    own, all_of_it = Counter[str](), Counter[str]()
    for stack, count in stacks.items():
        own[stack[-1]] += count
        for name in set(stack):
            all_of_it[name] += count
    table = Table((f"function, {total} samples", "own", "with callees"))
    for name, count in own.most_common(SHOWN):
        row = (f"`{name}`", f"{100.0 * count / total:.1f} %", f"{100.0 * all_of_it[name] / total:.1f} %")
        table.rows.append(row)
    section = Section("profile", "One second of `reach`", [table], [NOTE], document="profile.md")
    section.pictures["profile_reach.svg"] = flame_graph(stacks)
    return section
