"""A reach: a palm goes to a target, stays and comes back."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.hand_path import HandPath
from wbmpc.planner.progress import Progress
from wbmpc.scenario import ReachTask
from wbmpc.signals import Vector


class Reach:
    """One reach task of one hand: its palm's path over its progress."""

    def __init__(self, task: ReachTask, *, side: int, palm: Vector) -> None:
        """`palm` (3,) is where the hand starts [m]."""
        self.task, self.side = task, side
        self.target = np.array(task.target)
        self.progress = Progress(task)
        self._path = HandPath(start=palm.copy(), end=self.target, away=np.array([0.0, 0.0, 1.0]))

    def advance(self, time: float, dt: float, *, gate_open: bool, palm: Vector) -> None:
        """One plan later: `palm` (3,) is measured [m]; the gate is closed while an expected contact is missing."""
        met = float(np.linalg.norm(palm - self.target)) < self.task.tolerance
        self.progress.advance(time, dt, gate_open=gate_open, met=met)

    def reference(self) -> tuple[Vector, Vector, Vector]:
        """Palm position, velocity and acceleration (3,) to follow now."""
        progress = self.progress
        p, dp, ddp = self._path.at(progress.sigma)
        return p, dp * progress.sigma_rate, ddp * progress.sigma_rate**2 + dp * progress.sigma_acceleration

    def preview(self, sigmas: Vector) -> Vector:
        """Palm references (n, 3) [m] at the places `sigmas` (n,) of the way."""
        return self._path.positions(sigmas)
