"""A lift: both palms go to a box, take it between them, bring it up and carry it ([M] Fig. 4)."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

import numpy as np

from wbmpc.planner.carry import Carry
from wbmpc.planner.hand_path import HandPath, minimum_jerk
from wbmpc.rotations import UP, level_frame
from wbmpc.scenario import Load
from wbmpc.signals import GRAVITY, HandMode, Vector

GRASP_UP = 0.5  # of the half height, from the centre to the grasp: held above its centre a box hangs upright
GAP = 0.03  # [m] between palm and face where the closing begins
ELBOW_OUT = 0.018  # [m] of an elbow beyond its palm, away from the box: forearms are as thick as palms
SEARCH = 0.02  # [m] how far behind its face a palm looks for the box
ARRIVED = 0.015  # [m] of both palms, before they close
PATIENCE = 2.0  # [s] waited for that
TOUCH_SPEED, TOUCHED = 0.05, 0.5  # [m/s], [N] of the closing palms
CLOSING_URGENCY = 0.2  # of palms that close, 0 … 1: against the elbows' half-spaces they would hardly touch
RAMP = 0.3  # [s] of the squeeze, and after it of the weight
GRIP_MARGIN, LEAST_SQUEEZE = 1.4, 5.0  # factor on the squeeze that just holds; [N]
FELT_TIME = 0.3  # [s] time constant of the weight that is felt
LOST_FORCE, LOST_TIME = 0.3, 0.1  # [N], [s] a palm without force for so long has lost the box


class LiftPhase(IntEnum):
    """Where a lift stands."""

    WAIT = 0
    REACH = 1  # to beside the faces
    CLOSE = 2  # inwards, until both palms feel the box
    GRIP = 3  # the squeeze grows, then the weight is taken
    RAISE = 4
    CARRY = 5
    GIVE_UP = 6  # the palms go home
    DONE = 7


class Lift:
    """One lift task. `advance` moves it on once per plan; everything else reads.

    The palms press on the two opposite faces whose normals are most across the robot's heading. What the box weighs is
    what the task says until it hangs free, then what the palms feel.
    """

    def __init__(self, load: Load, *, palms: Vector, heading: float, palm_radius: float) -> None:
        """`palms` (2, 3) are where the hands hang [m]; the robot's `heading` [rad] says which face is left."""
        self.task, self.phase, self.mass = load.task, LiftPhase.WAIT, load.mass
        frame = level_frame(load.yaw)
        left = level_frame(heading)[:, 1]
        axis = int(np.argmax(np.abs(frame[:, :2].T @ left)))
        across = frame[:, axis] * np.sign(frame[:, axis] @ left)
        self.normals = np.array([across, -across])  # (2, 3) of the faces, left and right
        reach = load.half[axis] + palm_radius
        self.grasp = load.centre + GRASP_UP * load.half[2] * UP + reach * self.normals  # (2, 3) [m] the palms on it
        beside = self.grasp + GAP * self.normals
        self._paths = [
            HandPath(start=p.copy(), end=e, away=n) for p, e, n in zip(palms, beside, self.normals, strict=True)
        ]
        self.sigma = 0.0  # share of the present way
        self._clock = 0.0  # [s] in this phase
        self._depth = np.zeros(2)  # [m] of the closing palms
        self._closed = np.zeros(2, dtype=bool)
        self._without = 0.0  # [s] without force
        self._told = load.mass
        self.carry: Carry | None = None  # once the feet have set out with the box

    # ------------------------------------------------------------------ what others may ask

    @property
    def ahead(self) -> bool:
        """Whether the hands belong to the lift, now or later."""
        return self.phase != LiftPhase.DONE

    @property
    def active(self) -> bool:
        """Whether it moves the hands now."""
        return self.phase not in (LiftPhase.WAIT, LiftPhase.DONE)

    @property
    def raised(self) -> bool:
        """Whether the box is on its way up, or up."""
        return self.phase in (LiftPhase.RAISE, LiftPhase.CARRY)

    @property
    def holds(self) -> bool:
        """Whether the palms hold the box."""
        return self.phase in (LiftPhase.GRIP, LiftPhase.RAISE, LiftPhase.CARRY)

    @property
    def lost(self) -> bool:
        """Whether it was given up: nothing was there, or it slipped away."""
        return self.phase in (LiftPhase.GIVE_UP, LiftPhase.DONE)

    @property
    def hold_feet(self) -> bool:
        """Whether the feet must stay where they are: what they are to do they do with the box.

        A stride that is under way when the box is lost is made, and no other.
        """
        return self.phase != LiftPhase.CARRY

    @property
    def progress(self) -> float:
        """Share of the way that the postures low and high stand for; a box that goes along leaves it to the stride."""
        return 0.0 if self.carry is not None else self.sigma

    @property
    def mode(self) -> HandMode:
        """What the tracker does with both hands; only when active."""
        return HandMode.CARRY if self.holds else HandMode.MOVE

    @property
    def urgency(self) -> float:
        """How much the hands may disturb the rest of the body, 0 … 1: palms that close must press."""
        return CLOSING_URGENCY if self.phase == LiftPhase.CLOSE else 0.0

    @property
    def top(self) -> Vector:
        """(2, 3) [m] the palms where the lift ends."""
        return self.grasp + self.task.height * UP

    def reference(self, side: int) -> tuple[Vector, Vector]:
        """Palm position and velocity (3,) to follow now; only when active."""
        rate = self._rate
        if self.carry is not None:
            return self.carry.reference(side)
        if self.holds:
            s, ds, _ = minimum_jerk(self.sigma if self.raised else 0.0)
            return self.grasp[side] + s * self.task.height * UP, ds * rate * self.task.height * UP
        if self.phase == LiftPhase.CLOSE:
            moving = TOUCH_SPEED * float(not self._closed[side])
            path, inwards = self._paths[side], -self.normals[side]
            return path.end + self._depth[side] * inwards, moving * inwards
        p, dp, _ = self._paths[side].at(self.sigma)
        return p, dp * rate

    def sigmas(self, times: Vector) -> Vector:
        """Shares (n,) of the present way `times` (n,) seconds from now; see `progress`."""
        if self.carry is not None:
            return np.zeros(len(times))
        return np.clip(self.sigma + self._rate * times, 0.0, 1.0)

    def preview(self, times: Vector) -> Vector:
        """Palm references (2, n, 3) [m] at `times` (n,) seconds from now."""
        if self.carry is not None:
            return self.carry.preview()
        if self.holds:
            shares = self.sigmas(times) if self.raised else np.zeros(len(times))
            rise = np.array([minimum_jerk(float(s))[0] for s in shares]) * self.task.height
            return self.grasp[:, None] + rise[:, None] * UP
        if self.phase == LiftPhase.CLOSE:
            return np.tile(np.array([self.reference(side)[0] for side in range(2)])[:, None], (1, len(times), 1))
        return np.array([path.positions(self.sigmas(times)) for path in self._paths])

    def forces(self, times: Vector) -> Vector:
        """Forces (2, n, 3) [N] of the box on the palms, in world, `times` (n,) seconds from now; 0 when not held."""
        forces = np.zeros((2, len(times), 3))
        if self.holds:
            clock = times + (self._clock if self.phase == LiftPhase.GRIP else 2.0 * RAMP)
            squeeze, taken = np.clip(clock / RAMP, 0.0, 1.0), np.clip(clock / RAMP - 1.0, 0.0, 1.0)
            forces += self._squeeze * squeeze[:, None] * self.normals[:, None]
            forces -= 0.5 * self.mass * GRAVITY * taken[:, None] * UP
        return forces

    def guard(self, arm_keep_out: Vector) -> None:
        """Keep the elbows outside the box's faces: write their half-spaces into (2, 3, 5), see `KeepOut.of_arms`."""
        arm_keep_out[:, 2, :3], arm_keep_out[:, 2, 4] = self.normals, 1.0
        arm_keep_out[:, 2, 3] = np.einsum("si,si->s", self.normals, self.grasp) + ELBOW_OUT

    @property
    def _squeeze(self) -> float:
        """[N] with which each palm presses."""
        return max(LEAST_SQUEEZE, GRIP_MARGIN * 0.5 * max(self.mass, self._told) * GRAVITY / self.task.friction)

    @property
    def _rate(self) -> float:
        """[1/s] of the present way."""
        if self.phase == LiftPhase.REACH:
            return 1.0 / self.task.reach_time
        if self.phase == LiftPhase.RAISE:
            return 1.0 / self.task.raise_time
        return -1.0 / self.task.reach_time if self.phase == LiftPhase.GIVE_UP else 0.0

    # ------------------------------------------------------------------ one plan later

    def advance(self, time: float, dt: float, *, palms: Vector, palm_forces: Vector, homes: Vector) -> None:
        """With measured palms (2, 3) [m] and forces on them (2, 3) [N]; `homes` (2, 3) [m]: where free palms hang."""
        self._clock += dt
        pressed = np.einsum("si,si->s", palm_forces, self.normals)  # (2,) [N]
        phase = self.phase
        if phase == LiftPhase.WAIT and time >= self.task.start - 1e-9:
            self._paths = [replace(path, start=palm.copy()) for path, palm in zip(self._paths, palms, strict=True)]
            self._enter(LiftPhase.REACH)
        elif phase in (LiftPhase.REACH, LiftPhase.RAISE, LiftPhase.GIVE_UP):
            self.sigma = float(np.clip(self.sigma + self._rate * dt, 0.0, 1.0))
        if phase == LiftPhase.REACH and self.sigma >= 1.0:
            ends = np.array([path.end for path in self._paths])
            if float(np.linalg.norm(palms - ends, axis=1).max()) < ARRIVED:
                self._enter(LiftPhase.CLOSE)
            elif self._clock > self.task.reach_time + PATIENCE:
                self._give_up(palms, homes)
        elif phase == LiftPhase.CLOSE:
            self._closed |= pressed > TOUCHED
            self._depth[~self._closed] += TOUCH_SPEED * dt
            if self._closed.all():
                self.grasp = palms.copy()
                self._enter(LiftPhase.GRIP)
            elif float(self._depth.max()) > GAP + SEARCH:
                self._give_up(palms, homes)
        elif phase == LiftPhase.GRIP and self._clock >= 2.0 * RAMP:
            self.sigma = 0.0
            self._enter(LiftPhase.RAISE)
        elif phase == LiftPhase.RAISE and self.sigma >= 1.0:
            self._enter(LiftPhase.CARRY)
        elif phase == LiftPhase.GIVE_UP:
            self._paths = [replace(path, start=home.copy()) for path, home in zip(self._paths, homes, strict=True)]
            if self.sigma <= 0.0:
                self._enter(LiftPhase.DONE)
        if self.holds:
            self._feel(dt, pressed, palm_forces, palms, homes)

    def go_along(self, com: Vector, course: Vector, *, heading: float, yaw_rate: float) -> None:
        """The feet have set out: from now on the box goes with the CoM; see `Carry.follow`."""
        if self.phase != LiftPhase.CARRY:
            return
        if self.carry is None:
            palms = np.array([self.reference(side)[0] for side in range(2)])
            self.carry = Carry(palms, com=com[:, 0], heading=heading)
        self.carry.follow(com, course, heading=heading, yaw_rate=yaw_rate)
        self.grasp = np.array([self.reference(side)[0] for side in range(2)])

    def _feel(self, dt: float, pressed: Vector, palm_forces: Vector, palms: Vector, homes: Vector) -> None:
        """The weight that hangs on the palms, the line between them, and whether the box is still there."""
        across = palms[0] - palms[1]
        across /= np.linalg.norm(across)
        self.normals = np.array([across, -across])
        if self.raised:
            felt = float(np.clip(-palm_forces[:, 2].sum() / GRAVITY, 0.0, 5.0 * self._told))
            self.mass += dt / FELT_TIME * (felt - self.mass)
            self._without = self._without + dt if float(pressed.min()) < LOST_FORCE else 0.0
            if self._without > LOST_TIME:
                self._give_up(palms, homes)

    def _give_up(self, palms: Vector, homes: Vector) -> None:
        apart = palms + GAP * self.normals
        self._paths = [
            HandPath(start=h.copy(), end=p, away=n) for h, p, n in zip(homes, apart, self.normals, strict=True)
        ]
        self.sigma, self.mass, self.carry = 1.0, 0.0, None
        self._enter(LiftPhase.GIVE_UP)

    def _enter(self, phase: LiftPhase) -> None:
        self.phase, self._clock = phase, 0.0
