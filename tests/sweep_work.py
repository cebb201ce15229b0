"""What stands for a run in the tests of sweeps: importable by name and light, since processes are spawned."""

from __future__ import annotations

import hashlib
import json
from typing import Any


def fake_row(draw: Any) -> dict[str, Any]:
    """Passes for heavy robots."""
    mass = float(draw.values["plant.mass_scale"])
    check = {"name": "torque_peak", "passed": mass > 0.95, "value": mass, "threshold": 0.95, "unit": "1"}
    digest = hashlib.sha256(json.dumps([draw.seed, dict(draw.values)]).encode()).hexdigest()
    return {
        "draw": draw.index,
        "seed": draw.seed,
        "set": dict(draw.values),
        "passed": check["passed"],
        "error": None,
        "checks": [check],
        "metrics": {},
        "state_sha256": digest,
    }


def breaking_row(draw: Any) -> dict[str, Any]:
    """A draw that broke the program."""
    return {**fake_row(draw), "passed": False, "error": "IndexError: off by one", "checks": []}


def forbidden(draw: Any) -> dict[str, Any]:
    """A draw that must not be run."""
    raise AssertionError("this draw was done already")
