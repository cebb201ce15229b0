"""A reach: a palm goes to a target, which may be moved meanwhile, stays and comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbmpc.planner.hand_path import HandPath
from wbmpc.planner.moving_target import MovingTarget
from wbmpc.planner.progress import Progress, TaskPhase
from wbmpc.rotations import length
from wbmpc.scenario import ReachTask
from wbmpc.signals import Vector


class Reach:
    """One reach task of one hand: its palm's path over its progress."""

    def __init__(self, task: ReachTask, *, side: int, palm: Vector) -> None:
        """`palm` (3,) is where the hand starts [m]."""
        self.task, self.side = task, side
        self._place = MovingTarget(np.array(task.target))
        self.progress = Progress(task)
        self._path = HandPath(start=palm.copy(), end=self.target, away=np.array([0.0, 0.0, 1.0]))

    @property
    def target(self) -> Vector:
        """Where the palm shall be (3,) [m]: the task's target, or on the way to where that was moved."""
        return self._place.position

    def move(self, target: Vector, *, palm: Vector) -> None:
        """The target is at `target` (3,) [m] from now on, the palm now at `palm` (3,).

        A reach that waits simply has another target. One on its way, or at its target, goes on to the new place, its
        hold begins anew; one that comes back, or is done, sets out again.
        """
        if self.progress.phase == TaskPhase.DONE:
            self._path = replace(self._path, start=palm.copy())
        if self.progress.sigma <= 0.0:
            self._place = MovingTarget(target.copy())
            self._path = replace(self._path, end=self.target)
        else:
            self._place.goal = target.copy()
        self.progress.again()

    def advance(self, time: float, dt: float, *, gate_open: bool, palm: Vector) -> None:
        """One plan later: `palm` (3,) is measured [m]; the gate is closed while an expected contact is missing."""
        met = length(palm - self._place.goal) < self.task.tolerance
        self.progress.advance(time, dt, gate_open=gate_open, met=met)
        if self._place.moving:
            self._place.advance(dt * max(self.progress.rate, 0.0))
            self._path = replace(self._path, end=self.target)

    def reference(self) -> tuple[Vector, Vector]:
        """Palm position and velocity (3,) to follow now."""
        progress, place = self.progress, self._place
        p, dp, _ = self._path.at(progress.sigma)
        v = dp * progress.sigma_rate
        if place.moving:  # of this reach's clock, which the target's way waits for
            v = v + self._path.shared(progress.sigma, place.velocity * max(progress.rate, 0.0))
        return p, v

    def preview(self, sigmas: Vector, times: Vector) -> Vector:
        """Palm references (n, 3) [m] at the places `sigmas` (n,) of the way, `times` (n,) seconds from now."""
        if not self._place.moving:
            return self._path.positions(sigmas)
        ends = self._place.preview(times)
        paths = [replace(self._path, end=end).positions(sigmas[k : k + 1]) for k, end in enumerate(ends)]
        return np.concatenate(paths)
