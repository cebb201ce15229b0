"""Both hands' contacts: when one is needed, which one is taken, what forces they carry."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbmpc.planner.candidates import Candidates
from wbmpc.planner.contact_force import ContactForce, Need
from wbmpc.planner.hand_contact import HandContact
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.zmp_model import need_at_rest
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SIDES, CandidateReport, ContactPhase, SolveStatus, StageReport, Vector

RETRY_PLANS = 10  # plans between two firings of stage 3 when no candidate can help
GIVE_UP_TIME = 2.0  # [s] without a helpful candidate after which the task goes on without a contact
NOT_RUN = StageReport(SolveStatus.NOT_RUN, 0.0, 0)


class Contacts:
    """The hands' contacts and stage 3 around them."""

    def __init__(
        self,
        robot: Robot,
        settings: PlannerSettings,
        patches: tuple[PatchPose, ...],
        *,
        nominal: Vector,
        times: Vector,
        period: float,
    ) -> None:
        """`nominal` (nq,): standing posture; `times` (N,): the knots after a snapshot; `period` between plans [s]."""
        contact = settings.contact
        self._settings, self._times, self._period = contact, times, period
        self.hands = [HandContact(side, contact, palm_radius=robot.palm_radius) for side in range(len(SIDES))]
        self.candidates = Candidates(robot, patches, contact, nominal=nominal, backend=settings.miqp_backend)
        self._force_stage = ContactForce(
            len(times), contact, mass=robot.mass, contacts=len(SIDES), backend=settings.qp_backend
        )
        self.forces = np.zeros((len(SIDES), len(times), 3))  # [N] planned, in world
        self._needed, self._quiet = False, True
        self._hopeless = 0.0  # [s] that no candidate has been able to help
        self._since_fired = RETRY_PLANS
        self._palm_velocities = np.zeros((len(SIDES), 3))  # [m/s] measured at the last plan

    # ------------------------------------------------------------------ what others may ask

    @property
    def gate_open(self) -> bool:
        """Whether tasks may go on: no contact is needed, or it carries its load, or none can help."""
        carried = any(c.phase in (ContactPhase.LOADED, ContactPhase.QUIET) for c in self.hands)
        return carried or not self._needed or self._hopeless >= GIVE_UP_TIME

    @property
    def points(self) -> list[Vector | None]:
        """Where each hand's contact force acts (3,) in world [m]; None without a contact."""
        return [c.patch.position if c.patch else None for c in self.hands]

    def name(self, side: int) -> str:
        """The patch of a hand's contact, "" when none."""
        patch = self.hands[side].patch
        return patch.name if patch else ""

    def approach_com(self, side: int) -> Vector:
        """CoM (3,) [m] of the posture that has this hand on its patch."""
        contact = self.hands[side]
        return next(c for c in self.candidates.all if c.patch is contact.patch and c.hand == side).posture.com

    # ------------------------------------------------------------------ one plan

    def advance(
        self,
        dt: float,
        *,
        palms: Vector,
        palm_velocities: Vector,
        palm_forces: Vector,
        homes: Vector,
        urgency: float,
        events: list[str],
    ) -> None:
        """Every contact's life one plan further, with measured palms (2, 3) [m, m/s] and forces (2, 3) [N].

        `urgency` 0 … 1 is the alarm that a push has sounded.
        """
        self._palm_velocities = palm_velocities
        for contact in self.hands:
            side, before, patch = contact.side, contact.phase, self.name(contact.side)
            outcome = contact.advance(
                dt,
                palm=palms[side],
                palm_velocity=palm_velocities[side],
                force=palm_forces[side],
                wanted_force=float(self.forces[side, 0] @ contact.patch.normal) if contact.patch else 0.0,
                needed=self._needed,
                quiet=self._quiet,
                urgency=urgency,
                home=homes[side],
            )
            if outcome == "failed":
                for candidate in self.candidates.all:
                    if candidate.patch is contact.patch and candidate.hand == side:
                        candidate.excluded = True
                events.append(f"contact {SIDES[side]} {patch}: not found, excluded")
                contact.release(palm=palms[side], home=homes[side])
            if contact.phase != before:
                events.append(f"contact {SIDES[side]} {patch}: {before.name.lower()} -> {contact.phase.name.lower()}")

    def plan(
        self,
        need: Need,
        *,
        goal: Vector | None,
        palms: Vector,
        hand_taken: list[bool],
        polygon: SupportPolygon,
        events: list[str],
    ) -> tuple[tuple[CandidateReport, ...], StageReport]:
        """Judge the need, choose a contact when one is missing, and plan the forces of those that touch.

        Args:
            goal: CoM (3,) where the running task ends, beyond the horizon [m]; None without such a task.
            palms: (2, 3) measured [m].
            hand_taken: hands that a task uses.
            polygon: where the CoM may be before a contact carries load.

        Returns:
            A report on every candidate when stage 3 fired (else empty), and stage 3's own report.
        """
        shift = float(np.abs(need.delta_z).max())
        self._needed = shift > self._settings.need_threshold
        self._quiet = shift < self._settings.quiet_threshold
        self._since_fired += 1
        reports: tuple[CandidateReport, ...] = ()
        stage = NOT_RUN
        if self.candidates.all and not any(c.busy and c.phase != ContactPhase.RELEASED for c in self.hands):
            free = [not c.busy and not taken for c, taken in zip(self.hands, hand_taken, strict=True)]
            if not self._needed:
                self._hopeless = 0.0
            elif self._since_fired >= RETRY_PLANS and any(free) and self._hopeless < GIVE_UP_TIME:
                reports, stage = self._fire(need, goal, palms=palms, free=free, polygon=polygon, events=events)
            if self._needed and not any(c.phase == ContactPhase.CHOSEN for c in self.hands):
                self._hopeless += self._period
            for contact in self.hands:
                contact.need(self._needed and free[contact.side] and self._hopeless < GIVE_UP_TIME)
        force_stage = self._plan_forces(need)
        return reports, force_stage if stage is NOT_RUN else stage

    def _fire(
        self,
        need: Need,
        goal: Vector | None,
        *,
        palms: Vector,
        free: list[bool],
        polygon: SupportPolygon,
        events: list[str],
    ) -> tuple[tuple[CandidateReport, ...], StageReport]:
        """Stage 3's choice, on two knots: the largest shift in the horizon, and the task's end or the largest sideways.

        At the first sign of need the horizon shows a few millimetres; the contact must also do for where this leads.
        """
        self._since_fired = 0
        sizes = np.abs(need.delta_z)
        worst = int(np.argmax(sizes.max(axis=1)))
        mass = float(need.weight[worst]) / GRAVITY
        final = None if goal is None else need_at_rest(goal, polygon=polygon, mass=mass)
        if final is not None and np.abs(final.delta_z).max() > self._settings.need_threshold:
            knots = need.pick([worst]).followed_by(final)
        else:
            knots = need.pick([worst, int(np.argmax(sizes[:, 1]))])
        winner, reports, stage = self.candidates.choose(knots, palms=palms, free_hands=free, polygon=polygon)
        answer = f"chose {winner.patch.name} for the {SIDES[winner.hand]} hand" if winner else "no candidate helps"
        events.append(f"stage 3 fired: |ΔZ| {1e3 * sizes.max():.1f} mm at knot {worst + 1}, {answer}")
        if winner:
            self.hands[winner.hand].choose(
                winner.patch, palm=palms[winner.hand], palm_velocity=self._palm_velocities[winner.hand]
            )
            self._hopeless = 0.0
        return reports, stage

    def _plan_forces(self, need: Need) -> StageReport:
        """Forces at every knot for the contacts that touch; a failed solve keeps the last ones."""
        caps = np.array([c.caps(self._times) for c in self.hands])
        if not caps.any():
            self.forces = np.zeros_like(self.forces)
            return NOT_RUN
        begin = perf_counter()
        forces, solution = self._force_stage.solve(need, [c.patch for c in self.hands], caps)
        if forces is not None:
            self.forces = forces
        return StageReport(solution.status, perf_counter() - begin, solution.iterations)
