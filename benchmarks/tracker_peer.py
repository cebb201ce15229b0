"""The tracker against TSID, C++ task-space inverse dynamics, on the same robot, states, tasks, weights and limits.

Three times one QP a tick: the tracker as shipped, the tracker on TSID's tasks, and TSID, which runs in an interpreter
of its own (benchmarks/tsid_server.py). Blocks of consecutive ticks alternate, so that all see the same machine.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.braced_states import Ticks, plain, record
from benchmarks.report import Section, Table, micro, ratio
from benchmarks.tsid_client import MATCHED, Server
from wbmpc.loop import no_garbage_collection
from wbmpc.signals import TorqueCommand
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tracker import Tracker

BLOCK = 50  # ticks
ROUNDS = 3  # over all ticks
TOLERANCE = 5e-3  # of the accelerations' norm
PRESSED = 1e-3  # [N] on every corner of both soles
SHIPPED, MATCHING = "tracker, as shipped", "tracker, TSID's tasks"
FORMULATIONS = {"TSID, contacts as costs": "costs", "TSID, contacts as equations": "equations"}
NOTE = """{ticks} consecutive ticks of `reach` with both feet and a braced palm in contact. TSID 1.7.1 with Pinocchio
3.4 and eiquadprog-fast, {sizes}; its times are taken inside of its own interpreter: references set from Python,
problem data computed, solved. Ours are those of `Tracker.solve`, everything from the state to the torques. On TSID's
tasks the tracker's rows of comfort, clearance and keep-out are still there and do not bind; integrals, clips and
filters are off. Tolerance: {tolerance:g} of the accelerations' norm. With contacts as costs both solve the same QP but
for the soles' yaw moment: corner forces bound it by where the pressure is, wrench rows by a radius. It shows where the
pressure is at an edge; where all corners press, the answers are equal. Contacts as equations, the way of TSID's
examples, have no compliance and so another optimum."""


Blocks = dict[str, list[list[float]]]  # seconds of each tick, in blocks


def alternate(ticks: Ticks, server: Server) -> tuple[Blocks, dict[str, list[TorqueCommand]]]:
    """Solve block by block, everyone in turn; a first round warms up and gives the tracker's answers."""
    plain_ticks = plain(ticks)
    trackers = {
        SHIPPED: (Tracker(ticks.robot, TrackerSettings(), step=ticks.step), ticks),
        MATCHING: (Tracker(ticks.robot, MATCHED, step=ticks.step), plain_ticks),
    }
    blocks: Blocks = {}
    commands: dict[str, list[TorqueCommand]] = {name: [] for name in trackers}
    for turn in range(1 + ROUNDS):
        for first in range(0, len(ticks.states), BLOCK):
            seconds = {}
            last = first + BLOCK
            for name, (tracker, asked) in trackers.items():
                pairs = zip(asked.states[first:last], asked.setpoints[first:last], strict=True)
                solved = [tracker.solve(state, setpoint) for state, setpoint in pairs]
                seconds[name] = [command.solve_time for command in solved]
                commands[name] += solved if turn == 0 else []
            for name, formulation in FORMULATIONS.items():
                parts = server.solve(formulation, first, min(last, len(ticks.states)))
                seconds[name] = parts.sum(axis=1).tolist()
                seconds[f"{name}: data and solver"] = parts[:, 1:].sum(axis=1).tolist()
                seconds[f"{name}: solver"] = parts[:, 2].tolist()
            for name, block in seconds.items():
                if turn > 0:
                    blocks.setdefault(name, []).append(block)
    return blocks, commands


def measure() -> Section:
    """Record, alternate, compare."""
    ticks = record()
    with TemporaryDirectory() as folder, Server(plain(ticks), Path(folder)) as server:
        with no_garbage_collection():
            blocks, commands = alternate(ticks, server)
        theirs = server.answers()
    times = Table(("one tick, µs", "p50", "p99", "× the tracker as shipped", "× the tracker on TSID's tasks"))
    for name, kept in blocks.items():
        every = np.concatenate(kept)
        times.rows.append(
            (name, micro(every, 50), micro(every, 99), *(ratio(kept, blocks[ours]) for ours in (SHIPPED, MATCHING)))
        )
    ours = np.array([command.acceleration for command in commands[MATCHING]])
    flat = theirs["least_corner"] > PRESSED
    answers = Table(
        ("accelerations against the tracker on TSID's tasks", "ticks", "p50", "largest", "within tolerance")
    )
    for name, formulation in FORMULATIONS.items():
        error = np.linalg.norm(theirs[formulation] - ours, axis=1) / np.linalg.norm(ours, axis=1)
        for which, those in ((name, error), (f"{name}, all corners pressing", error[flat])):
            if len(those):
                share = f"{100.0 * np.mean(those < TOLERANCE):.0f} %"
                row = (which, str(len(those)), f"{np.median(those):.0e}", f"{those.max():.0e}", share)
                answers.rows.append(row)
    sizes = "{variables} variables, {equalities} equations, {rows} inequalities".format(**server.sizes)
    return Section(
        "tracker",
        "The tracker against TSID",
        [times, answers],
        [NOTE.format(sizes=sizes, ticks=len(ticks.states), tolerance=TOLERANCE)],
    )
