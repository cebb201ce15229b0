"""Going to a place: the next foothold on the way there."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import ALIGNED, CAREFUL_LEAD, SIDE_SIGN, Feet, Footstep
from wbmpc.planner.settings import GaitSettings
from wbmpc.record import record
from wbmpc.rotations import plane_rotation
from wbmpc.scenario import GoTask
from wbmpc.signals import Vector

WORTH_A_STEP = 0.012  # [m] a foot that gets so much farther has moved
SEARCH_STEP = 0.005  # [m] between the places ahead that are tried for a foot
WIDER = (0.0, 0.01, -0.01, 0.02, 0.03)  # [m] more than the usual width, tried one after the other
SHORT_STRIDE = 0.16  # [m] over an edge: before a longer one all widths are tried
MOST_FOUND = 64  # steps that are remembered


@record
class _Place:
    """Where a foot might go."""

    ahead: float  # [m] of the stance foot, in the direction of the journey
    position: Vector  # (3,) [m]
    lift: float | None  # [m] see `Footholds.crossed`
    free: bool  # see `Footholds.free`


class Journey:
    """The steps to one place, each looked for from where the feet have landed."""

    def __init__(self, index: int, task: GoTask, settings: GaitSettings, footholds: Footholds) -> None:
        """`index` is the task's, among all of the scenario."""
        self.task = task
        self._index, self._settings, self._footholds = index, settings, footholds
        self._found: dict[tuple[bytes, int], Footstep | None] = {}

    def next(self, feet: Feet) -> Footstep | None:
        """The next step from `feet`, None at the end or where there is no way on.

        It is looked for once: every plan asks again for all steps of its horizon.
        """
        key = (np.column_stack([feet.positions, feet.yaws]).tobytes(), feet.last)
        if key not in self._found:
            if len(self._found) >= MOST_FOUND:
                self._found.clear()
            self._found[key] = self._look(feet)
        return self._found[key]

    def arrived(self, feet: Feet) -> bool:
        """Whether the feet stand at the place, side by side."""
        rest = plane_rotation(feet.heading).T @ (np.array(self.task.target) - feet.centre)
        return float(np.abs(rest).max()) < ALIGNED and feet.aligned

    def _look(self, feet: Feet) -> Footstep | None:
        """The nearest free foothold ahead, beyond an obstacle when there is none before it.

        The foot that goes over an obstacle goes no further than it must, and the other one closes up behind it: the
        shorter the stride, the less the hands have to help. Before an edge both feet go up to it. Where a place is
        taken, one a little wider is, or one straight ahead instead of towards a goal that is aside.
        """
        if self.arrived(feet):
            return None
        task, settings = self.task, self._settings
        turn = plane_rotation(feet.heading)
        rest = turn.T @ (np.array(task.target) - feet.centre)
        side = (0 if rest[1] >= 0.0 else 1) if feet.last < 0 else 1 - feet.last
        across = SIDE_SIGN[side] * settings.step_width
        goal = turn.T @ (np.array(task.target) - feet.positions[1 - side][:2]) + [0.0, across / 2]
        outwards = sorted((0.0, SIDE_SIGN[side] * task.step_length))
        aside = min(max(goal[1] - across, outwards[0]), outwards[1])
        forward = 1.0 if rest[0] >= 0.0 else -1.0
        fallback: _Place | None = None
        shifts = (aside, 0.0) if abs(aside) > WORTH_A_STEP else (aside,)
        for longest, sideways, wider in itertools.product((SHORT_STRIDE, task.longest_step), shifts, WIDER):
            if settings.step_width + wider < settings.narrowest:
                continue
            find = self._finder(feet, side, forward, across + sideways + SIDE_SIGN[side] * wider)
            ahead = forward * float(goal[0])
            place, on = self._ahead(feet, side, find, goal=ahead, aside=abs(sideways), longest=longest)
            if on and place is not None:
                return self._step(feet, side, place)
            if wider == 0.0 and sideways == aside:
                fallback = place  # as far as it goes, before what cannot be crossed
        return None if fallback is None else self._step(feet, side, fallback)

    def _finder(self, feet: Feet, side: int, forward: float, across: float) -> Callable[[float], _Place]:
        """What there is `ahead` [m] of the stance foot, `across` [m] to its left."""
        footholds, yaw, stance, start = self._footholds, feet.heading, feet.positions[1 - side], feet.positions[side]
        turn, own = plane_rotation(yaw), footholds.height(stance[:2], float(feet.yaws[1 - side]))

        def find(ahead: float) -> _Place:
            there = stance[:2] + turn @ np.array([forward * ahead, across])
            position = footholds.on_ground(there, yaw, stance=float(stance[2]), own=own)
            lift = footholds.crossed(start[:2], there, yaw, lowest=float(min(start[2], position[2])))
            return _Place(ahead, position, lift, footholds.free(there, yaw))

        return find

    def _ahead(
        self, feet: Feet, side: int, find: Callable[[float], _Place], *, goal: float, aside: float, longest: float
    ) -> tuple[_Place | None, bool]:
        """The place to go to, and whether the foot gets on from there, or stands before what it cannot cross.

        `goal` [m]: how far the journey's end is ahead of the stance foot; `aside` [m]: of a step to the side.
        `longest` [m]: step over an edge; over an obstacle it is the task's.
        """
        task, start = self.task, feet.positions[side]
        turn = plane_rotation(feet.heading)

        def moved(place: _Place) -> float:
            return max(aside, float(abs((turn.T @ (place.position - start)[:2])[0])))

        usual = find(float(np.clip(goal, -task.step_length, task.step_length)))
        tries = np.arange(0.0, task.longest_step + 1e-9, SEARCH_STEP)
        lowest = float(min(start[2], usual.position[2]))
        if self._footholds.obstructed(start[:2], usual.position[:2], feet.heading, lowest=lowest):
            places = [find(ahead) for ahead in tries.tolist()]
            beyond = next((place for place in places if place.lift and place.free), None)
            if beyond is not None:
                return beyond, True
            before = next((place for place in reversed(places) if place.lift == 0.0 and place.free), None)
            if before is None or (moved(before) < SEARCH_STEP and feet.aligned):
                return None, False  # no way on from here
            return before, False
        if usual.free and usual.lift is not None:
            return usual, True
        # the edge of a tread: up to it, or where that is no step to the first place behind it
        near, far = tries[tries < usual.ahead], tries[(tries > usual.ahead) & (tries <= longest)]
        shorter = next(
            (place for place in map(find, near[::-1].tolist()) if place.free and place.lift is not None), None
        )
        if shorter is not None and moved(shorter) > WORTH_A_STEP:
            return shorter, True
        longer = next((place for place in map(find, far.tolist()) if place.free and place.lift is not None), None)
        if longer is not None and (abs(goal - longer.ahead) < abs(goal) or not feet.aligned):
            return longer, True
        return None, False

    def _step(self, feet: Feet, side: int, place: _Place) -> Footstep:
        settings = self._settings
        return Footstep(
            side=side,
            position=place.position,
            yaw=feet.heading,
            swing_time=self.task.swing_time,
            double_support=settings.stride_double_support,
            clearance=max(settings.step_height, place.lift or 0.0),
            lead=CAREFUL_LEAD,
            adaptable=False,
            task=self._index,
        )
