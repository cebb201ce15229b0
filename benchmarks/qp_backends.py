"""Solve times of the QP backends, interleaved in one run so that a noisy machine disturbs all alike.

    python -m benchmarks.qp_backends [--steps 200] [--backends daqp,osqp] [--instances DIR]

Each family is a slowly changing sequence, as a control loop sees it: every matrix changes at every step, and each
workspace warm-starts from its own last solve. Trust the ratios to daqp: the others evict its caches, so that alone it
is up to twice as fast as shown.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import daqp
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.qp_families import Family, choice, drifting, recorded, silent
from wbmpc.qp import MIQP_BACKENDS, QuadraticProgram, make_mip_workspace, make_workspace
from wbmpc.qp.daqp_workspace import soft_sense
from wbmpc.qp.workspace import qp_backend_names
from wbmpc.signals import SolveStatus

BUDGET = 2.0  # [s] a backend that has used more on one family is not asked again
ONE_SHOT = "daqp, one-shot"
VECTORS = "daqp, same matrices"


@dataclass
class Samples:
    """What one backend did on one family."""

    seconds: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    failures: int = 0


def measure(family: Family, backends: list[str], steps: int) -> dict[str, Samples]:
    """Every backend on every step, the order rotating."""
    mixed = bool(family.problem.binary.size)
    make = make_mip_workspace if mixed else make_workspace
    family.fill(family.problem, 0)
    workspaces = {name: make(name, family.problem) for name in backends}
    with silent():
        for workspace in workspaces.values():
            workspace.solve()
    results = {name: Samples() for name in [*backends, *([] if mixed else [VECTORS, ONE_SHOT])]}
    with silent():
        for step in range(1, steps + 1):
            family.fill(family.problem, step)
            turn = step % len(backends)
            for name in backends[turn:] + backends[:turn]:
                if sum(results[name].seconds) < BUDGET:
                    _record(results[name], workspaces[name].solve)
            if not mixed:
                family.problem.gradient *= 1.001
                _record(results[VECTORS], lambda: workspaces["daqp"].solve(matrices_changed=False))
                _one_shot(results[ONE_SHOT], family.problem)
    return results


def _record(samples: Samples, solve: Callable) -> None:
    start = perf_counter()
    solution = solve()
    samples.seconds.append(perf_counter() - start)
    samples.iterations.append(solution.iterations)
    samples.failures += solution.status is not SolveStatus.SOLVED


def _one_shot(samples: Samples, problem: QuadraticProgram) -> None:
    """What a caller without a workspace pays; its soft rows share daqp's default weight."""
    p = problem
    start = perf_counter()
    _, _, flag, info = daqp.solve(p.hessian, p.gradient, p.matrix, p.all_upper, p.all_lower, soft_sense(p))
    samples.seconds.append(perf_counter() - start)
    samples.iterations.append(info["iterations"])
    samples.failures += flag not in (1, 2)


def report(console: Console, family: Family, results: dict[str, Samples]) -> None:
    """One table: microseconds, ratio to daqp, iterations, failures."""
    p = family.problem
    title = f"{family.name}: {p.variables} variables, {p.rows} rows ({p.soft_rows.size} soft)"
    table = Table(title=title, title_justify="left")
    for header in ("backend", "p50 [µs]", "p99 [µs]", "× daqp", "iters", "failed"):
        table.add_column(header, justify="left" if header == "backend" else "right", no_wrap=True)
    reference = np.median(results["daqp"].seconds)
    for name, samples in sorted(results.items(), key=lambda item: float(np.median(item[1].seconds))):
        p50, p99 = np.percentile(samples.seconds, [50, 99])
        table.add_row(
            name,
            f"{1e6 * p50:.0f}",
            f"{1e6 * p99:.0f}",
            f"{p50 / reference:.2f}",
            f"{np.mean(samples.iterations):.1f}",
            str(samples.failures),
        )
    console.print(table)


def main() -> None:
    """Measure the families that the arguments ask for."""
    parser = argparse.ArgumentParser(description="Solve times of the QP backends.")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--backends", default=",".join(qp_backend_names()), help="comma-separated; daqp is always in")
    default_instances = Path(__file__).parents[1] / "tests" / "qp" / "instances"
    parser.add_argument("--instances", type=Path, default=default_instances, help="folder of recorded .npz problems")
    arguments = parser.parse_args()
    backends = ["daqp", *(name for name in arguments.backends.split(",") if name != "daqp")]
    console = Console()
    families = [
        drifting("stage 1", 16, 48, equalities=0, soft=16),
        drifting("stage 2", 55, 120, equalities=12, soft=64),
        drifting("tracker", 41, 62, equalities=6, soft=0),
        choice(4),
        choice(8),
        *(recorded(path) for path in sorted(arguments.instances.glob("*.npz"))),
    ]
    for family in families:
        mixed = bool(family.problem.binary.size)
        steps = min(arguments.steps, 20) if mixed else arguments.steps
        report(console, family, measure(family, list(MIQP_BACKENDS) if mixed else backends, steps))


if __name__ == "__main__":
    main()
