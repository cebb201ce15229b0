"""Both hands' contacts: when one is needed, which one is taken, what forces they carry."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.candidates import Candidate, Candidates
from wbmpc.planner.contact_choice import Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contact_stage import make_force_stage
from wbmpc.planner.firing import Asked, fire, worst_knots
from wbmpc.planner.hand_contact import HandContact
from wbmpc.planner.keep_out import KeepOut
from wbmpc.planner.pace import hurried
from wbmpc.planner.posture import Posture
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose
from wbmpc.signals import SIDES, ContactPhase, Firing, SolveStatus, StageReport, Vector

RETRY_PLANS = 10  # plans between two looks at whether the contacts there are do, and two firings of stage 3
TOGETHER_COST = 15.0  # [cost / m²] how hard the posture with both hands on their patches keeps its CoM over the feet
SETTLE_TIME = 1.0  # [s] given to the candidates' postures, when the feet have moved, before one is chosen
GIVE_UP_TIME = 2.0  # [s] without a helpful candidate after which the task goes on without a contact
CARRYING = (ContactPhase.LOADED, ContactPhase.QUIET)
NOT_RUN = StageReport(SolveStatus.NOT_RUN, 0.0, 0)


class Contacts:
    """The hands' contacts and stage 3 around them."""

    def __init__(
        self,
        robot: Robot,
        settings: PlannerSettings,
        patches: tuple[PatchPose, ...],
        *,
        keep_out: KeepOut,
        nominal: Vector,
        times: Vector,
        period: float,
    ) -> None:
        """`nominal` (nq,): standing posture; `times` (N,): the knots after a snapshot; `period` between plans [s]."""
        contact = settings.contact
        self._settings, self._times, self._period = contact, times, period
        self.hands = [HandContact(side, contact, palm_radius=robot.palm_radius) for side in range(len(SIDES))]
        self.candidates = Candidates(
            robot, patches, contact, keep_out=keep_out, nominal=nominal, backend=settings.miqp_backend
        )
        self._force_stage = make_force_stage(settings, mass=robot.mass, steps=len(times), contacts=len(SIDES))
        self._together = Posture(Kinematics(robot), nominal=nominal, com_cost=TOGETHER_COST)
        self.forces = np.zeros((len(SIDES), len(times), 3))  # [N] planned, in world
        self._needed, self._quiet = False, True  # of the shift as a whole
        self._short = False  # the contacts there are cannot give it
        self._spare: int | None = None  # side of the contact that the other hand's can do without
        self._spent: tuple[int, ...] = ()  # sides of contacts out of reach of what comes next
        self._hopeless = 0.0  # [s] that no candidate has been able to help
        self._since_review = RETRY_PLANS
        self._waited = 0.0  # [s] for the candidates' postures
        self.used: list[Candidate] = []  # the candidates that the hands have taken, those being given up left out
        self._palm_velocities = np.zeros((len(SIDES), 3))  # [m/s] measured at the last plan
        self._urgency = 0.0  # 0 … 1, at the last plan

    # ------------------------------------------------------------------ what others may ask

    @property
    def gate_open(self) -> bool:
        """Whether tasks may go on: no contact is needed, or those there are do and carry load, or none can help."""
        if not self._needed or not self.candidates.all:
            return True
        awaited = any(c.busy and c.expected for c in self.hands)
        carried = any(c.phase in CARRYING for c in self.hands)
        answered = carried and not self._short and self._known
        return not awaited and (self._hopeless >= GIVE_UP_TIME or answered)

    @property
    def _known(self) -> bool:
        """Whether the candidates' postures say what is in reach, or have had their time."""
        return not 0.0 < self._waited <= SETTLE_TIME or hurried(self._urgency)

    @property
    def leaving(self) -> bool:
        """Whether a contact is being given up: a foot that lifts now would need it, or trip over it."""
        return any(c.phase in (ContactPhase.QUIET, ContactPhase.UNLOADED) for c in self.hands)

    @property
    def points(self) -> list[Vector | None]:
        """Where each hand's contact force acts (3,) in world [m]; None without a contact."""
        return [grip.position if grip else None for grip in (c.grip for c in self.hands)]

    def name(self, side: int) -> str:
        """The patch of a hand's contact, "" when none."""
        patch = self.hands[side].patch
        return patch.name if patch else ""

    @property
    def posture(self) -> Posture | None:
        """The posture that has every hand with a contact on its patch and the CoM over the feet; None without one."""
        used = self.used
        return used[0].posture if len(used) == 1 else self._together if used else None

    def _look_at_hands(self) -> None:
        self.used = [self.candidates.of(c.patch, c.side) for c in self.hands if c.has_goal]

    # ------------------------------------------------------------------ one plan

    def improve_postures(
        self, *, soles: Vector, yaws: Vector, centre: Vector, iterations: int, everyone: bool = False
    ) -> None:
        """Iterate the next candidate's posture (or everyone's) and the one with both hands on their patches.

        Args:
            soles, yaws: of the feet, (2, 3) [m] and (2,) [rad].
            centre: (2,) where the CoM should rather be [m].
        """
        self.candidates.refresh(
            soles=soles, yaws=yaws, centre=centre, iterations=iterations, used=self.used, everyone=everyone
        )
        if len(self.used) == len(SIDES):
            palms = [c.target for c in self.hands]
            self._together.iterate(iterations, soles=soles, yaws=yaws, palms=palms, centre=centre)

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
        self._palm_velocities, self._urgency = palm_velocities, urgency
        for contact in self.hands:
            side, before, patch = contact.side, contact.phase, self.name(contact.side)
            outcome = contact.advance(
                dt,
                palm=palms[side],
                palm_velocity=palm_velocities[side],
                force=palm_forces[side],
                wanted_force=float(self.forces[side, 0] @ contact.patch.normal) if contact.patch else 0.0,
                needed=self._needed and side != self._spare and side not in self._spent,
                quiet=self._quiet or side == self._spare or side in self._spent,
                urgency=urgency,
                home=homes[side],
            )
            if outcome is not None:
                candidate = self.candidates.of(contact.patch, side)
                candidate.gave_up(outcome)
                self._short = True  # what it was chosen for is still asked for
                events.append(f"contact {SIDES[side]} {patch}: {outcome}{', excluded' if candidate.excluded else ''}")
                contact.release(palm=palms[side], home=homes[side])
            if contact.phase != before:
                events.append(f"contact {SIDES[side]} {patch}: {before.name.lower()} -> {contact.phase.name.lower()}")
        self._look_at_hands()

    def plan(
        self,
        time: float,
        need: Need,
        *,
        goal: Need | None,
        binding: bool,
        palms: Vector,
        hand_taken: list[bool],
        polygon: SupportPolygon,
        spent: tuple[int, ...],
        events: list[str],
    ) -> tuple[Firing | None, StageReport]:
        """Judge the need, choose contacts when those there are do not do, and plan the forces of those that touch.

        Args:
            time: now [s].
            goal: the need, of one knot, where the running task ends, maybe beyond the horizon; None without a task.
            binding: whether there is no way back before that end (a foot in the air): it is waited for from the start.
            palms: (2, 3) measured [m].
            hand_taken: hands that a task uses.
            polygon: where the CoM may be before a contact carries load.
            spent: sides of contacts that the task's end leaves out of reach: they make room for others.

        Returns:
            What stage 3 was asked and made of it when it fired (else None), and stage 3's own report.
        """
        self._spent = spent
        shift = float(np.abs(need.delta_z).max())
        if binding and goal is not None:
            shift = max(shift, float(np.abs(goal.delta_z).max()))
        self._needed = shift > self._settings.need_threshold
        self._quiet = shift < self._settings.quiet_threshold
        self._since_review += 1
        firing: Firing | None = None
        stage = NOT_RUN
        engaged = [
            "hand has a contact" if c.busy else "hand is the task's" if taken else ""
            for c, taken in zip(self.hands, hand_taken, strict=True)
        ]
        free = [not why for why in engaged]
        if not self._needed:
            self._hopeless, self._waited, self._spare, self._short = 0.0, 0.0, None, False
        elif self.candidates.all:
            self._waited = 0.0 if self.candidates.settled else self._waited + self._period
            if self._known and self._since_review >= RETRY_PLANS and (any(free) or len(self._committed) > 1):
                self._since_review = 0
                asked = worst_knots(need, goal, times=self._times, threshold=self._settings.need_threshold)
                self._review(asked.need)
                if self._short and any(free) and self._hopeless < GIVE_UP_TIME:
                    firing, stage = self._fire(
                        time, asked, palms=palms, engaged=engaged, polygon=polygon, events=events
                    )
            returning = any(c.phase == ContactPhase.RELEASED for c in self.hands)  # a hand that is back may be of help
            if (not self._committed or self._short) and not returning:
                self._hopeless += self._period
            elif self._hopeless < GIVE_UP_TIME:
                self._hopeless = 0.0
        for contact in self.hands:
            contact.need(self._short and free[contact.side] and self._hopeless < GIVE_UP_TIME)
        force_stage = self._plan_forces(need)
        return firing, force_stage if stage is NOT_RUN else stage

    @property
    def _committed(self) -> list[HandContact]:
        """The contacts that are there or on their way, those that are being released left out."""
        leaving = (ContactPhase.UNLOADED, ContactPhase.RELEASED)
        return [c for c in self.hands if c.busy and c.phase not in leaving and c.side not in self._spent]

    def _review(self, knots: Need) -> None:
        """Whether the committed contacts fall short of the need, and which of two the other can do without.

        One contact joins, or leaves, when the feet's pressure under the others' forces, caps and cones included, would
        be outside its polygon, or inside, by the threshold: the same problem as the choice, with H given.
        """
        threshold, committed = self._settings.need_threshold, self._committed
        held = _options(committed)
        self._short = not np.isfinite(self.candidates.carry(knots.inset(-threshold), held))
        before, self._spare = self._spare, None
        if len(committed) > 1 and not self._short and all(c.phase in CARRYING for c in committed):
            alone = {
                c.side: self.candidates.carry(knots.inset(threshold), [o]) for c, o in zip(committed, held, strict=True)
            }
            spare = [side for side in alone if np.isfinite(alone[1 - side])]
            if spare:  # once one is on its way out it stays that one
                self._spare = before if before in spare else min(spare, key=lambda side: alone[1 - side])

    def _fire(
        self,
        time: float,
        asked: Asked,
        *,
        palms: Vector,
        engaged: list[str],
        polygon: SupportPolygon,
        events: list[str],
    ) -> tuple[Firing, StageReport]:
        """Stage 3's choice of what joins the committed contacts, and these chosen."""
        winners, firing, stage = fire(
            *(self.candidates, asked),
            time=time,
            palms=palms,
            engaged=engaged,
            held=_options(self._committed),
            polygon=polygon,
            urgency=self._urgency,
            events=events,
        )
        for winner in winners:
            self.hands[winner.hand].choose(
                winner.patch, palm=palms[winner.hand], palm_velocity=self._palm_velocities[winner.hand]
            )
            self._hopeless, self._short = 0.0, False
        self._look_at_hands()
        return firing, stage

    def _plan_forces(self, need: Need) -> StageReport:
        """Forces at every knot for the contacts that touch; a failed solve keeps the last ones."""
        caps = np.zeros(self.forces.shape[:2])
        for contact in self.hands:
            if contact.touching:
                caps[contact.side] = contact.caps(self._times)
        if not caps.any():
            self.forces = np.zeros_like(self.forces)
            return NOT_RUN
        begin = perf_counter()
        forces, solution = self._force_stage.solve(need, [c.grip for c in self.hands], caps)
        if forces is not None:
            self.forces = forces
        return StageReport(solution.status, perf_counter() - begin, solution.iterations)


def _options(contacts: list[HandContact]) -> list[Option]:
    """Contacts as stage 3 knows them: their prices are paid."""
    return [Option(grip, c.side, held=True) for c in contacts if (grip := c.grip) is not None]
