"""Going to a place: the next foothold on the way there."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import ALIGNED, CAREFUL_LEAD, SIDE_SIGN, Feet, Footstep
from wbmpc.planner.settings import GaitSettings
from wbmpc.rotations import plane_rotation
from wbmpc.scenario import GoTask
from wbmpc.signals import Vector

WORTH_A_STEP = 0.012  # [m] a foot that gets so much farther has moved
SEARCH_STEP = 0.005  # [m] between the places ahead that are tried for a foot
WIDER = (0.0, 0.01, -0.01, 0.02, 0.03)  # [m] more than the usual width, tried one after the other
MOST_FOUND = 64  # steps that are remembered


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

    def _look(self, feet: Feet) -> Footstep | None:
        """The nearest free foothold ahead, beyond an obstacle when there is none before it.

        The foot that goes over an obstacle goes no further than it must, and the other one closes up behind it: the
        shorter the stride, the less the hands have to help. Before an edge both feet go up to it.
        """
        task, settings = self.task, self._settings
        turn = plane_rotation(feet.heading)
        rest = turn.T @ (np.array(task.target) - feet.positions[:, :2].mean(axis=0))
        if float(np.abs(rest).max()) < ALIGNED and feet.aligned:
            return None
        side = (0 if rest[1] >= 0.0 else 1) if feet.last < 0 else 1 - feet.last
        stance = feet.positions[1 - side][:2]
        across = SIDE_SIGN[side] * settings.step_width
        goal = turn.T @ (np.array(task.target) - stance) + [0.0, across / 2]
        wanted = np.array([np.clip(goal[0], -task.step_length, task.step_length), across])
        outwards = sorted((0.0, SIDE_SIGN[side] * task.step_length))
        wanted[1] += min(max(goal[1] - across, outwards[0]), outwards[1])
        forward = 1.0 if rest[0] >= 0.0 else -1.0
        step: Footstep | None = None
        for wider in WIDER:  # somewhere beyond what is in the way, else as far as the usual width leads
            offset = np.array([wanted[0], wanted[1] + SIDE_SIGN[side] * wider])
            other, over = self._ahead(feet, side, offset, forward)
            if over or wider == 0.0:
                step = other
            if over:
                break
        return step

    def _ahead(self, feet: Feet, side: int, wanted: Vector, forward: float) -> tuple[Footstep | None, bool]:
        """The step to `wanted` (2,) [m] from the stance foot, or to where the way `forward` (±1) leads instead.

        And whether the foot gets on from there, or stands before what it cannot cross.
        """
        task, settings, footholds = self.task, self._settings, self._footholds
        yaw, turn = feet.heading, plane_rotation(feet.heading)
        stance, start = feet.positions[1 - side], feet.positions[side]

        def place(ahead: float) -> Vector:
            there = stance[:2] + turn @ np.array([forward * ahead, wanted[1]])
            return footholds.on_ground(there, yaw, stance=stance, stance_yaw=float(feet.yaws[1 - side]))

        def lift(ahead: float) -> float | None:
            end = place(ahead)
            return footholds.crossed(start[:2], end[:2], yaw, lowest=float(min(start[2], end[2])))

        def free(ahead: float) -> bool:
            return footholds.free(place(ahead)[:2], yaw)

        usual, ahead = forward * float(wanted[0]), 0.0
        behind = -forward * float((turn.T @ (start - stance)[:2])[0])  # [m] the foot is behind the other one
        tries = np.arange(0.0, task.longest_step + 1e-9, SEARCH_STEP).tolist()
        if footholds.obstructed(start[:2], place(usual)[:2], yaw):  # the first place beyond it, or the last before
            lifts = [lift(a) for a in tries]
            beyond = [a for a, height in zip(tries, lifts, strict=True) if height and free(a)]
            before = [a for a, height in zip(tries, lifts, strict=True) if height == 0.0]
            over = bool(beyond)
            if over:
                ahead = beyond[0]
            elif not before or (abs(before[-1] + behind) < SEARCH_STEP and feet.aligned):
                return None, False  # no way on from here
            else:
                ahead = before[-1]
        elif free(usual):
            ahead, over = usual, True
        else:  # over the edge of a tread: up to it, or where that is no step to the first place behind it
            places = [a for a in tries if free(a) and lift(a) is not None]
            shorter, longer = [a for a in places if a <= usual], [a for a in places if a > usual]
            over = bool(longer) or bool(shorter and shorter[-1] + behind > WORTH_A_STEP)
            if not over:
                return None, False
            ahead = shorter[-1] if shorter and shorter[-1] + behind > WORTH_A_STEP else longer[0]
        return (
            Footstep(
                side=side,
                position=place(ahead),
                yaw=yaw,
                swing_time=task.swing_time,
                double_support=settings.stride_double_support,
                clearance=max(settings.step_height, lift(ahead) or 0.0),
                lead=CAREFUL_LEAD,
                adaptable=False,
                task=self._index,
            ),
            over,
        )
