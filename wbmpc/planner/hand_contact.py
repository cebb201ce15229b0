"""The life of one hand's contact: needed, chosen, approaching, sensed, loaded, quiet, unloaded, released."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbmpc.planner.hand_path import HandPath
from wbmpc.planner.pace import Pace, ramp
from wbmpc.planner.posture import PalmTarget
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.urgent_approach import UrgentApproach
from wbmpc.rotations import length
from wbmpc.scenario import PatchPose
from wbmpc.signals import ContactPhase, HandMode, Vector

PATIENCE = 1.5  # [s] waited for the palm at the clearance point before the candidate is given up
LOST_TIME = 0.15  # [s] without force after which a contact that should carry load is lost

SHORTEST = 0.4  # [s] least time of a careful approach

TOUCHING = (ContactPhase.SENSED, ContactPhase.LOADED, ContactPhase.QUIET, ContactPhase.UNLOADED)


class HandContact:
    """One hand's contact, from the choice of a patch to the hand's return.

    `advance` moves the life on once per plan; everything else reads. Times are in seconds, forces in newtons.
    """

    def __init__(self, side: int, settings: ContactSettings, *, palm_radius: float) -> None:
        self.side = side
        self.phase = ContactPhase.NONE
        self.patch: PatchPose | None = None
        self._settings, self._radius = settings, palm_radius
        self._clock = 0.0  # [s] in this phase
        self._level = 0.0  # share of the force cap granted now, 0 … 1
        self._descent = -1.0  # [m] how far the descent has come; negative: still on the way to the clearance point
        self._path: HandPath | None = None
        self._sigma, self._duration, self._rate = 0.0, 1.0, 1.0
        self._rest, self._touched = np.zeros(3), np.zeros(3)  # [m] palm on the patch: where it should be, where it is
        self._palm = np.zeros(3)  # [m] measured at the last plan
        self._gripped: tuple[Vector, PatchPose, PatchPose] | None = None  # palm, patch and the grip of both
        self._unloaded_clock = 0.0
        self._urgency = 0.0  # 0 … 1, now
        self._pace = Pace.of(settings, 0.0)  # of the present approach
        self._urgent: UrgentApproach | None = None

    # ------------------------------------------------------------------ what others may ask

    @property
    def busy(self) -> bool:
        """Whether the hand belongs to a contact now."""
        return self.phase not in (ContactPhase.NONE, ContactPhase.NEEDED)

    @property
    def touching(self) -> bool:
        """Whether the palm rests on its patch."""
        return self.phase in TOUCHING

    @property
    def expected(self) -> bool:
        """Whether the plan waits for this contact to carry its load: the task's progress is gated meanwhile."""
        return self.phase in (
            ContactPhase.NEEDED,
            ContactPhase.CHOSEN,
            ContactPhase.APPROACHING,
            ContactPhase.SENSED,
        )

    @property
    def mode(self) -> HandMode:
        """What the tracker does with this hand."""
        if self.touching:
            return HandMode.CONTACT
        return HandMode.MOVE if self.busy else HandMode.FREE

    @property
    def hurried(self) -> bool:
        """Whether the palm is on an urgent way to its patch."""
        return self.phase in (ContactPhase.CHOSEN, ContactPhase.APPROACHING) and self._pace.hurried

    @property
    def has_goal(self) -> bool:
        """Whether there is a contact to reach or hold."""
        return self.patch is not None and self.phase != ContactPhase.RELEASED

    @property
    def goal(self) -> Vector | None:
        """Palm position (3,) of the contact in world [m]; None when there is none to reach or hold."""
        if self.patch is None or not self.has_goal:
            return None
        return self._touched if self.touching else self._rest

    @property
    def target(self) -> PalmTarget | None:
        """The same for a posture, with the surface's normal."""
        goal = self.goal
        return None if goal is None or self.patch is None else PalmTarget(goal, self.patch.normal)

    @property
    def grip(self) -> PatchPose | None:
        """The contact as stage 3 and the ZMP know it: the patch, its position where the force acts.

        That is the patch's centre until the palm touches, and from then on where the palm, a sphere, is measured to
        touch; None without a contact.
        """
        palm, patch, gripped = self._palm, self.patch, self._gripped
        if patch is None or not self.touching:
            return patch
        if gripped is None or gripped[0] is not palm or gripped[1] is not patch:
            grip = replace(patch, position=palm - self._radius * patch.normal)
            gripped = self._gripped = palm, patch, grip
        return gripped[2]

    def reference(self) -> tuple[Vector, Vector, Vector]:
        """Palm position, velocity and acceleration (3,) to follow now; only when busy."""
        zero = np.zeros(3)
        if self.touching:
            return self._touched, zero, zero
        assert self._path is not None
        assert self.patch is not None
        if self._urgent is not None and self.hurried:
            return self._urgent.reference()[:3]
        if self._descent >= 0.0:
            moving = self._descent < self._pace.clearance + self._settings.search_depth
            normal = self.patch.normal
            return (
                self._path.end - self._descent * normal,
                -self._pace.touch_speed * normal if moving else zero,
                zero,
            )
        p, dp, ddp = self._path.at(self._sigma)
        return p, dp * self._rate, ddp * self._rate**2

    @property
    def jerk(self) -> Vector:
        """With which that acceleration goes on (3,) [m/s³]: only a hurried palm's changes between two plans."""
        return self._urgent.reference()[3] if self._urgent is not None and self.hurried else np.zeros(3)

    def preview(self, times: Vector) -> Vector:
        """Palm references (n, 3) [m] at `times` (n,) seconds from now, while there is a goal to reach or hold."""
        if self._urgent is not None and self.hurried:
            return self._urgent.preview(times)
        if self.touching or self._path is None or self._descent >= 0.0:
            return np.full((len(times), 3), self.reference()[0])
        return self._path.positions(np.minimum(np.maximum(self._sigma + self._rate * times, 0.0), 1.0))

    def caps(self, times: Vector) -> Vector:
        """Bound on the normal force [N] at `times` (n,) seconds from now, ramps included."""
        if self.patch is None:
            return np.zeros(len(times))
        unloading = self.phase == ContactPhase.UNLOADED
        slope = -1.0 / self._settings.ramp_time if unloading else 1.0 / self._pace.ramp_time
        return ramp(self.patch.force_cap if self.touching else 0.0, self._level, slope, times)

    # ------------------------------------------------------------------ the life

    def choose(self, patch: PatchPose, *, palm: Vector, palm_velocity: Vector) -> None:
        """Stage 3 has chosen `patch`; the palm is at `palm` (3,) [m] and moves with `palm_velocity` (3,) [m/s]."""
        self.patch, self._rest = patch, patch.position + self._radius * patch.normal
        pace = self._pace = Pace.of(self._settings, self._urgency)
        clearance = patch.position + (self._radius + pace.clearance) * patch.normal
        self._path = HandPath(start=palm.copy(), end=clearance, away=patch.normal)
        self._duration = max(SHORTEST, length(clearance - palm) / self._settings.approach_speed)
        self._sigma, self._rate, self._descent = 0.0, 1.0 / self._duration, -1.0
        self._enter(ContactPhase.CHOSEN)
        self._urgent = None
        if pace.hurried:
            self._urgent = UrgentApproach(patch, self._settings, radius=self._radius, palm=palm, velocity=palm_velocity)
            self._duration = self._urgent.duration

    def release(self, *, palm: Vector, home: Vector) -> None:
        """Leave the surface (or give the approach up): lift along the normal and return to `home` (3,)."""
        assert self.patch is not None
        self._path = HandPath(start=home.copy(), end=palm + 0.02 * self.patch.normal, away=self.patch.normal)
        self._duration = max(0.6, length(palm - home) / self._settings.approach_speed)
        self._sigma, self._rate, self._descent = 1.0, -1.0 / self._duration, -1.0
        self._enter(ContactPhase.RELEASED)

    def need(self, needed: bool) -> None:
        """Mark a hand without a contact as asked for one, or no longer."""
        if not self.busy:
            self.phase = ContactPhase.NEEDED if needed else ContactPhase.NONE

    def advance(
        self,
        dt: float,
        *,
        palm: Vector,
        palm_velocity: Vector,
        force: Vector,
        wanted_force: float,
        needed: bool,
        quiet: bool,
        urgency: float,
        home: Vector,
    ) -> str | None:
        """One plan later.

        Args:
            dt: since the last call [s].
            palm: measured palm position (3,) [m].
            palm_velocity: measured (3,) [m/s].
            force: measured palm force (3,) [N].
            wanted_force: normal force that the plan asks for now [N].
            needed: whether stage 2 still asks for a shift.
            quiet: whether the asked shift is negligible over the whole horizon.
            urgency: how soon a contact is needed, 0 … 1: the planner's alarm.
            home: where the palm returns to (3,) [m].

        Returns:
            "missing" when there is nothing where the contact should be, "unreached" when the palm did not get there,
            else None.
        """
        self._urgency, self._palm = urgency, palm
        if not self.busy or self.patch is None:
            return None
        settings, phase = self._settings, self.phase
        self._clock += dt
        normal_force = float(force @ self.patch.normal)
        if phase == ContactPhase.CHOSEN:
            phase = self.phase = ContactPhase.APPROACHING  # the clock goes on
        if phase == ContactPhase.APPROACHING:
            if self._urgent is not None and normal_force <= settings.sensed_force:
                self._urgent.aim(palm, palm_velocity, elapsed=self._clock)
            return self._approach(
                dt, palm=palm, palm_velocity=palm_velocity, normal_force=normal_force, needed=needed, home=home
            )
        elif phase == ContactPhase.RELEASED:
            self._path = self._path and replace(self._path, start=home.copy())  # the torso moves on meanwhile
            self._sigma += self._rate * dt
            if self._sigma <= 0.0:
                self.patch = None
                self._enter(ContactPhase.NONE)
        elif phase == ContactPhase.UNLOADED:
            self._level = max(0.0, self._level - dt / settings.ramp_time)
            if needed:
                self._enter(ContactPhase.SENSED)
            elif self._level <= 0.0:
                self.release(palm=palm, home=home)
        else:
            self._level = min(1.0, self._level + dt / self._pace.ramp_time)
            if phase == ContactPhase.SENSED and self._level >= 1.0:
                self._enter(ContactPhase.LOADED)
            elif phase == ContactPhase.LOADED and quiet:
                self._enter(ContactPhase.QUIET)
            elif phase == ContactPhase.QUIET:
                if not quiet:
                    self._enter(ContactPhase.LOADED)
                elif self._clock >= settings.quiet_time:
                    self._enter(ContactPhase.UNLOADED)
        if self.touching and self.phase != ContactPhase.UNLOADED:
            without = normal_force < 0.2 * settings.sensed_force and wanted_force > 1.0
            self._unloaded_clock = self._unloaded_clock + dt if without else 0.0
            if self._unloaded_clock > LOST_TIME:
                self._descend_again(palm)
        return None

    def _approach(
        self, dt: float, *, palm: Vector, palm_velocity: Vector, normal_force: float, needed: bool, home: Vector
    ) -> str | None:
        settings = self._settings
        assert self.patch is not None
        assert self._path is not None
        if not needed and self._clock > 0.5:
            self.release(palm=palm, home=home)
            return None
        sensed = normal_force > settings.sensed_force and (self._descent >= 0.0 or self.hurried)
        urgent = self._urgent if self.hurried else None
        if sensed or (urgent is not None and urgent.stopped(palm, palm_velocity, elapsed=self._clock)):
            self._touched = palm.copy()
            self._level, self._unloaded_clock = 0.0, 0.0
            self._enter(ContactPhase.SENSED)
            return None
        if self._descent < 0.0:
            self._sigma = min(1.0, self._sigma + self._rate * dt)
            if self._sigma >= 1.0:
                if length(palm - self._path.end) < self._pace.arrived:
                    self._descent = 0.0
                elif self._clock > self._duration + PATIENCE:
                    return "unreached"
            return None
        depth = self._pace.clearance + settings.search_depth
        if self._descent >= depth:
            return "missing"
        self._descent = min(depth, self._descent + self._pace.touch_speed * dt)
        return None

    def _descend_again(self, palm: Vector) -> None:
        assert self.patch is not None
        self._pace = Pace.of(self._settings, self._urgency)
        start = palm + 0.3 * self._pace.clearance * self.patch.normal
        self._path = HandPath(start=start, end=start, away=self.patch.normal)
        self._descent, self._level, self._unloaded_clock = 0.0, 0.0, 0.0
        self._enter(ContactPhase.APPROACHING)

    def _enter(self, phase: ContactPhase) -> None:
        self.phase, self._clock = phase, 0.0
