"""Progress of a reach: there, hold, back; its clock is scaled while an expected contact is not there yet."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from wbmpc.planner.hand_path import HandPath
from wbmpc.scenario import ReachTask
from wbmpc.signals import Vector

GATE_TIME = 0.4  # [s] in which the progress rate goes between 0 and 1


class ReachPhase(IntEnum):
    """Where a reach stands."""

    WAIT = 0
    GO = 1
    HOLD = 2
    BACK = 3
    DONE = 4


class Reach:
    """One reach task of one hand.

    The palm's place on its path is σ. `rate` (0 … 1) scales the clock of the way out, smoothly, so that velocity and
    acceleration scale with it ("gated"). The hold counts the time that the palm has been within tolerance, without a
    break; it gives up after `patience`.
    """

    def __init__(self, task: ReachTask, *, side: int, palm: Vector) -> None:
        """`palm` (3,) is where the hand starts [m]."""
        self.task, self.side = task, side
        self.target = np.array(task.target)
        self.phase = ReachPhase.WAIT
        self.rate = 1.0
        self._path = HandPath(start=palm.copy(), end=self.target, away=np.array([0.0, 0.0, 1.0]))
        self._sigma, self._sigma_rate, self._sigma_acceleration = 0.0, 0.0, 0.0
        self._held, self._waited = 0.0, 0.0
        self._go_time = task.arrive_by - task.start

    @property
    def active(self) -> bool:
        """Whether the hand belongs to this task now."""
        return self.phase not in (ReachPhase.WAIT, ReachPhase.DONE)

    @property
    def sigma(self) -> float:
        """Place on the path, 0 … 1."""
        return self._sigma

    def advance(self, time: float, dt: float, *, gate_open: bool, palm: Vector) -> None:
        """One plan later: `palm` (3,) is measured [m]; the gate is closed while an expected contact is missing."""
        before = self.rate
        self.rate = float(np.clip(self.rate + (dt if gate_open else -dt) / GATE_TIME, 0.0, 1.0))
        if self.phase == ReachPhase.WAIT and time >= self.task.start - 1e-9:
            self.phase = ReachPhase.GO
        if self.phase == ReachPhase.GO:
            self._move(self.rate / self._go_time, (self.rate - before) / dt / self._go_time, dt)
            if self._sigma >= 1.0:
                self.phase = ReachPhase.HOLD
        elif self.phase == ReachPhase.HOLD:
            self._move(0.0, 0.0, dt)
            self._waited += dt
            near = float(np.linalg.norm(palm - self.target)) < self.task.tolerance
            self._held = self._held + dt if near else 0.0
            if self._held >= self.task.hold or self._waited >= self.task.hold + self.task.patience:
                self.phase = ReachPhase.BACK
        elif self.phase == ReachPhase.BACK:
            self._move(-1.0 / self.task.withdraw, 0.0, dt)
            if self._sigma <= 0.0:
                self.phase = ReachPhase.DONE

    def reference(self) -> tuple[Vector, Vector, Vector]:
        """Palm position, velocity and acceleration (3,) to follow now."""
        p, dp, ddp = self._path.at(self._sigma)
        return p, dp * self._sigma_rate, ddp * self._sigma_rate**2 + dp * self._sigma_acceleration

    def preview(self, time: float, times: Vector, *, rate: float) -> Vector:
        """Palm references (n, 3) at `times` (n,) seconds from now, the way out at `rate`; nan rows before the start."""
        return self._path.positions(self.sigmas(time, times, rate=rate))

    def sigmas(self, time: float, times: Vector, *, rate: float) -> Vector:
        """σ (n,) at `times` (n,) seconds from now, the way out going on at `rate`."""
        if self.phase == ReachPhase.BACK:
            return np.clip(self._sigma - times / self.task.withdraw, 0.0, 1.0)
        if self.phase == ReachPhase.DONE:
            return np.zeros(len(times))
        moving = times if self.phase != ReachPhase.WAIT else np.maximum(times - (self.task.start - time), 0.0)
        return np.clip(self._sigma + rate * moving / self._go_time, 0.0, 1.0)

    def _move(self, rate: float, acceleration: float, dt: float) -> None:
        self._sigma = float(np.clip(self._sigma + rate * dt, 0.0, 1.0))
        self._sigma_rate, self._sigma_acceleration = rate, acceleration
