"""Stages 1 and 2 on every QP solver: recorded instances, direct APIs and through qpsolvers."""

from __future__ import annotations

import json
import subprocess
from itertools import chain
from typing import Any

import numpy as np

from benchmarks.report import Section, Table, micro, ratio
from benchmarks.tsid_client import ROOT, peers_python

BLOCKS, STEPS = 6, 15
COST_TOLERANCE = 1e-6  # of 1 + |optimum|
STATE_TOLERANCE = 1e-3  # of 1 + the largest |x|
ROW_TOLERANCE = 1e-5  # by which a hard row may be missed
NOTE = f"""Each instance is a sequence: its gradient trembles by 0.1 % from step to step, and every solver starts from
its own last answer as far as it can. Matrices are handed over at every step, but for stage 1, whose matrices never
change. Solvers run in turns of {STEPS} steps in one interpreter. The optimum is daqp's; the check is the cost of x
with its soft rows within {COST_TOLERANCE:g} of it, x within {STATE_TOLERANCE:g} and hard rows within
{ROW_TOLERANCE:g}. *missed*: an answer beyond one of these, *unsolved*: none in part of the steps. `qpsolvers: …` is
what a first version would do: the same solver behind the wrapper, set up anew at every solve, with a slack variable
for every soft row. The direct APIs get no rows without bounds."""


def verdict(answer: dict[str, Any]) -> str:
    """What the check says of a solver's answers."""
    if answer["unsolved"]:
        return "unsolved"
    same = (
        answer["cost_error"] < COST_TOLERANCE
        and answer["x_error"] < STATE_TOLERANCE
        and answer["violation"] < ROW_TOLERANCE
    )
    return "same" if same else "missed"


def measure() -> Section:
    """Ask the peers' environment, make the tables."""
    instances = sorted((ROOT / "tests" / "qp" / "instances").glob("stage[12]_*.npz"))
    command = [peers_python(), "-m", "benchmarks.stage_server", str(BLOCKS), str(STEPS), *map(str, instances)]
    # PIQP warns of every row without bounds, on the standard error
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if run.returncode:
        raise RuntimeError(f"the peers' environment failed: {run.stderr[-2000:]}")
    tables = []
    for name, family in json.loads(run.stdout).items():
        title = f"{name}: {family['variables']} variables, {family['rows']} rows"
        table = Table(("solver", "p50, µs", "p99, µs", "× daqp", "optimum", "error of x"), title=title)
        solvers = family["solvers"]
        for solver, answer in sorted(solvers.items(), key=lambda item: _median(item[1])):
            seconds = list(chain(*answer["blocks"]))
            table.rows.append(
                (
                    solver,
                    *((micro(seconds, 50), micro(seconds, 99)) if seconds else ("–", "–")),
                    ratio(answer["blocks"], solvers["daqp"]["blocks"]),
                    verdict(answer),
                    f"{answer['x_error']:.0e}",
                )
            )
        tables.append(table)
    return Section("stages", "Stages 1 and 2 on other QP solvers", tables, [NOTE])


def _median(answer: dict[str, Any]) -> float:
    seconds = list(chain(*answer["blocks"]))
    return float(np.median(seconds)) if seconds else np.inf
