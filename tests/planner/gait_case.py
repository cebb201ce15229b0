"""A gait with ideal feet: they are where they are told to be, and land on the ground when their time is up."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import Feet
from wbmpc.planner.gait import Gait
from wbmpc.planner.settings import GaitSettings
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.planner.support_preview import SupportPreview
from wbmpc.scenario import StepTask, Task, VelocityCommand, WalkTask
from wbmpc.signals import Vector

HALF = np.array([0.06, 0.035])  # [m] of a sole
DT = 0.01  # [s]
SETTINGS = GaitSettings(swing_time=0.5, double_support=0.15)  # a transfer longer than a knot: several plans see it
PERIOD = SETTINGS.swing_time + SETTINGS.double_support  # [s] of one step
WEIGHT = 30.0  # [N] on a foot that stands
Velocity = tuple[float, float, float]


def walk(*commands: tuple[float, float, float, float]) -> WalkTask:
    """Commands (time [s], forward, left [m/s], yaw rate [rad/s])."""
    return WalkTask(
        kind="walk",
        commands=tuple(VelocityCommand(time=t, velocity=(vx, vy), yaw_rate=omega) for t, vx, vy, omega in commands),
    )


def step_task(foot: str = "left", target: tuple[float, float] = (0.05, 0.1), start: float = 0.2) -> StepTask:
    return StepTask.model_validate({"kind": "step", "foot": foot, "target": target, "start": start, "duration": 1.0})


def stepping(*tasks: Task, settings: GaitSettings = SETTINGS) -> Stepping:
    return Stepping(tasks, settings, Footholds((), HALF))


def feet_at(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, *, width: float = SETTINGS.step_width) -> Feet:
    """Side by side around (x, y)."""
    across = 0.5 * width * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    middle = np.array([x, y, 0.0])
    return Feet(np.array([middle + across, middle - across]), np.array([yaw, yaw]), -1)


def sole(feet: Feet, side: int) -> Vector:
    """Corners (4, 2) [m]."""
    return foot_corners(position=feet.positions[side], yaw=float(feet.yaws[side]), half_extents=HALF)


@dataclass
class IdealGait:
    """Time and gait together, one tick after the other."""

    gait: Gait
    time: float = 0.0
    error: Vector = field(default_factory=lambda: np.zeros(2))  # [m] by which the next landing misses its place
    stay: bool = False
    zmp: Vector | None = None  # [m] of the feet; None: where the foot that stays can carry it
    events: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, *tasks: Task, settings: GaitSettings = SETTINGS, feet: Feet | None = None) -> IdealGait:
        feet = feet or feet_at()
        steps = stepping(*tasks, settings=settings)
        return cls(Gait(settings, steps, feet=feet, half_extents=HALF))

    def tick(self, *, rate: float = 1.0, touch: bool | None = None) -> None:
        """One plan later; `touch` says whether the swing foot feels the ground, by default when its time is up."""
        gait = self.gait
        self.time += DT
        now = gait.soles(rate)
        soles, yaws = now.positions, now.yaws
        loads = np.full(2, WEIGHT)
        swing = gait.swing
        if swing is not None:
            side = swing.step.side
            if touch is None:
                touch = swing.sigma + DT / swing.step.swing_time > 1.0 - 1e-9
            loads[side] = WEIGHT if touch else 0.0
            soles[side, :2] += self.error
        before = len(self.events)
        gait.advance(
            *(self.time, DT),
            rate=rate,
            stay=self.stay,
            soles=soles,
            yaws=yaws,
            loads=loads,
            zmp=self._carried() if self.zmp is None else self.zmp,
            events=self.events,
        )
        if any("landed" in event for event in self.events[before:]):
            self.error = np.zeros(2)

    def _carried(self) -> Vector:
        """The middle of the foot that stays at the step ahead."""
        step = self.gait.step
        return self.gait.feet.positions[0 if step is None else 1 - step.side, :2]

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            self.tick()

    def polygon(self, margin: float = 0.0) -> SupportPolygon:
        """What the feet that stand now can carry."""
        feet, stance = self.gait.feet, self.gait.stance
        corners = [sole(feet, side) for side in range(2) if stance[side]]
        return SupportPolygon.of_corners(np.vstack(corners), margin=margin, plane_height=0.0)

    def preview(self, times: Vector, *, rate: float = 1.0, margin: float = 0.0, growth: float = 0.0) -> SupportPreview:
        com = np.tile([*self.gait.feet.positions[:, :2].mean(axis=0), 0.25], (len(times), 1))
        return self.gait.preview(self.time, times, rate=rate, margin=margin, growth=growth, com=com)
