"""The gait: which feet stand, now and over the horizon."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from wbmpc.planner.footstep import Feet, Footstep, SoleReferences
from wbmpc.planner.footstep_bounds import FootstepBounds
from wbmpc.planner.settings import GaitSettings
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.stride import Stride
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.support_horizon import NEVER, SupportHorizon
from wbmpc.planner.support_interval import Interval, Transfer
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.swing import Swing
from wbmpc.rotations import angle_difference
from wbmpc.signals import SIDES, Vector

EARLY = 0.6  # share of the swing from which a touch counts as the landing
SEARCH_TIME = 0.6  # [s] after which a foot that finds no ground is taken for landed
LATE = 0.3  # [s] after which it is said that it finds none
LIFT_INSET = 0.005  # [m] of the pressure inside the sole that stays when a stride's foot lifts


class SupportPhase(IntEnum):
    """What carries the robot."""

    STAND = 0  # both feet, no step ahead
    DOUBLE = 1  # both feet, a step ahead
    SINGLE = 2  # one foot, the other swings


class Gait:
    """Support phases of the two feet, driven by a clock, touch-downs and the steps that the tasks ask for."""

    def __init__(self, settings: GaitSettings, stepping: Stepping, *, feet: Feet, half_extents: Vector) -> None:
        """Standing on `feet`, whose soles have `half_extents` (2,) [m]."""
        self._settings, self._stepping, self._half_extents = settings, stepping, half_extents
        self.feet = feet
        self.phase = SupportPhase.STAND
        self.step: Footstep | None = None
        self.swing: Swing | None = None
        self._left = 0.0  # [s] until the phase ends
        self._late = 0.0  # [s] since the foot should have landed
        self._made: dict[tuple[int, float], SupportPolygon] = {}  # polygons of the feet as they stand, by swing, margin
        self._made_on = feet
        self._stood: tuple[Feet, Vector, tuple[float, float], SupportPreview] | None = None  # the last one of STAND

    # ------------------------------------------------------------------ now

    @property
    def stance(self) -> tuple[bool, bool]:
        """Which feet stand."""
        return tuple(self.swing is None or self.swing.step.side != side for side in range(2))  # type: ignore[return-value]

    def soles(self, rate: float) -> SoleReferences:
        """Both soles now, the present phase going on at `rate` (0 … 1)."""
        positions, yaws, yaw_rates = self.feet.positions.copy(), self.feet.yaws.copy(), np.zeros(2)
        velocities, accelerations = np.zeros((2, 3)), np.zeros((2, 3))
        if self.swing is not None:
            side = self.swing.step.side
            pace = rate / self.swing.step.swing_time if self._left > 0.0 else 0.0
            positions[side], velocities[side], accelerations[side] = self.swing.reference(pace)
            yaws[side], yaw_rates[side] = self.swing.heading(pace)
        return SoleReferences(positions, yaws, velocities, yaw_rates, accelerations)

    @property
    def stride(self) -> Stride | None:
        """The step ahead or under way when its place is fixed: the CoM must go where it can be made."""
        step = self.step if self.swing is None else self.swing.step
        if self.phase == SupportPhase.STAND or step is None or step.adaptable:
            return None
        return Stride(step, self.feet, self.swing, self._left)

    def shares(self, times: Vector, rate: float) -> Vector:
        """Shares (n,) of a stride's way done `times` (n,) seconds from now at `rate`; 0 without one."""
        stride = self.stride
        return np.zeros(len(times)) if stride is None else stride.shares(times, rate=rate)

    @property
    def walking(self) -> bool:
        """Whether the step ahead or under way is one of a walk."""
        step = self.step if self.swing is None else self.swing.step
        return step is not None and step.adaptable

    @property
    def crouch(self) -> float:
        """How much lower than a standing CoM that of a walk is [m]; 0 when not walking."""
        return self._settings.crouch if self.walking else 0.0

    # ------------------------------------------------------------------ one plan later

    def advance(
        self,
        time: float,
        dt: float,
        *,
        rate: float,
        stay: bool = False,
        soles: Vector,
        yaws: Vector,
        loads: Vector,
        zmp: Vector,
        events: list[str],
    ) -> None:
        """Move the clock on by dt [s] at `rate` (0 … 1: the gate).

        Args:
            stay: lift no foot for a stride, and begin no walk.
            soles, yaws: measured (2, 3) [m], (2,) [rad]: a foot stands where it has landed.
            loads: (2,) measured vertical forces [N].
            zmp: (2,) measured centre of the feet's pressure [m]: a stride waits until it is in the sole that stays.
        """
        settings = self._settings
        if self.phase != SupportPhase.SINGLE:
            may = not stay or (self.step is not None and self.step.adaptable)  # nobody stops in the middle of a walk
            wanted = self._stepping.next(self.feet, time) if may else None
            if wanted is None:
                self.phase, self.step = SupportPhase.STAND, None
                return
            if self.phase == SupportPhase.STAND:
                self.phase = SupportPhase.DOUBLE
                self._left = max(settings.first_double_support, wanted.double_support)
            self.step = wanted
            self._left = max(0.0, self._left - rate * dt)
            if self._left <= 1e-9 and (wanted.adaptable or self.goal_polygon(LIFT_INSET).excess(zmp) <= 0.0):
                self._lift(wanted, events)
            return
        assert self.swing is not None
        swing = self.swing
        side = swing.step.side
        self._left = max(0.0, self._left - rate * dt)
        swing.sigma = 1.0 - self._left / swing.step.swing_time
        if self._left == 0.0:
            if self._late < LATE <= self._late + dt:
                events.append(f"foot {SIDES[side]}: no ground for {LATE:g} s where it should have landed")
            self._late += dt
            sunk = min(settings.search_speed * self._late, settings.search_depth)
            swing.lower(sunk, settings.search_speed if sunk < settings.search_depth else 0.0)
        landed = swing.sigma > EARLY and loads[side] > settings.landing_force
        if landed or self._late > SEARCH_TIME:
            self._land(soles[side], float(yaws[side]), time, events)

    def aim(self, shift: Vector, dt: float) -> None:
        """Move the landing place by what stage 2 has decided, `shift` (2,) [m] from the step's own place."""
        if self.swing is not None and self.swing.step.adaptable and self._settings.adapt_footsteps:
            self.swing.move_target(self.swing.step.position[:2] + shift, dt)

    def _lift(self, step: Footstep, events: list[str]) -> None:
        side = step.side
        self.swing = Swing(
            step,
            start=self.feet.positions[side],
            yaw=float(self.feet.yaws[side]),
            speed=self._settings.foot_speed,
        )
        self.phase, self._left, self._late = SupportPhase.SINGLE, step.swing_time, 0.0
        events.append(f"foot {SIDES[side]}: lifted")

    def _land(self, sole: Vector, yaw: float, time: float, events: list[str]) -> None:
        assert self.swing is not None
        step = self.swing.step
        positions, yaws = self.feet.positions.copy(), self.feet.yaws.copy()
        positions[step.side] = sole
        yaws[step.side] = step.yaw + angle_difference(yaw, step.yaw)  # whole turns are kept
        self.feet = Feet(positions, yaws, step.side)
        self.swing = None
        self._stepping.landed(step)
        self.step = self._stepping.next(self.feet, time)
        self.phase = SupportPhase.DOUBLE if self.step else SupportPhase.STAND
        early = self._left if step.adaptable else 0.0  # a walk keeps its beat: the plan counts on it
        self._left = self.step.double_support + early if self.step else 0.0
        x, y = sole[:2]
        events.append(f"foot {SIDES[step.side]}: landed at ({x:.3f}, {y:.3f})")
        if self.step is None and self._stepping.stopped_short(self.feet, time):
            events.append("feet: no way on from here")

    # ------------------------------------------------------------------ over the horizon

    def preview(
        self, time: float, times: Vector, *, rate: float, margin: float, growth: float, com: Vector
    ) -> SupportPreview:
        """Support over the horizon.

        Where soles stand at different heights all polygons are projected onto the plane of the feet that stand now.

        Args:
            time: now [s].
            times: (N,) knots [s from now].
            rate: at which the present phase goes on (0 … 1).
            margin: inset of the polygons [m], growing by `growth` [m/s].
            com: (N, 3) where the CoM will be [m], roughly.
        """
        stands = self.phase == SupportPhase.STAND and not self._stepping.has_commands
        if stands and self._stood is not None:
            feet, knots, insets, stood = self._stood
            if feet is self.feet and knots is times and insets == (margin, growth):
                return stood  # nothing changes while the robot stands on level ground
        intervals, steps = self._intervals(time, float(times[-1]), rate)
        standing = [float(self.feet.positions[side, 2]) for side in range(2) if self.stance[side]]
        horizon = SupportHorizon(intervals, times, standing=standing)
        preview = horizon.preview(
            half_extents=self._half_extents,
            margin=margin,
            growth=growth,
            com=com,
            com_velocity=self._stepping.velocities(horizon.headings, time + times),
            bounds=FootstepBounds.of(self._settings, self.feet, steps, swing=self.swing, left=self._left),
        )
        if stands and horizon.plane is None:
            self._stood = (self.feet, times, (margin, growth), preview)
        return preview

    def goal_polygon(self, margin: float) -> SupportPolygon:
        """What carries the robot where its task ends: the stance foot when a foot is put somewhere, else both feet."""
        return self._polygon_without(-1 if self.stride is None else self.stride.step.side, margin)

    def present_polygon(self, margin: float) -> SupportPolygon:
        """What carries the robot now."""
        return self._polygon_without(-1 if self.swing is None else self.swing.step.side, margin)

    def _polygon_without(self, swing: int, margin: float) -> SupportPolygon:
        """Polygon of the feet but for the one at side `swing` (-1: of both), inset by `margin` [m]."""
        if self._made_on is not self.feet:
            self._made_on, self._made = self.feet, {}
        if (swing, margin) not in self._made:
            interval = Interval(NEVER, self.feet, swing, (-1, -1))
            polygon = interval.polygon(0.0, half_extents=self._half_extents, margin=margin)
            self._made[swing, margin] = polygon
        return self._made[swing, margin]

    def _intervals(self, time: float, horizon: float, rate: float) -> tuple[list[Interval], list[Footstep]]:
        """Phases until the horizon [s] and the footsteps made in them, at most MAX_FOOTSTEPS."""
        feet, moved = self.feet, (-1, -1)
        steps: list[Footstep] = []
        made: tuple[int, ...] = ()
        if self.phase == SupportPhase.STAND or (self.step is None and self.swing is None):
            return [Interval(NEVER, feet, -1, moved)], steps
        end = min(self._left / max(rate, 1e-6), NEVER)
        intervals: list[Interval] = []
        step = self.step if self.swing is None else self.swing.step
        if self.swing is None:
            assert step is not None
            transfer = Transfer.before_step(step, feet, end)
            if transfer and feet.last < 0 and transfer.begin > 0.0:
                intervals.append(Interval(transfer.begin, feet, -1, moved))
            intervals.append(Interval(end, feet, -1, moved, transfer))
            end += step.swing_time
        while step is not None and len(steps) < MAX_FOOTSTEPS:
            intervals.append(Interval(end, feet, step.side, moved))
            moved = (len(steps), moved[1]) if step.side == 0 else (moved[0], len(steps))
            steps.append(step)
            made += (step.task,)
            feet = feet.after(step)
            if end > horizon:
                break
            step = self._stepping.next(feet, time + end, made=made)
            end = end + step.double_support if step else NEVER
            intervals.append(Interval(end, feet, -1, moved, Transfer.before_step(step, feet, end) if step else None))
            if step is not None:
                end += step.swing_time
        intervals.append(Interval(NEVER, feet, -1, moved))
        return intervals, steps
