"""Made-up traces and footage: a robot that stands still unless a test says otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbmpc.figures.trace import Trace
from wbmpc.footage import Footage

SOLE = np.array([[0.06, 0.035], [-0.06, 0.035], [-0.06, -0.035], [0.06, -0.035]])


def still(samples: int = 101, **changes: Any) -> Trace:
    """One second a hundred samples."""
    soles = np.zeros((samples, 2, 4, 3))
    soles[..., :2] = SOLE + np.array([[0.0, 0.05], [0.0, -0.05]])[None, :, None]
    columns: dict[str, Any] = {
        "time": 0.01 * np.arange(samples),
        "com": np.tile([0.0, 0.0, 0.26], (samples, 1)),
        "com_planned": np.tile([0.0, 0.0, 0.26], (samples, 1)),
        "com_height_band": np.tile([0.16, 0.27], (samples, 1)),
        "zmp": np.zeros((samples, 2)),
        "support": np.tile([[-0.06, 0.06], [-0.085, 0.085]], (samples, 1, 1)),
        "delta_z": np.zeros(samples),
        "hand_force": np.zeros((samples, 2)),
        "hand_force_planned": np.zeros((samples, 2)),
        "push": np.zeros((samples, 3)),
        "palm": np.tile([[0.0, 0.1, 0.2], [0.0, -0.1, 0.2]], (samples, 1, 1)),
        "sole": soles,
        "sole_force": np.full((samples, 2), 17.0),
        "torque_share": np.full((samples, 2), 0.2),
        "joint_names": ("left_knee", "right_knee"),
        "hand_contacts": (),
    }
    return Trace(**{**columns, **changes})


def footage_of(trace: Trace, joints: np.ndarray) -> Footage:
    """Footage at the trace's samples with the joint angles (n, k) [rad], the base at rest."""
    n = len(trace.time)
    base = np.tile([0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0], (n, 1))
    nothing = [np.zeros((0, 3))] * n
    return Footage(None, trace.time, np.hstack([base, joints]), trace.com, nothing, nothing, nothing)
