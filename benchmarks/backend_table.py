"""The QP backends of this project on all recorded QPs: why daqp is the default."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.qp_backends import measure as measure_family
from benchmarks.qp_families import recorded
from benchmarks.report import Section, Table
from wbmpc.qp import MIQP_BACKENDS
from wbmpc.qp.workspace import qp_backend_names

INSTANCES = Path(__file__).parents[1] / "tests" / "qp" / "instances"
STEPS = 60  # solves of each backend on each recorded QP
NOTE = """Warm-started, all backends on the same sequence: p50 of daqp, the others as multiples of it. *refused*: an
error or an iteration limit on part of the sequence."""


def measure() -> Section:
    """One row for each instance."""
    others = [name for name in qp_backend_names() if name != "daqp"]
    table = Table(("problem", "variables × rows", "daqp, ms", *others, "highs (MIQP)"))
    for path in sorted(INSTANCES.glob("*.npz")):
        family = recorded(path)
        mixed = bool(family.problem.binary.size)
        results = measure_family(family, list(MIQP_BACKENDS) if mixed else ["daqp", *others], STEPS)
        reference = float(np.median(results["daqp"].seconds))
        cells = []
        for name in (*others, "highs"):
            if name not in results:
                cells.append("")
            elif results[name].failures and not results["daqp"].failures:
                cells.append("refused")
            else:
                cells.append(f"{float(np.median(results[name].seconds)) / reference:.1f}")
        size = f"{family.problem.variables} × {family.problem.rows}"
        table.rows.append((path.stem, size, f"{1e3 * reference:.3f}", *cells))
    return Section("backends", "The QP backends on recorded QPs", [table], [NOTE])
