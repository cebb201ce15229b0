"""What the tasks ask over the horizon: palm paths, CoM paths and heights, and the posture that a task needs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbmpc.jit import kernel
from wbmpc.kinematics import Kinematics
from wbmpc.planner.bands import NO_FOOT, UNBOUNDED, horizontal_band
from wbmpc.planner.candidates import Candidate
from wbmpc.planner.contacts import Contacts
from wbmpc.planner.footstep import Feet
from wbmpc.planner.lean import Lean
from wbmpc.planner.lift_postures import LiftPostures
from wbmpc.planner.posture import PalmTarget, Posture
from wbmpc.planner.reach import Reach
from wbmpc.planner.stride import Stride
from wbmpc.planner.tasks import Tasks
from wbmpc.robot import Robot
from wbmpc.rotations import angle_difference
from wbmpc.signals import SIDES, HandMode, Vector

REACH_FLOOR, FOOT_FLOOR = 0.12, 0.05  # [m] smallest d of hand and foot: neither pins the CoM to itself
SPENT = 0.02  # [m] palm error of a posture from which a contact does not reach
COM_COST = 3.0  # [cost / m²] how hard a reach's posture keeps its CoM over the feet
LEAN_COST = 100.0  # [cost / m²] how hard a lean's posture brings its CoM to the target
LEAN_BAND = 0.001  # [m] d of the CoM from a lean's way


class Paths(NamedTuple):
    """What the palms are to do over the horizon."""

    palms: Vector  # (2, N, 3) [m] in world, nan for a free hand
    sigma: Vector  # (N,) progress of the furthest task


class References:
    """Tasks and contacts as references of the stages, at the tasks' own pace or at full pace.

    The *gated* references go on at each task's present rate: that is what gets executed. The ones at *full pace* show
    what the task would need if nothing held it up: that is what the need for a contact is judged by.
    """

    def __init__(self, robot: Robot, tasks: Tasks, *, q: Vector, height: float, times: Vector) -> None:
        """Start with the posture `q` (nq,) and the CoM at `height` [m]; `times` (N,) are the knots [s]."""
        self._tasks, self._times, self._nominal_height = tasks, times, height
        self._free_palms = np.full((len(SIDES), len(times), 3), np.nan)
        kinematics = Kinematics(robot)
        self._stand = Posture(kinematics, nominal=q, com_cost=COM_COST)
        self._reach_goal = Posture(kinematics, nominal=q, com_cost=COM_COST)
        self._lean_goal = Posture(kinematics, nominal=q, com_cost=LEAN_COST)
        self._lift = LiftPostures(kinematics, nominal=q)
        self._stride: Stride | None = None
        self._centre = np.zeros(2)  # [m] between the feet
        self._distance: tuple[list[Candidate], Vector] | None = None  # d at this plan, with these contacts

    # ------------------------------------------------------------------ once a plan

    def update_postures(
        self,
        contacts: Contacts,
        *,
        feet: Feet,
        stride: Stride | None,
        centre: Vector,
        iterations: int,
    ) -> None:
        """Improve the postures: standing on the feet as they are, and the one in which the current task ends.

        In the latter palm, foot or CoM are at the task's target and the bracing palms on their patches.
        """
        self._centre = centre
        if self._stride is not None and stride is None:  # landed: stand on from there
            standing = self._stand if self._tasks.lifting is None else self._lift.low
            standing.q = self._goal.q.copy()
        self._stride = stride
        self._stand.iterate(iterations, soles=feet.positions, yaws=feet.yaws, palms=[None, None], centre=centre)
        after = feet if stride is None else stride.after
        if self._tasks.lift is not None and self._tasks.lift.ahead:
            self._lift.iterate(iterations, self._tasks.lift, before=feet, after=after, centre=centre)
        if self._tasks.lifting is not None:
            return
        palms: list[PalmTarget | None] = [c.target for c in contacts.hands]
        for task in self._tasks.current:
            if isinstance(task, Lean):
                centre = task.target
            else:
                palms[task.side] = PalmTarget(task.target)
        if stride is not None or self._tasks.leaning is not None or any(palm is not None for palm in palms):
            self._goal.iterate(iterations, soles=after.positions, yaws=after.yaws, palms=palms, centre=centre)

    @property
    def _goal(self) -> Posture:
        lift = self._tasks.lifting
        if lift is not None:
            return self._lift.high if lift.raised else self._lift.low
        return self._reach_goal if self._tasks.leaning is None else self._lean_goal

    # ------------------------------------------------------------------ over the horizon

    def paths(self, time: float, contacts: Contacts) -> tuple[Paths, Paths]:
        """At the tasks' own pace with the contacts' palms, and what the tasks alone would ask at full pace."""
        self._distance = None
        full = self._paths(time, pace=1.0)
        held_up = any(task.progress.rate != 1.0 for task in self._tasks.current)
        palms, sigma = self._paths(time) if held_up else full
        braced = [c for c in contacts.hands if c.has_goal and np.isnan(palms[c.side, 0, 0])]  # tasks go first
        if braced:
            palms = palms.copy()
            for contact in braced:
                palms[contact.side] = contact.preview(self._times)
        return Paths(palms, sigma), full

    def _paths(self, time: float, *, pace: float | None = None) -> Paths:
        """Of the tasks; `pace` of all their clocks, 0 … 1; None: each at its own gate's."""
        times = self._times
        palms, sigma = self._free_palms.copy(), np.zeros(len(times))
        for task in self._tasks.current:
            sigmas = task.progress.sigmas(time, times, rate=task.progress.rate if pace is None else pace)
            sigma = np.maximum(sigma, sigmas)
            if isinstance(task, Reach):
                palms[task.side] = task.preview(sigmas, times)
        lift = self._tasks.lifting
        if lift is not None:
            palms[:] = lift.preview(times)
            sigma = np.maximum(sigma, lift.sigmas(times))
        return Paths(palms, sigma)

    def com_band(self, contacts: Contacts, paths: Paths, foot: Vector) -> Vector:
        """Where the horizontal CoM may be (2, N, 2) [m]: within d of palms and foot, near a lean's way; see `bands`.

        Args:
            foot: shares (N,) of a stride's way; without a stride not looked at.
        """
        (palms, sigma), place, distance = paths, NO_FOOT, NO_FOOT
        if self._stride is not None:
            place, distance = self._stride.positions(foot)[None], self._foot_distance(contacts, foot)[None]
        band = horizontal_band(palms, self._reach_distance(contacts), place, distance)
        lean = self._tasks.leaning
        if lean is None:
            return band
        way = lean.preview(sigma, home=self._centre).T  # (2, N)
        way = np.clip(way, band[:, :, 0], band[:, :, 1])  # hands first: what they touch is what lets the CoM go on
        asked = lean.progress.active | (sigma > 0.0)  # before it starts nobody asks where the CoM is
        return np.where(asked[:, None], way[:, :, None] + [-LEAN_BAND, LEAN_BAND], band)

    def wanted_height(self, time: float, contacts: Contacts, sigma: Vector) -> Vector:
        """CoM height (N,) to stay near [m]: a height task's profile, else that of the postures of contacts and task.

        `sigma` (N,): the furthest task's or the stride's progress.
        """
        base = self._base(contacts).com[2]
        goal = self._goal.com[2] if self._moves else base
        wanted: Vector = base + sigma * (goal - base)
        for task in self._tasks.heights:
            knots = [0.0] + [w.time for w in task.waypoints]
            heights = [self._nominal_height] + [w.height for w in task.waypoints]
            wanted = np.interp(time + self._times, knots, heights)
        return wanted

    def _base(self, contacts: Contacts) -> Posture:
        """What the robot does without a task: stand, or brace; from where it goes on: hold what it lifts."""
        lift, braced = self._tasks.lifting, contacts.posture
        if lift is not None and lift.raised:
            return self._lift.low
        return self._stand if braced is None else braced

    def _foot_distance(self, contacts: Contacts, share: Vector) -> Vector:
        """d (N, 2) [m] of a stride's foot at `share` (N,) of its way, from the postures before and after."""
        assert self._stride is not None
        ends = self._stride.positions(np.array([0.0, 1.0]))
        before = np.abs(ends[0] - self._base(contacts).com[:2])
        after = np.abs(ends[1] - self._goal.com[:2])
        return np.maximum(before + share[:, None] * (after - before), FOOT_FLOOR)

    def _reach_distance(self, contacts: Contacts) -> Vector:
        """d (2, 2) per hand and axis [m]: what lies between palm and CoM in the posture that the task needs.

        The paper takes d as a constant of the robot; the posture makes it the constant of this target and this stance.
        """
        if self._distance is None or self._distance[0] is not contacts.used:
            self._distance = contacts.used, self._look_for_distance(contacts)
        return self._distance[1]

    def _look_for_distance(self, contacts: Contacts) -> Vector:
        if self._tasks.lifting is not None:
            return np.maximum(self._lift.distance(self._tasks.lifting)[:, :2], REACH_FLOOR)
        distance, goal = [(UNBOUNDED, UNBOUNDED)] * len(SIDES), self._goal.com
        for contact in contacts.hands:
            place, braced = contact.goal, contacts.posture
            if place is not None and braced is not None:
                distance[contact.side] = x, y = _apart(place, braced.com)
                if self._moves:
                    with_task = _apart(place, goal)
                    distance[contact.side] = max(x, with_task[0]), max(y, with_task[1])
        for task in self._tasks.current:
            if isinstance(task, Reach):
                x, y = _apart(task.target, goal)
                distance[task.side] = x - self._tasks.shrink, y - self._tasks.shrink
        return np.array([(max(x, REACH_FLOOR), max(y, REACH_FLOOR)) for x, y in distance])

    def carried(self, times: Vector) -> Vector:
        """Forces (2, n, 3) [N] on the palms of what they hold, in world, `times` (n,) seconds from now."""
        lift = self._tasks.lifting
        return np.zeros((len(SIDES), len(times), 3)) if lift is None else lift.forces(times)

    def height_distance(self, usual: float) -> Vector:
        """d (2,) of each hand [m] for the CoM height: `usual`, or what lies between the two in a lift's postures."""
        lift = self._tasks.lifting
        return np.full(len(SIDES), usual) if lift is None else self._lift.distance(lift)[:, 2].copy()

    # ------------------------------------------------------------------ now

    def attitude(self, contacts: Contacts, feet: float) -> tuple[Vector, Vector, float]:
        """Where the joint reference is drawn to: standing or braced, the task's posture by its progress.

        Joint angles (nj,), the torso's own vertical (3,) in world, and its yaw [rad]: that of the feet, `feet`, or the
        postures'.
        """
        base, goal, braced, share = self._base(contacts), self._goal, contacts.posture, self._sigma
        posture, torso_up = _between(base.q, goal.q, base.torso, goal.torso, share)
        heading = feet if braced is None else feet + angle_difference(braced.torso_heading, feet)
        return posture, torso_up, heading + share * angle_difference(goal.torso_heading, heading)

    @property
    def _moves(self) -> bool:
        """Whether a task or a stride is there that ends elsewhere than the robot is."""
        return bool(self._tasks.current) or self._stride is not None or self._tasks.lifting is not None

    @property
    def _sigma(self) -> float:
        """Progress of the furthest task or the stride."""
        return self._tasks.sigma if self._stride is None else max(self._tasks.sigma, self._stride.sigma)

    def spent(self, contacts: Contacts) -> tuple[int, ...]:
        """Sides of contacts that a stride's end leaves out of the palm's reach."""
        if self._stride is None or not self._goal.settled:
            return ()
        return tuple(c.side for c in contacts.hands if c.touching and self._goal.palm_errors[c.side] > SPENT)

    def hand_targets(self, contacts: Contacts, palms: Vector) -> list[tuple[Vector, Vector, HandMode]]:
        """Position (3,) [m], velocity (3,) [m/s] and mode of each hand; a free hand is where it is, `palms` (2, 3)."""
        targets, lift = [], self._tasks.lifting
        for contact in contacts.hands:
            side = contact.side
            target = (palms[side], np.zeros(3), HandMode.FREE)
            if contact.busy:
                target = (*contact.reference()[:2], contact.mode)
            for reach in self._tasks.reaches:
                if reach.side == side and reach.progress.active:
                    target = (*reach.reference(), HandMode.MOVE)
            if lift is not None:
                target = (*lift.reference(side), lift.mode)
            targets.append(target)
        return targets

    @property
    def goal_com(self) -> Vector | None:
        """CoM (3,) [m] where the current task ends; None when none is on its way or holding."""
        return self._goal.com if self._stride is not None or self._tasks.ahead else None


def _apart(a: Vector, b: Vector) -> tuple[float, float]:
    """Horizontal distances along the world's axes of two places (3,) [m]."""
    return abs(float(a[0]) - float(b[0])), abs(float(a[1]) - float(b[1]))


@kernel
def _between(base: Vector, goal: Vector, torso: Vector, goal_torso: Vector, share: float) -> tuple[Vector, Vector]:
    """Joint angles and torso's vertical a `share` of the way from `base` (nq,) with `torso` (3, 3) to `goal`."""
    n = len(base) - 7
    posture, up = np.empty(n), np.empty(3)
    for i in range(n):
        posture[i] = base[7 + i] + share * (goal[7 + i] - base[7 + i])
    for i in range(3):
        up[i] = torso[i, 2] + share * (goal_torso[i, 2] - torso[i, 2])
    return posture, up
