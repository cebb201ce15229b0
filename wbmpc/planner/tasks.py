"""The tasks that move hands and CoM: which of them is current, and how far each has come."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep import SoleReferences
from wbmpc.planner.lean import Lean
from wbmpc.planner.lift import Lift
from wbmpc.planner.progress import TaskPhase
from wbmpc.planner.reach import Reach
from wbmpc.robot import Robot
from wbmpc.rotations import length
from wbmpc.scenario import ComHeightTask, LeanTask, Load, ReachTask, Task
from wbmpc.signals import SIDES, TargetMove, Vector

SHRINK_RATE, SHRINK_LIMIT = 1.0, 0.02  # [1/s], [m] how a held hand that stays short tightens its d


class Tasks:
    """The scenario's reaches, leans, lift and height profile; what the feet do is the gait's."""

    def __init__(
        self, robot: Robot, tasks: tuple[Task, ...], loads: tuple[Load, ...], *, palms: Vector, heading: float
    ) -> None:
        """Start with palms at `palms` (2, 3) [m] and the feet's `heading` [rad]."""
        self.reaches = [
            Reach(task, side=_hand_of(task, palms), palm=palms[_hand_of(task, palms)])
            for task in tasks
            if isinstance(task, ReachTask)
        ]
        self.leans = [Lean(task) for task in tasks if isinstance(task, LeanTask)]
        lifts = [Lift(load, palms=palms, heading=heading, palm_radius=robot.palm_radius) for load in loads]
        self.lift = lifts[0] if lifts else None
        self.heights = [task for task in tasks if isinstance(task, ComHeightTask)]
        self._excursions: list[Reach | Lean] = [*self.reaches, *self.leans]
        self._by_index = dict(zip(_reach_indices(tasks), self.reaches, strict=True))
        self._moves: list[TargetMove] = []  # ordered since the last plan
        self.current: list[Reach] | list[Lean] = []  # the reaches still to be done, or the lean that comes before them
        self.leaning: Lean | None = None  # the lean that is current, if one is
        self._pick()
        self.shrink = 0.0  # [m] by which d of a reach's hand is smaller than in its posture

    def order(self, move: TargetMove) -> None:
        """Take an order; the next `advance` carries it out, or says why not."""
        self._moves.append(move)

    def advance(
        self,
        time: float,
        dt: float,
        *,
        gate_open: bool,
        palms: Vector,
        palm_forces: Vector,
        homes: Vector,
        com: Vector,
        events: list[str],
    ) -> None:
        """Every task one plan further.

        Args:
            gate_open: false while an expected contact is missing.
            palms, palm_forces: measured (2, 3) [m], [N]; `homes` (2, 3) [m]: where free palms hang.
            com: measured (3,) [m].
        """
        while self._moves:
            self._move(self._moves.pop(0), palms, events)
        if self.lift is not None:
            phase = self.lift.phase
            self.lift.advance(time, dt, palms=palms, palm_forces=palm_forces, homes=homes)
            if self.lift.phase != phase:
                events.append(f"lift: {phase.name.lower()} -> {self.lift.phase.name.lower()}")
        for task in self._excursions:
            before = task.progress.phase
            if isinstance(task, Reach):
                name, palm = f"reach {SIDES[task.side]}", palms[task.side]
                task.advance(time, dt, gate_open=gate_open, palm=palm)
                if task.progress.phase == TaskPhase.HOLD:
                    short = length(palm - task.target) - 0.5 * task.task.tolerance
                    self.shrink = min(max(self.shrink + SHRINK_RATE * dt * short, 0.0), SHRINK_LIMIT)
            else:
                name = "lean"
                task.advance(time, dt, gate_open=gate_open, com=com)
            if task.progress.phase != before:
                events.append(f"{name}: {before.name.lower()} -> {task.progress.phase.name.lower()}")
                self._pick()

    def _move(self, move: TargetMove, palms: Vector, events: list[str]) -> None:
        """Move a reach's target, unless its hand is no longer free for it."""
        reach = self._by_index[move.task]
        place = ", ".join(f"{x:.3f}" for x in move.target)
        busy = "a lift has the hands" if self.lift is not None else "a lean is current" if self.leaning else ""
        if busy and reach.progress.phase == TaskPhase.DONE:
            events.append(f"reach {SIDES[reach.side]}: target not moved, {busy}")
            return
        reach.move(move.target, palm=palms[reach.side])
        self._pick()
        events.append(f"reach {SIDES[reach.side]}: target moved to ({place}) m")

    def takes_along(self, *, stepping: bool) -> bool:
        """Whether something that is carried goes with the CoM: from the first stride on."""
        return self.lift is not None and (stepping or self.lift.carry is not None)

    def go_along(self, com: Vector, course: Vector, soles: SoleReferences) -> None:
        """See `Carry.follow`; the heading is that of the feet's references, `soles`."""
        assert self.lift is not None
        self.lift.go_along(com, course, heading=soles.heading, yaw_rate=float(soles.yaw_rates.mean()))

    @property
    def hold_feet(self) -> bool:
        """Whether the feet must stay where they are."""
        return self.lift is not None and self.lift.hold_feet

    def _pick(self) -> None:
        reaches = [reach for reach in self.reaches if reach.progress.phase != TaskPhase.DONE]
        leans = [lean for lean in self.leans if lean.progress.phase != TaskPhase.DONE]
        first = min(leans, key=lambda lean: lean.task.start, default=None)
        if first is None or any(reach.task.start < first.task.start for reach in reaches):
            self.current, self.leaning = reaches, None
        else:
            self.current, self.leaning = [first], first

    @property
    def lifting(self) -> Lift | None:
        """The lift that moves the hands now, if one does."""
        return self.lift if self.lift is not None and self.lift.active else None

    @property
    def sigma(self) -> float:
        """Progress of the furthest task, 0 … 1."""
        if self.lifting is not None:
            return self.lifting.progress
        return max((task.progress.sigma for task in self.current), default=0.0)

    @property
    def ahead(self) -> bool:
        """Whether a target is still to be reached or held."""
        return any(task.progress.ahead for task in self.current)

    @property
    def hands_taken(self) -> list[bool]:
        """Which hands belong to a task (left, right), now or later."""
        taken = [task.side for task in self.current if isinstance(task, Reach)]
        return [side in taken or (self.lift is not None and self.lift.ahead) for side in range(len(SIDES))]

    @property
    def rate(self) -> float:
        """Of the slowest task's clock, 0 … 1."""
        return min((task.progress.rate for task in self._excursions), default=1.0)


def _reach_indices(tasks: tuple[Task, ...]) -> list[int]:
    """Where the reaches are among all tasks."""
    return [index for index, task in enumerate(tasks) if isinstance(task, ReachTask)]


def _hand_of(task: ReachTask, palms: Vector) -> int:
    """The hand a reach takes: the one it names, or the one nearer to the target (left when equal)."""
    if task.hand != "auto":
        return SIDES.index(task.hand)
    return int(np.argmin(np.linalg.norm(palms - np.array(task.target), axis=1)))
