"""Stage 1 in words: its QP as named terms, from what the stage was asked, written a second time."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbmpc.explain.program import Program, term
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import HeightSettings
from wbmpc.signals import Vector


def height_program(
    preview: Preview, settings: HeightSettings, state: Vector, *, wanted: Vector, band: Vector, plane: float
) -> Program:
    """Stage 1 (`ComHeightStage`), arguments as of its `plan`; the variables are the vertical jerks (N,)."""
    n, w = preview.steps, settings
    drift = preview.P_ps @ state
    low, high = band[:, 0], band[:, 1]
    crossed = low > high  # two end-effectors disagree: the compromise between them
    low, high = (np.where(crossed, 0.5 * (band[:, 0] + band[:, 1]), side) for side in (low, high))
    middle = w.middle_share if np.isfinite(band).all() else 0.0
    knots = knot_names(preview)
    terms = [
        term("jerk", np.eye(n), 0.0, weight=w.jerk_cost, unit="m/s³", labels=knots),
        term("velocity", preview.P_vu, -preview.P_vs @ state, weight=w.velocity_cost, unit="m/s", labels=knots),
        term("position", preview.P_pu, wanted - drift, weight=(1 - middle) * w.position_cost, unit="m", labels=knots),
    ]
    if middle:
        target = 0.5 * (band[:, 0] + band[:, 1]) - drift
        terms.append(term("middle", preview.P_pu, target, weight=middle * w.position_cost, unit="m", labels=knots))
    bounds: dict[str, tuple[Any, Any, float]] = {
        "legs' range slack": (plane + w.lowest - drift, plane + w.highest - drift, w.limit_slack_cost),
        "band slack": (low - drift, high - drift, w.band_slack_cost),
    }
    for name, (lower, upper, weight) in bounds.items():
        terms.append(
            term(
                name,
                preview.P_pu,
                lower=lower,
                upper=upper,
                weight=weight,
                unit="m",
                labels=[f"CoM z, {k}" for k in knots],
            )
        )
    return Program(terms, [f"jerk z, {k}" for k in knots], np.full(n, -np.inf), np.full(n, np.inf), np.zeros(n))


def knot_names(preview: Preview) -> list[str]:
    """What the knots of a horizon are called, with their times from the snapshot."""
    return [f"knot {k + 1} (+{t:.1f} s)" for k, t in enumerate(preview.times)]
