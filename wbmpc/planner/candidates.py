"""The candidate contacts: which hand could reach which patch from here, and what stage 3 makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.candidate_reports import FALLS_SHORT, NO_COST, Reach, Weighed, friction_margin, weigh
from wbmpc.planner.contact_choice import Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contact_stage import make_contact_choice
from wbmpc.planner.keep_out import KeepOut
from wbmpc.planner.pace import hurried, way_time
from wbmpc.planner.posture import PalmTarget, Posture
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.robot import Robot
from wbmpc.rotations import length, plane_rotation
from wbmpc.scenario import PatchPose
from wbmpc.signals import SIDES, CandidateReport, SolveStatus, StageReport, Vector

COM_COST = 4.0  # [cost / m²] how hard a candidate's posture keeps its CoM over the feet
SEARCH_ITERATIONS = 12  # a plan, of a posture that is not settled
ELBOW_TOLERANCE = 0.015  # [m] of its posture's elbow under the clearance: the forearm would meet the surface
MOST_TRIES = 2  # of a palm to get to a patch
COM_TOLERANCE = 0.004  # [m] how far outside the ZMP bounds a candidate's posture may have its CoM


@dataclass(slots=True, eq=False)
class Candidate:
    """One hand on one patch."""

    patch: PatchPose
    hand: int
    posture: Posture
    target: PalmTarget  # of the palm that rests on the patch
    excluded: str = ""  # why it is not to be chosen, "" when it may be
    tries: int = 0  # how often the palm did not get there
    current: bool = False  # its posture has been iterated for the feet as they stand

    @property
    def settled(self) -> bool:
        """Whether its posture says if it is in reach."""
        return self.current and self.posture.settled

    def gave_up(self, outcome: str) -> None:
        """Its contact was not made: `outcome` is `HandContact.advance`'s.

        From elsewhere a palm may find a way to the patch; where there is nothing it will find nothing.
        """
        self.tries += 1
        if outcome == "missing" or self.tries >= MOST_TRIES:
            self.excluded = "tried before, in vain"


class Candidates:
    """Keeps the candidates' postures current, one a plan in turn, and runs stage 3 over the reachable ones.

    A candidate is reachable when a posture exists that has its palm on the patch and the CoM over the feet: the contact
    must be made before it can help.
    """

    def __init__(
        self,
        robot: Robot,
        patches: tuple[PatchPose, ...],
        settings: ContactSettings,
        *,
        keep_out: KeepOut,
        nominal: Vector,
        backend: str,
    ) -> None:
        self._robot, self._settings, self._keep_out = robot, settings, keep_out
        targets = [PalmTarget(p.position + robot.palm_radius * p.normal, p.normal) for p in patches]
        kinematics = Kinematics(robot)
        self.all = [
            Candidate(patch, hand, Posture(kinematics, nominal=nominal, com_cost=COM_COST), target)
            for patch, target in zip(patches, targets, strict=True)
            for hand in range(len(SIDES))
        ]
        self._places = {(c.patch.name, c.hand): c for c in self.all}
        self._turn = -1
        self._stand: tuple[bytes, ...] = ()  # where the feet were at the last refresh
        self._at_rest: list[Candidate] | None = None  # those used, when with them all that could be done is done
        self._left = np.array([0.0, 1.0])  # unit, to the robot's left
        self._slots = min(len(self.all), settings.most_candidates)
        room = max(self._slots, len(SIDES))  # for contacts that are held, however few candidates are considered
        self._choice = make_contact_choice(backend, room, settings, mass=robot.mass) if self.all else None

    def refresh(
        self,
        *,
        soles: Vector,
        yaws: Vector,
        centre: Vector,
        iterations: int,
        used: list[Candidate],
        everyone: bool = False,
    ) -> None:
        """Improve the postures of those `used` and of the next in turn, or of all, for feet at `soles`, `yaws`."""
        if not self.all:
            return
        stand = (soles.tobytes(), yaws.tobytes(), centre.tobytes())
        if stand == self._stand and self._at_rest == used:
            return
        self._at_rest = None
        if stand != self._stand:
            self._stand = stand
            for candidate in self.all:
                candidate.current = False
            self._left = plane_rotation(float(np.mean(yaws)))[:, 1].copy()
        turn = self.all if everyone else used
        if not everyone and (following := self._following()) not in used:
            turn = [*used, following]
        for candidate in turn:
            palms = [candidate.target if hand == candidate.hand else None for hand in range(len(SIDES))]
            count = iterations if candidate.settled else max(iterations, SEARCH_ITERATIONS)
            candidate.posture.iterate(count, soles=soles, yaws=yaws, palms=palms, centre=centre)
            candidate.current = True
        self._at_rest = used if self.settled and all(candidate.posture.finished for candidate in turn) else None

    def of(self, patch: PatchPose | None, hand: int) -> Candidate:
        """The candidate of a hand on a patch."""
        assert patch is not None
        return self._places[patch.name, hand]

    def forbid(self, patch: str) -> None:
        """Never choose the patch of this name from now on; a hand that is on its way there, or there, is left alone."""
        for candidate in self.all:
            if candidate.patch.name == patch:
                candidate.excluded = "forbidden"

    @property
    def settled(self) -> bool:
        """Whether all postures say if their candidate is in reach, from where the feet are."""
        return self._at_rest is not None or all(candidate.settled for candidate in self.all)

    def _following(self) -> Candidate:
        """The next candidate whose posture is not settled yet, or the same again."""
        for _ in self.all:
            self._turn = (self._turn + 1) % len(self.all)
            if not self.all[self._turn].settled:
                break
        return self.all[self._turn]

    def reach(self, candidate: Candidate, polygon: SupportPolygon) -> Reach:
        """Reach margin: used up when the palm falls short, the forearm meets something or the CoM strays."""
        posture = candidate.posture
        margins = {
            "palm": self._settings.reach_margin - posture.residual,
            "elbow": ELBOW_TOLERANCE - posture.elbow_excess,
            "obstacle": self._keep_out.forearm_gap(*posture.forearm(candidate.hand)),
            "CoM": COM_TOLERANCE - polygon.excess(posture.com),
        }
        limit = min(margins, key=lambda name: margins[name])
        return Reach(float(margins[limit]), limit)

    def choose(
        self,
        need: Need,
        *,
        palms: Vector,
        engaged: list[str],
        held: list[Option],
        polygon: SupportPolygon,
        urgency: float,
    ) -> tuple[list[Candidate], tuple[CandidateReport, ...], StageReport]:
        """Stage 3 for a need of KNOTS knots.

        Args:
            palms: (2, 3) where the palms are [m]: closer patches are cheaper.
            engaged: why a hand can take no contact, "" for one that may.
            held: contacts taken before, which keep their share of the load.
            polygon: where the CoM may be before a new contact carries load.
            urgency: 0 … 1, the alarm: a hand that would come too late is out of the question.

        Returns:
            The candidates to take (none: none can help), a report on every candidate, and the MIQP's own report.
        """
        if self._choice is None:
            return [], (), StageReport(SolveStatus.INFEASIBLE, 0.0, 0)
        reaches = {id(c): self.reach(c, polygon) for c in self.all}
        distances, reasons = self._sort_out(reaches, palms=palms, engaged=engaged, held=held, urgency=urgency)
        considered = [c for c in self.all if id(c) not in reasons]
        considered.sort(key=lambda candidate: distances[id(candidate)])
        room = self._slots - len(held)
        for candidate in considered[room:]:
            reasons[id(candidate)] = f"beyond the {room} nearest"
        considered = considered[:room]
        options = [Option(c.patch, c.hand, self._settings.distance_cost * distances[id(c)]) for c in considered]
        winners: list[Candidate] = []
        best, stage = np.inf, StageReport(SolveStatus.INFEASIBLE, 0.0, 0)
        if options:
            choice = self._choice.solve(need, [*held, *options], left=self._left)
            stage = StageReport(choice.solution.status, choice.solution.solve_time, choice.solution.iterations)
            winners, best = [considered[i - len(held)] for i in choice.winners], choice.objective
        weighed = self._weigh(need, considered, options, winners=winners, held=held)
        reports = []
        for candidate in self.all:
            key, patch = id(candidate), candidate.patch
            seen = weighed.get(key, Weighed(np.inf, NO_COST, np.zeros((len(need.zmp), 3)), (), ""))
            reports.append(
                CandidateReport(
                    patch=patch.name,
                    hand=candidate.hand,
                    chosen=any(w is candidate for w in winners),
                    cost=seen.cost,
                    way_cost=seen.parts.way,
                    force_cost=seen.parts.force,
                    shift_cost=seen.parts.shift,
                    beside=tuple(option.patch.name for option in seen.beside),
                    palm=candidate.target.position,
                    reach_slack=reaches[key].slack,
                    reach_limit=reaches[key].limit,
                    friction_margin=friction_margin(patch, seen.forces) if np.isfinite(seen.cost) else float("nan"),
                    forces=seen.forces,
                    reason=reasons.get(key) or _reason(candidate, seen, best=best, winners=winners),
                )
            )
        return winners, tuple(reports), stage

    def carry(self, need: Need, contacts: list[Option]) -> float:
        """Stage 3's objective with these contacts and no other; inf when they cannot give what is needed."""
        if self._choice is None or not contacts:
            return np.inf
        return self._choice.costs(need, contacts, [tuple(range(len(contacts)))], left=self._left)[0][0]

    def _sort_out(
        self,
        reaches: dict[int, Reach],
        *,
        palms: Vector,
        engaged: list[str],
        held: list[Option],
        urgency: float,
    ) -> tuple[dict[int, float], dict[int, str]]:
        """Way of the palm to each candidate [m], and why some are out of the question; both by id of the candidate."""
        distances: dict[int, float] = {}
        reasons: dict[int, str] = {}
        for candidate in self.all:
            key, reach = id(candidate), reaches[id(candidate)]
            distances[key] = length(candidate.target.position - palms[candidate.hand])
            takers = [option.hand for option in held if option.patch.name == candidate.patch.name]
            if candidate.hand in takers:
                reasons[key] = "held already"
            elif takers:
                reasons[key] = "patch is in use"
            elif engaged[candidate.hand]:
                reasons[key] = engaged[candidate.hand]
            elif candidate.excluded:
                reasons[key] = candidate.excluded
            elif reach.slack < 0.0:
                reasons[key] = f"unreachable by {-100.0 * reach.slack:.1f} cm: {FALLS_SHORT[reach.limit]}"
            elif (
                hurried(urgency)
                and (late := way_time(self._settings, distances[key]) - self._settings.urgent_time) > 0.0
            ):
                reasons[key] = f"there {1e3 * late:.0f} ms too late"
        return distances, reasons

    def _weigh(
        self,
        need: Need,
        considered: list[Candidate],
        options: list[Option],
        *,
        winners: list[Candidate],
        held: list[Option],
    ) -> dict[int, Weighed]:
        """Each candidate beside those it would have as company, by its id.

        Company is what is held, and the other hand's winner, unless the candidate could take the single winner's place,
        whichever hand that has.
        """
        if self._choice is None or not considered:
            return {}
        place = {id(candidate): len(held) + i for i, candidate in enumerate(considered)}
        full = len(winners) + len(held) >= self._settings.most_contacts
        sets = []
        for candidate in considered:
            beside = [place[id(w)] for w in winners if full and w is not candidate and w.hand != candidate.hand]
            sets.append((place[id(candidate)], *range(len(held)), *beside))
        answers = weigh(
            *(self._choice, need, [*held, *options], sets),
            left=self._left,
            settings=self._settings,
            mass=self._robot.mass,
        )
        return {id(candidate): answer for candidate, answer in zip(considered, answers, strict=True)}


def _reason(candidate: Candidate, seen: Weighed, *, best: float, winners: list[Candidate]) -> str:
    """Why a candidate that stage 3 weighed won or lost."""
    if any(winner is candidate for winner in winners):
        return "chosen" if len(winners) == 1 else "chosen, with another"
    if any(winner.patch is candidate.patch for winner in winners):
        return "patch is taken by the other hand"
    return seen.hindrance or f"cost {seen.cost - best:.3g} above the best"
