"""Progress of a task that goes somewhere, stays and comes back; its clock waits for contacts that are expected."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from wbmpc.jit import kernel
from wbmpc.scenario import ExcursionTask
from wbmpc.signals import Vector

GATE_TIME = 0.4  # [s] in which the progress rate goes between 0 and 1


class TaskPhase(IntEnum):
    """Where a task stands."""

    WAIT = 0
    GO = 1
    HOLD = 2
    BACK = 3
    DONE = 4


class Progress:
    """σ, the place on the way of an excursion: 0 at home, 1 at the target.

    `rate` (0 … 1) scales the clock of the way out, smoothly, so that velocity and acceleration scale with it ("gated").
    The hold counts the time that the target has been met, without a break; it gives up after `patience`.
    """

    def __init__(self, task: ExcursionTask) -> None:
        self._task = task
        self._go_time = task.arrive_by - task.start  # [s]
        self.phase = TaskPhase.WAIT
        self.rate = 1.0
        self.sigma = 0.0
        self.sigma_rate = 0.0  # [1/s]
        self._held, self._waited = 0.0, 0.0

    @property
    def active(self) -> bool:
        """Whether the task moves the robot now."""
        return self.phase not in (TaskPhase.WAIT, TaskPhase.DONE)

    @property
    def ahead(self) -> bool:
        """Whether the target is still to be reached or held."""
        return self.phase in (TaskPhase.WAIT, TaskPhase.GO, TaskPhase.HOLD)

    def advance(self, time: float, dt: float, *, gate_open: bool, met: bool) -> None:
        """One plan later; the gate is closed while an expected contact is missing; `met`: the target is met now."""
        task = self._task
        lowest = min(self.rate, 0.0)  # below 0 only on a way back that was called off
        self.rate = min(max(self.rate + (dt if gate_open or lowest else -dt) / GATE_TIME, lowest), 1.0)
        if self.phase == TaskPhase.WAIT and time >= task.start - 1e-9:
            self.phase = TaskPhase.GO
        if self.phase == TaskPhase.GO:
            self._move(self.rate / self._go_time, dt)
            if self.sigma >= 1.0:
                self.phase = TaskPhase.HOLD
        elif self.phase == TaskPhase.HOLD:
            self._move(0.0, dt)
            self._waited += dt
            self._held = self._held + dt if met else 0.0
            if self._held >= task.hold or self._waited >= task.hold + task.patience:
                self.phase = TaskPhase.BACK
        elif self.phase == TaskPhase.BACK:
            self._move(-1.0 / task.withdraw, dt)
            if self.sigma <= 0.0:
                self.phase = TaskPhase.DONE

    def again(self) -> None:
        """The target has moved: the hold begins anew, a way back is called off and turns around smoothly."""
        self._held = self._waited = 0.0
        if self.phase in (TaskPhase.BACK, TaskPhase.DONE):
            self.rate = -self._go_time / self._task.withdraw if self.phase == TaskPhase.BACK else 0.0
            self.phase = TaskPhase.GO

    def sigmas(self, time: float, times: Vector, *, rate: float) -> Vector:
        """σ (n,) at `times` (n,) seconds from now, the way out going on at `rate`."""
        if self.phase == TaskPhase.DONE:
            return np.zeros(len(times))
        pace, duration, wait = max(rate, 0.0), self._go_time, 0.0
        if self.phase == TaskPhase.BACK:
            pace, duration = -1.0, self._task.withdraw
        elif self.phase == TaskPhase.WAIT:
            wait = self._task.start - time
        return _course(self.sigma, pace, duration, wait, times)

    def _move(self, rate: float, dt: float) -> None:
        self.sigma = min(max(self.sigma + rate * dt, 0.0), 1.0)
        self.sigma_rate = rate


@kernel
def _course(sigma: float, pace: float, duration: float, wait: float, times: Vector) -> Vector:
    """σ (n,) at `times` (n,) [s] of a way of `duration` [s] at `pace` from `sigma` on, after a `wait` [s]."""
    out = np.empty(len(times))
    for k in range(len(times)):
        out[k] = min(max(sigma + pace * max(times[k] - wait, 0.0) / duration, 0.0), 1.0)
    return out
