"""Stage 3 by enumeration against Gurobi, SCIP, HiGHS and daqp: same optimum first, then times, all in one run.

    .venv-peers-stage3/bin/python -m benchmarks.stage3_peers [--questions 20] [--candidates 2,4] [--knots 1,2]

Makes the table in docs/benchmarks_stage3.md and docs/pictures/stage3_peers.svg anew (with --dry only prints). Every
question goes to the enumeration and to one peer after the other, so that a noisy machine disturbs all alike.
Counted: for the enumeration everything from `Need` and `Option` objects to forces; for a peer everything from the
filled arrays of the MIQP to its answer, the hand-over to its interface included. Ratios are of CPU time, which does not
count what others do on a shared machine, and count of a peer only what its own `optimize` took.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from benchmarks.stage3_instances import LEFTWARDS, MASS, SETTINGS, Question, ScaledProblem, ask, lean
from benchmarks.stage3_report import draw, forces_table, table, write
from benchmarks.stage3_solvers import SOLVERS, Refused, Solver
from wbmpc.planner.contact_choice import ContactChoice
from wbmpc.planner.contact_force import ContactForce
from wbmpc.planner.contact_sets import ContactSets
from wbmpc.planner.knot_forces import KnotForces
from wbmpc.qp import QuadraticProgram
from wbmpc.scenario import PatchPose
from wbmpc.signals import SIDES

DOCS = Path(__file__).parents[1] / "docs"
CANDIDATES, KNOTS = (2, 4, 8, 16, 32, 64), (1, 2, 4, 8, 16)
RELATIVE, ABSOLUTE = 1e-4, 2e-5  # within which two optima are the same
BUDGET = 5.0  # [s] after which a peer is asked no more questions of one size
HOPELESS = 2.0  # [s] median from which a peer is asked a single question of any larger size, in a process of its own
PATIENCE = 10.0  # [s] of CPU that it gets for it, beside HAND_OVER to take the question in
HAND_OVER = 5
REPEATS = 3  # answers of the enumeration to each question, beside each peer's


@dataclass
class Times:
    """What one solver did on one size."""

    total: list[float] = field(default_factory=list)  # [s] hand-over included
    inside: list[float] = field(
        default_factory=list
    )  # [s] of CPU: of a peer's own `optimize`, of all that the enumeration does
    wrong: int = 0  # another optimum, or another opinion on whether there is one
    gave_up: int = 0  # out of time, or failed
    refused: str = ""  # why it was not asked
    beyond: float = 0.0  # [s] of CPU in which a single question was not answered


Size = tuple[int, int]  # candidates, knots


class Meeting:
    """All solvers on all sizes."""

    def __init__(self) -> None:
        self.own: dict[Size, Times] = {}
        self.peers: dict[str, dict[Size, Times]] = {name: {} for name in SOLVERS}
        self.impossible: dict[Size, int] = {}  # questions that no contact answers

    def run(self, size: Size, questions: int) -> None:
        """Ask `questions` questions of one size."""
        candidates, knots = size
        own = ContactSets(candidates, SETTINGS, mass=MASS, knots=knots)
        self.own[size], self.impossible[size] = Times(), 0
        for name in SOLVERS:
            self.peers[name][size] = Times()
        asked = [ask(seed, options=candidates, knots=knots) for seed in range(questions)]
        for question in asked:
            own.solve(question.need, question.options, left=LEFTWARDS)
        choice = ContactChoice(candidates, SETTINGS, mass=MASS, backend="daqp", knots=knots)
        scaled = ScaledProblem(choice)
        hopeless = [name for name in SOLVERS if self._hopeless(name, size)]
        solvers = {name: make(scaled.problem) for name, make in SOLVERS.items() if name not in hopeless}
        for question in asked:
            choice.pose(question.need, question.options, left=LEFTWARDS)
            scaled.refresh()
            optimum = self._ask_own(own, question, size)
            self.impossible[size] += not np.isfinite(optimum)
            for name, solver in solvers.items():
                self._ask_peer(solver, self.peers[name][size], optimum)
                self._ask_own(own, question, size)
        for name in hopeless:  # the last question is still in the arrays
            self._ask_once(name, scaled.problem, self.peers[name][size], optimum)

    def _hopeless(self, name: str, size: Size) -> bool:
        """Whether the peer was too slow at a smaller size."""
        smaller = [(size[0] // 2, size[1]), (size[0], size[1] // 2)]
        known = [self.peers[name][other] for other in smaller if other in self.peers[name]]
        return any(times.beyond or (times.total and np.median(times.total) > HOPELESS) for times in known)

    def _ask_once(self, name: str, problem: QuadraticProgram, times: Times, optimum: float) -> None:
        """One question to a peer that may take for ever: in a child that the system ends with its CPU time."""

        def answer(pipe: Any) -> None:
            limit = int(PATIENCE) + HAND_OVER
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            found = Times()
            self._ask_peer(SOLVERS[name](problem), found, optimum)
            pipe.send(found)

        context = multiprocessing.get_context("fork")
        here, there = context.Pipe(duplex=False)
        child = context.Process(target=answer, args=(there,))
        child.start()
        there.close()
        try:
            found: Times = here.recv()
        except EOFError:  # its time was up
            found = Times(gave_up=1)
        child.join()
        found.beyond = PATIENCE if found.gave_up else 0.0
        vars(times).update(vars(found))

    def _ask_own(self, own: ContactSets, question: Question, size: Size) -> float:
        for _ in range(REPEATS):
            begin, cpu = perf_counter(), thread_time()
            answer = own.solve(question.need, question.options, left=LEFTWARDS)
            self.own[size].inside.append(thread_time() - cpu)
            self.own[size].total.append(perf_counter() - begin)
        return answer.objective

    def _ask_peer(self, solver: Solver, times: Times, optimum: float) -> None:
        if times.refused or sum(times.total) > BUDGET:
            return
        begin = perf_counter()
        try:
            value, inside = solver.solve()
        except Refused as reason:
            times.refused = str(reason)
            return
        times.total.append(perf_counter() - begin)
        times.inside.append(inside)
        if np.isnan(value):
            times.gave_up += 1
        elif not (value == optimum or abs(value - optimum) <= RELATIVE * abs(optimum) + ABSOLUTE):
            times.wrong += 1
            print(f"another optimum: {value:.9g}, the enumeration has {optimum:.9g}")


def measure_forces(questions: int = 300) -> dict[int, tuple[list[float], list[float]]]:
    """Stage 3 with H given, 16 knots: seconds of the one QP on daqp and knot by knot, by number of contacts.

    Both workspaces see a sequence of needs that change slowly, as plan after plan does.
    """
    seconds: dict[int, tuple[list[float], list[float]]] = {}
    for contacts in (1, 2):
        plain = ContactForce(16, SETTINGS, mass=MASS, contacts=len(SIDES), backend="daqp")
        knots = KnotForces(16, SETTINGS, mass=MASS, contacts=len(SIDES))
        patches = [
            PatchPose("patch", "object", np.array([0.27, y, 0.2]), np.array([0.0, 0.0, 1.0]), 0.5, 20.0)
            for y in (0.11, -0.11)
        ]
        caps = np.full((2, 16), 20.0) * (np.arange(2) < contacts)[:, None]
        times: tuple[list[float], list[float]] = ([], [])
        for step in range(questions):
            need = lean(0.01 + 0.005 * np.sin(0.05 * step), drift=0.01, sideways=0.01, knots=16)
            answers: list[Any] = []
            for stage, spent in zip((plain, knots), times, strict=True):
                begin = perf_counter()
                answers.append(stage.solve(need, patches, caps)[0])
                spent.append(perf_counter() - begin)
            assert np.allclose(*answers, atol=1e-4), "forces differ"
        seconds[contacts] = times
    return seconds


def main() -> None:
    """Run, print, and write the page's table and picture."""
    parser = argparse.ArgumentParser(description="Stage 3 against its peers.")
    parser.add_argument("--questions", type=int, default=20)
    parser.add_argument("--candidates", default=",".join(map(str, CANDIDATES)))
    parser.add_argument("--knots", default=",".join(map(str, KNOTS)))
    parser.add_argument("--dry", action="store_true", help="print only")
    arguments = parser.parse_args()
    meeting = Meeting()
    sizes = list(product(map(int, arguments.candidates.split(",")), map(int, arguments.knots.split(","))))
    for candidates, knots in sizes:
        meeting.run((candidates, knots), arguments.questions)
        print("\n".join(table(meeting, [(candidates, knots)])[2:]), flush=True)
    if not arguments.dry:
        write(DOCS / "benchmarks_stage3.md", [*table(meeting, sizes), "", *forces_table(measure_forces())])
        draw(DOCS / "pictures" / "stage3_peers.svg", meeting, sizes)


if __name__ == "__main__":
    main()
