"""What the tasks ask over the horizon: palm paths, CoM heights, and the posture that a reach needs."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.contacts import Contacts
from wbmpc.planner.posture import Posture
from wbmpc.planner.reach import Reach, ReachPhase
from wbmpc.robot import Robot
from wbmpc.scenario import ComHeightTask, ReachTask, Task
from wbmpc.signals import SIDES, HandMode, Vector

REACH_FLOOR = 0.12  # [m] smallest d: a hand never pins the CoM to itself
UNBOUNDED = 0.3  # [m] d of a hand without a reference
COM_COST = 3.0  # [cost / m²] how hard a reach's posture keeps its CoM over the feet
SHRINK_RATE, SHRINK_LIMIT = 1.0, 0.02  # [1/s], [m] how a held hand that stays short tightens its d


class References:
    """Tasks and contacts as references of the stages, at the tasks' own pace or at full pace.

    The *gated* references go on at each reach's present rate: that is what gets executed. The ones at *full pace* show
    what the task would need if nothing held it up: that is what the need for a contact is judged by.
    """

    def __init__(
        self, robot: Robot, tasks: tuple[Task, ...], *, q: Vector, palms: Vector, height: float, times: Vector
    ) -> None:
        """Start with palms at `palms` (2, 3) [m] and the CoM at `height` [m]; `times` (N,) are the knots [s]."""
        self._times, self._nominal, self._nominal_height = times, q, height
        self.reaches = [
            Reach(task, side=_hand_of(task, palms), palm=palms[_hand_of(task, palms)])
            for task in tasks
            if isinstance(task, ReachTask)
        ]
        self._heights = [task for task in tasks if isinstance(task, ComHeightTask)]
        self._goal = Posture(robot, nominal=q, com_cost=COM_COST)
        self._shrink = 0.0  # [m] taken off d

    # ------------------------------------------------------------------ once a plan

    def advance(self, time: float, dt: float, *, gate_open: bool, palms: Vector, events: list[str]) -> None:
        """Every task one plan further; `palms` (2, 3) are measured [m]."""
        for reach in self.reaches:
            before, palm = reach.phase, palms[reach.side]
            reach.advance(time, dt, gate_open=gate_open, palm=palm)
            if reach.phase != before:
                events.append(f"reach {SIDES[reach.side]}: {before.name.lower()} -> {reach.phase.name.lower()}")
            if reach.phase == ReachPhase.HOLD:
                short = float(np.linalg.norm(palm - reach.target)) - 0.5 * reach.task.tolerance
                self._shrink = min(max(self._shrink + SHRINK_RATE * dt * short, 0.0), SHRINK_LIMIT)

    def update_goal(self, contacts: Contacts, *, soles: Vector, yaws: Vector, centre: Vector, iterations: int) -> None:
        """Improve the posture with the palm at the reach's target and the bracing palm on its patch."""
        palms: list[Vector | None] = [c.goal for c in contacts.hands]
        for reach in self.reaches:
            if reach.phase != ReachPhase.DONE:
                palms[reach.side] = reach.target
        if any(palm is not None for palm in palms):
            self._goal.iterate(iterations, soles=soles, yaws=yaws, palms=palms, centre=centre)

    # ------------------------------------------------------------------ over the horizon

    def palms(self, time: float, contacts: Contacts, *, full_pace: bool) -> tuple[Vector, Vector]:
        """Palm references (2, N, 3) [m], nan for a free hand, and the furthest reach's σ (N,)."""
        times = self._times
        references = np.full((len(SIDES), len(times), 3), np.nan)
        sigma = np.zeros(len(times))
        for contact in contacts.hands:
            if contact.goal is not None:
                references[contact.side] = contact.preview(times)
        for reach in self.reaches:
            if reach.phase != ReachPhase.DONE:
                rate = 1.0 if full_pace else reach.rate
                references[reach.side] = reach.preview(time, times, rate=rate)
                sigma = np.maximum(sigma, reach.sigmas(time, times, rate=rate))
        return references, sigma

    def wanted_height(self, time: float, sigma: Vector) -> Vector:
        """CoM height (N,) to stay near [m]: a height task's profile, else the reach's posture by its progress."""
        wanted = np.full(len(self._times), self._nominal_height)
        if self.reaches:
            wanted += sigma * (self._goal.com[2] - self._nominal_height)
        for task in self._heights:
            knots = [0.0] + [w.time for w in task.waypoints]
            heights = [self._nominal_height] + [w.height for w in task.waypoints]
            wanted = np.interp(time + self._times, knots, heights)
        return wanted

    def reach_distance(self, contacts: Contacts) -> Vector:
        """d (2, 2) per hand and axis [m]: what lies between palm and CoM in the posture that the reach needs.

        The paper takes d as a constant of the robot; the posture makes it the constant of this target and this stance.
        """
        distance = np.full((len(SIDES), 2), UNBOUNDED)
        for contact in contacts.hands:
            if contact.goal is not None:
                distance[contact.side] = np.abs(contact.goal[:2] - contacts.approach_com(contact.side)[:2])
                if self.reaches:
                    with_reach = np.abs(contact.goal[:2] - self._goal.com[:2])
                    distance[contact.side] = np.maximum(distance[contact.side], with_reach)
        for reach in self.reaches:
            if reach.phase != ReachPhase.DONE:
                distance[reach.side] = np.abs(reach.target[:2] - self._goal.com[:2]) - self._shrink
        return np.maximum(distance, REACH_FLOOR)

    # ------------------------------------------------------------------ now

    def posture(self) -> Vector:
        """Joint angles (nj,) that the joint reference is drawn to: standing, or the reach's posture by its progress."""
        sigma = max((r.sigma for r in self.reaches), default=0.0)
        return self._nominal[7:] + sigma * (self._goal.q[7:] - self._nominal[7:])

    def torso_up(self) -> Vector:
        """Where the torso's own vertical should point (3,), in world: up, or as in the reach's posture."""
        sigma = max((r.sigma for r in self.reaches), default=0.0)
        up = np.array([0.0, 0.0, 1.0])
        return up + sigma * (self._goal.torso_up - up) if sigma > 0.0 else up

    def torso_heading(self, feet: float) -> float:
        """Yaw of the torso [rad]: the feet's, `feet`, or as in the reach's posture."""
        sigma = max((r.sigma for r in self.reaches), default=0.0)
        return feet + sigma * (self._goal.torso_heading - feet)

    def hands_taken(self) -> list[bool]:
        """Which hands belong to a task (left, right), now or later."""
        taken = [r.side for r in self.reaches if r.phase != ReachPhase.DONE]
        return [side in taken for side in range(len(SIDES))]

    def hand_targets(self, contacts: Contacts, palms: Vector) -> list[tuple[Vector, Vector, HandMode]]:
        """Position (3,) [m], velocity (3,) [m/s] and mode of each hand; a free hand is where it is, `palms` (2, 3)."""
        targets = []
        for contact in contacts.hands:
            side = contact.side
            target = (palms[side], np.zeros(3), HandMode.FREE)
            if contact.busy:
                target = (*contact.reference()[:2], contact.mode)
            for reach in self.reaches:
                if reach.side == side and reach.active:
                    target = (*reach.reference()[:2], HandMode.MOVE)
            targets.append(target)
        return targets

    @property
    def goal_com(self) -> Vector | None:
        """CoM (3,) [m] where the running reach ends; None when none is on its way or holding."""
        running = any(r.phase in (ReachPhase.WAIT, ReachPhase.GO, ReachPhase.HOLD) for r in self.reaches)
        return self._goal.com if running else None

    @property
    def progress(self) -> float:
        """Rate of the slowest reach's clock, 0 … 1."""
        return min((r.rate for r in self.reaches), default=1.0)


def _hand_of(task: ReachTask, palms: Vector) -> int:
    """The hand a reach takes: the one it names, or the one nearer to the target (left when equal)."""
    if task.hand != "auto":
        return SIDES.index(task.hand)
    return int(np.argmin(np.linalg.norm(palms - np.array(task.target), axis=1)))
