"""The candidate contacts: which hand could reach which patch from here, and what stage 3 makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.planner.contact_force import ContactChoice, Need
from wbmpc.planner.posture import Posture
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.robot import Robot
from wbmpc.scenario import PatchPose
from wbmpc.signals import SIDES, CandidateReport, SolveStatus, StageReport, Vector

COM_COST = 4.0  # [cost / m²] how hard a candidate's posture keeps its CoM over the feet
COM_TOLERANCE = 0.004  # [m] how far outside the ZMP bounds a candidate's posture may have its CoM


@dataclass(slots=True)
class Candidate:
    """One hand on one patch."""

    patch: PatchPose
    hand: int
    posture: Posture
    excluded: bool = False  # it was chosen before and the contact did not appear

    def goal(self, palm_radius: float) -> Vector:
        """Palm centre (3,) when it rests on the patch [m]."""
        return self.patch.position + palm_radius * self.patch.normal


class Candidates:
    """Keeps the candidates' postures current, one a plan in turn, and runs stage 3 over the reachable ones.

    A candidate is reachable when a posture exists that has its palm on the patch and the CoM over the feet: the contact
    must be made before it can help.
    """

    def __init__(
        self, robot: Robot, patches: tuple[PatchPose, ...], settings: ContactSettings, *, nominal: Vector, backend: str
    ) -> None:
        self._robot, self._settings = robot, settings
        self.all = [
            Candidate(patch, hand, Posture(robot, nominal=nominal, com_cost=COM_COST))
            for patch in patches
            for hand in range(len(SIDES))
        ]
        self._turn = 0
        self._backend = backend
        slots = min(len(self.all), settings.most_candidates)
        self._choice = ContactChoice(slots, settings, mass=robot.mass, backend=backend) if slots else None
        self._single = ContactChoice(1, settings, mass=robot.mass, backend="daqp") if slots else None
        self._slots = slots

    def refresh(self, *, soles: Vector, yaws: Vector, centre: Vector, iterations: int, everyone: bool = False) -> None:
        """Improve the posture of the next candidate in turn, or of all, for feet at `soles` (2, 3), `yaws` (2,)."""
        if not self.all:
            return
        turn = self.all if everyone else [self.all[self._turn % len(self.all)]]
        self._turn += 1
        for candidate in turn:
            palms: list[Vector | None] = [None, None]
            palms[candidate.hand] = candidate.goal(self._robot.palm_radius)
            candidate.posture.iterate(iterations, soles=soles, yaws=yaws, palms=palms, centre=centre)

    def reach_slack(self, candidate: Candidate, polygon: SupportPolygon) -> float:
        """Reach margin [m]: negative when the palm falls short, or the CoM would have to leave the ZMP's bounds."""
        palm = self._settings.reach_margin - candidate.posture.residual
        com = COM_TOLERANCE - polygon.excess(candidate.posture.com)
        return min(palm, com)

    def choose(
        self, need: Need, *, palms: Vector, free_hands: list[bool], polygon: SupportPolygon
    ) -> tuple[Candidate | None, tuple[CandidateReport, ...], StageReport]:
        """Stage 3 for a need of ContactChoice.KNOTS knots.

        Args:
            palms: (2, 3) where the palms are [m]: closer patches are cheaper.
            free_hands: which hands may take a contact.
            polygon: where the CoM may be before the contact carries load.

        Returns:
            The winner (None: no candidate can help), a report on every candidate, and the MIQP's own report.
        """
        if self._choice is None or self._single is None:
            return None, (), StageReport(SolveStatus.INFEASIBLE, 0.0, 0)
        considered: list[tuple[Candidate, float, float]] = []
        reasons: dict[int, str] = {}
        for candidate in self.all:
            slack = self.reach_slack(candidate, polygon)
            distance = float(np.linalg.norm(candidate.goal(self._robot.palm_radius) - palms[candidate.hand]))
            if not free_hands[candidate.hand]:
                reasons[id(candidate)] = "hand is in use"
            elif candidate.excluded:
                reasons[id(candidate)] = "tried before, nothing was there"
            elif slack < 0.0:
                reasons[id(candidate)] = f"unreachable by {-100.0 * slack:.1f} cm"
            else:
                considered.append((candidate, distance, slack))
        considered.sort(key=lambda entry: entry[1])
        for candidate, _, _ in considered[self._slots :]:
            reasons[id(candidate)] = f"beyond the {self._slots} nearest"
        considered = considered[: self._slots]
        winner, stage, best = None, StageReport(SolveStatus.INFEASIBLE, 0.0, 0), np.inf
        costs: dict[int, tuple[float, Vector]] = {}
        if considered:
            prices = np.array([self._settings.distance_cost * distance for _, distance, _ in considered])
            choice = self._choice.solve(need, [c.patch for c, _, _ in considered], prices)
            stage = StageReport(choice.solution.status, choice.solution.solve_time, choice.solution.iterations)
            if choice.winner >= 0:
                winner = considered[choice.winner][0]
            for (candidate, _, _), price in zip(considered, prices, strict=True):
                alone = self._single.solve(need, [candidate.patch], np.array([price]))
                cost = self._single.problem.objective(alone.solution.x) if alone.winner >= 0 else np.inf
                costs[id(candidate)] = (cost, alone.forces[0, 0])
                if candidate is winner:
                    best = cost
        reports = []
        for candidate in self.all:
            cost, force = costs.get(id(candidate), (np.inf, np.zeros(3)))
            if candidate is winner:
                reason = "chosen"
            elif id(candidate) in reasons:
                reason = reasons[id(candidate)]
            elif np.isfinite(cost):
                reason = f"cost {cost - best:.3g} above the best"
            else:
                reason = "no force in its cone gives the shift"
            reports.append(
                CandidateReport(
                    patch=candidate.patch.name,
                    hand=candidate.hand,
                    chosen=candidate is winner,
                    cost=float(cost),
                    reach_slack=self.reach_slack(candidate, polygon),
                    friction_margin=_friction_margin(candidate.patch, force) if np.isfinite(cost) else float("nan"),
                    force=force,
                    reason=reason,
                )
            )
        return winner, tuple(reports), stage


def _friction_margin(patch: PatchPose, force: Vector) -> float:
    """μ f_n − |f_t| [N] of a force (3,) in world."""
    normal = float(force @ patch.normal)
    return patch.friction * normal - float(np.linalg.norm(force - normal * patch.normal))
