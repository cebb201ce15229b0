"""A lean: the CoM's ground projection goes to a target, stays and comes back."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.progress import Progress
from wbmpc.scenario import LeanTask
from wbmpc.signals import Vector


class Lean:
    """One lean task: the CoM's path over its progress, straight from above the feet."""

    def __init__(self, task: LeanTask) -> None:
        self.task = task
        self.target = np.array(task.target)
        self.progress = Progress(task)

    def advance(self, time: float, dt: float, *, gate_open: bool, com: Vector) -> None:
        """One plan later: `com` (3,) is measured [m]; the gate is closed while an expected contact is missing."""
        met = float(np.linalg.norm(com[:2] - self.target)) < self.task.tolerance
        self.progress.advance(time, dt, gate_open=gate_open, met=met)

    def preview(self, sigmas: Vector, *, home: Vector) -> Vector:
        """CoM references (n, 2) [m] at the places `sigmas` (n,) of the way from `home` (2,)."""
        smooth = sigmas**3 * (10.0 - 15.0 * sigmas + 6.0 * sigmas**2)  # starts and ends at rest
        return home + smooth[:, None] * (self.target - home)
