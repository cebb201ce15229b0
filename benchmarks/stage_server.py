"""Every QP solver on recorded instances of stages 1 and 2, in the peers' environment.

    .venv-peers/bin/python -m benchmarks.stage_server BLOCKS STEPS INSTANCE.npz ...

Started by benchmarks/stage_peers.py; answers with one line of JSON: instance -> sizes, and solver -> blocks of seconds,
unsolved steps, largest error of the cost and of x, and violation of the hard rows.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.direct_solvers import SOLVERS
from benchmarks.qp_families import Family, recorded, silent
from wbmpc.qp import QuadraticProgram

BUDGET = 2.0  # [s] a solver that has used more on one instance is not asked again


def cost(problem: QuadraticProgram, x: np.ndarray) -> float:
    """The objective at x, soft rows included."""
    value = 0.5 * x @ problem.hessian @ x + problem.gradient @ x
    return float(value + 0.5 * problem.soft_weight @ violation(problem, x) ** 2)


def violation(problem: QuadraticProgram, x: np.ndarray) -> np.ndarray:
    """By how much every row is missed."""
    rows = problem.matrix @ x
    return np.maximum(np.maximum(problem.lower - rows, rows - problem.upper), 0.0)


def measure(family: Family, blocks: int, steps: int) -> dict[str, Any]:
    """All solvers on the same sequence, in blocks of `steps`; daqp's answer is the reference of a step."""
    problem = family.problem
    family.fill(problem, 0)
    solvers = {name: make(problem) for name, make in SOLVERS.items()}
    answers: dict[str, dict[str, Any]] = {
        name: {"blocks": [], "unsolved": 0, "cost_error": 0.0, "x_error": 0.0, "violation": 0.0} for name in solvers
    }
    changing = not family.name.startswith("stage1")  # stage 1's matrices are made once
    reference: dict[int, np.ndarray] = {}
    for block in range(blocks + 1):  # the first one warms up
        for name, solver in solvers.items():
            answer = answers[name]
            if sum(map(sum, answer["blocks"])) > BUDGET:
                continue
            seconds = []
            for step in range(block * steps, (block + 1) * steps):
                family.fill(problem, step)
                solver.prepare()
                start = perf_counter()
                x = solver.solve(changing)
                seconds.append(perf_counter() - start)
                if x is None:
                    answer["unsolved"] += 1
                    continue
                best = reference.setdefault(step, x)
                optimum = cost(problem, best)
                errors = {
                    "cost_error": abs(cost(problem, x) - optimum) / (1.0 + abs(optimum)),
                    "x_error": float(np.abs(x - best).max() / (1.0 + np.abs(best).max())),
                    "violation": float(violation(problem, x)[problem.soft_weight == 0.0].max(initial=0.0)),
                }
                for kind, error in errors.items():
                    answer[kind] = max(answer[kind], error)
            if block:
                answer["blocks"].append(seconds)
    return {"variables": problem.variables, "rows": problem.rows, "solvers": answers}


def main() -> None:
    """Measure what the command line names."""
    blocks, steps, paths = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
    with silent():
        answer = {Path(path).stem: measure(recorded(Path(path)), blocks, steps) for path in paths}
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
