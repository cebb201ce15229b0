"""What the tasks ask of the feet: the next footstep from where the feet stand."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.settings import GaitSettings
from wbmpc.planner.support import UNEVEN
from wbmpc.rotations import angle_difference
from wbmpc.scenario import GoTask, StepTask, Task, WalkTask
from wbmpc.signals import Vector

ALIGNED, ALIGNED_YAW = 0.02, 0.06  # [m], [rad] feet so close to side by side need no further step
STILL = 1e-6  # [m/s, rad/s] a command below is to stand
SIDE_SIGN = (1.0, -1.0)  # left is +y
WORTH_A_STEP = 0.02  # [m] a foot that gets so much farther has moved
SEARCH_STEP = 0.005  # [m] between the places that are tried for a foot
MOST_FOUND = 64  # steps that are remembered
CAREFUL_LEAD = 0.3  # of a slow step: the foot rises, goes over, comes down


class Stepping:
    """The footsteps that the tasks ask for, one at a time.

    A velocity command puts each foot where the body will need it (Herdt et al. 2010): the foot on the side of a
    sideways motion takes all of it, that on the side of a turn the turn, and the other one closes up: legs never cross.
    """

    def __init__(self, tasks: tuple[Task, ...], settings: GaitSettings, footholds: Footholds) -> None:
        self._settings, self._footholds = settings, footholds
        self._journeys = [(i, task) for i, task in enumerate(tasks) if isinstance(task, GoTask)]
        self._walks = [(i, task) for i, task in enumerate(tasks) if isinstance(task, WalkTask)]
        self._steps = [(i, task) for i, task in enumerate(tasks) if isinstance(task, StepTask)]
        self._done: set[int] = set()
        self._found: dict[tuple[int, bytes, int], Footstep | None] = {}  # of journeys, see `_searched`

    def landed(self, step: Footstep) -> None:
        """A step has been made."""
        if any(i == step.task for i, _ in self._steps):
            self._done.add(step.task)

    def command(self, time: float) -> Vector | None:
        """Velocity command (forward, left, yaw rate) [m/s, rad/s]; None before the first one."""
        current = None
        for _, walk in self._walks:
            for command in walk.commands:
                if command.time <= time + 1e-9:
                    current = np.array([*command.velocity, command.yaw_rate])
        return current

    def next(self, feet: Feet, time: float, *, made: tuple[int, ...] = ()) -> Footstep | None:
        """The next step at `time` [s] from `feet`, None to stand; `made`: tasks of steps already previewed."""
        for index, task in self._steps:
            if index not in self._done and index not in made and task.start <= time + 1e-9:
                return self._commanded(index, task, feet)
        for index, journey in self._journeys:
            if journey.start <= time + 1e-9:
                return self._searched(index, journey, feet)
        command = self.command(time)
        return None if command is None else self._walk(feet, command)

    def velocity(self, feet: Feet, time: float) -> Vector:
        """Wanted CoM velocity (2,) in world [m/s]."""
        command = self.command(time)
        return np.zeros(2) if command is None else _rotation(_heading(feet)) @ command[:2]

    def _commanded(self, index: int, task: StepTask, feet: Feet) -> Footstep:
        side = ("left", "right").index(task.foot)
        settings, stance_yaw = self._settings, float(feet.yaws[1 - side])
        return Footstep(
            side=side,
            position=self._on_ground(np.array(task.target), float(task.yaw), feet, side),
            yaw=stance_yaw + angle_difference(task.yaw, stance_yaw),  # not around by whole turns
            swing_time=task.duration,
            double_support=settings.stride_double_support,
            clearance=settings.step_height,
            lead=CAREFUL_LEAD,
            adaptable=False,
            task=index,
        )

    def _searched(self, index: int, task: GoTask, feet: Feet) -> Footstep | None:
        """`_towards`, looked for once from the same feet: every plan asks again for all steps of its horizon."""
        key = (index, np.column_stack([feet.positions, feet.yaws]).tobytes(), feet.last)
        if key not in self._found:
            if len(self._found) >= MOST_FOUND:
                self._found.clear()
            self._found[key] = self._towards(index, task, feet)
        return self._found[key]

    def _towards(self, index: int, task: GoTask, feet: Feet) -> Footstep | None:
        """The next step to a place: the nearest free foothold ahead, beyond an obstacle when there is none before it.

        The foot that goes over an obstacle goes no further than it must, and the other one closes up behind it: the
        shorter the stride, the less the hands have to help.
        """
        settings = self._settings
        yaw = _heading(feet)
        turn = _rotation(yaw)
        rest = turn.T @ (np.array(task.target) - feet.positions[:, :2].mean(axis=0))
        if float(np.abs(rest).max()) < ALIGNED and _aligned(feet):
            return None
        side = (0 if rest[1] >= 0.0 else 1) if feet.last < 0 else 1 - feet.last
        stance, start = feet.positions[1 - side][:2], feet.positions[side][:2]
        across = SIDE_SIGN[side] * settings.step_width
        goal = turn.T @ (np.array(task.target) - stance) + [0.0, across / 2]
        wanted = np.array([np.clip(goal[0], -task.step_length, task.step_length), across])
        outwards = sorted((0.0, SIDE_SIGN[side] * task.step_length))
        wanted[1] += min(max(goal[1] - across, outwards[0]), outwards[1])
        forward = 1.0 if rest[0] >= 0.0 else -1.0
        way = task.longest_step * forward

        def place(ahead: float) -> Vector:
            return stance + turn @ np.array([ahead, wanted[1]])

        def lift(end: Vector) -> float | None:
            heights = feet.positions[side][2], self._on_ground(end, yaw, feet, side)[2]
            return self._footholds.crossed(start, end, yaw, lowest=float(min(heights)))

        def free(end: Vector) -> bool:
            return self._footholds.free(end, yaw)

        nominal = lift(place(wanted[0]))
        if nominal == 0.0 and free(place(wanted[0])):
            ahead = wanted[0]
        else:  # something is in the way: the first place beyond it, or the last one before
            tries = np.arange(0.0, abs(way) + 1e-9, SEARCH_STEP) * forward
            lifts = [lift(place(a)) for a in tries]
            beyond = [a for a, height in zip(tries, lifts, strict=True) if height and free(place(a))]
            before = [a for a, height in zip(tries, lifts, strict=True) if height == 0.0]
            if not beyond and not before:
                return None
            near = [a for a in before if free(place(a))]
            closer = bool(near) and abs((turn.T @ (place(near[-1]) - start))[0]) > WORTH_A_STEP
            ahead = beyond[0] if beyond else before[-1]
            if beyond and closer and abs(beyond[0]) > task.step_length:
                ahead = near[-1]  # up to the edge first: the stride over it is shorter then
            if not beyond and abs((turn.T @ (place(ahead) - start))[0]) < SEARCH_STEP and _aligned(feet):
                return None  # no way on from here
        height = lift(place(ahead)) or 0.0
        return Footstep(
            side=side,
            position=self._on_ground(place(ahead), yaw, feet, side),
            yaw=yaw,
            swing_time=task.swing_time,
            double_support=settings.stride_double_support,
            clearance=max(settings.step_height, height),
            lead=CAREFUL_LEAD,
            adaptable=False,
            task=index,
        )

    def _on_ground(self, place: Vector, yaw: float, feet: Feet, side: int) -> Vector:
        """(3,) [m] a sole's centre at `place` (2,); over an edge, as high as the foot that stands."""
        stance = float(feet.positions[1 - side][2])
        level = self._footholds.height(place, yaw, otherwise=stance)
        return np.array([*place, stance if abs(level - stance) < UNEVEN else level])

    def _walk(self, feet: Feet, command: Vector) -> Footstep | None:
        settings = self._settings
        moving = float(np.abs(command).max()) > STILL
        if not moving and (feet.last < 0 or _aligned(feet)):
            return None
        vx, vy, omega = command
        sideways, turning = 0 if vy >= 0.0 else 1, 0 if omega >= 0.0 else 1  # the foot that takes each motion
        side = (sideways if abs(vy) >= 0.1 * abs(omega) else turning) if feet.last < 0 else 1 - feet.last
        stance = 1 - side
        period = settings.swing_time + settings.double_support
        yaw = float(feet.yaws[stance]) + (2.0 * period * omega if side == turning else 0.0)
        # lateral and turning motion are taken by one foot, for two steps; the forward one by both
        width = settings.step_width + turning_room(settings, yaw - float(feet.yaws[stance]))
        offset = np.array([vx * period, SIDE_SIGN[side] * width + (2.0 * period * vy if side == sideways else 0.0)])
        half_turn = _rotation(0.5 * (float(feet.yaws[stance]) + yaw))
        position = feet.positions[stance].copy()
        position[:2] += half_turn @ offset
        return Footstep(
            side=side,
            position=position,
            yaw=yaw,
            swing_time=settings.swing_time,
            double_support=settings.double_support,
            clearance=settings.step_height,
            lead=0.06,
            adaptable=True,
            task=self._walks[0][0],
        )


def turning_room(settings: GaitSettings, angle: float) -> float:
    """Width [m] that soles need besides when one is turned by `angle` [rad] against the other."""
    return settings.turning_room * abs(float(np.sin(angle)))


def _rotation(yaw: float) -> Vector:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def _heading(feet: Feet) -> float:
    return float(feet.yaws.mean())


def _aligned(feet: Feet) -> bool:
    across = _rotation(_heading(feet)).T @ (feet.positions[0] - feet.positions[1])[:2]
    return abs(across[0]) < ALIGNED and abs(feet.yaws[0] - feet.yaws[1]) < ALIGNED_YAW
