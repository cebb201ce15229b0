"""What the tasks ask of the feet: the next footstep from where the feet stand."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import CAREFUL_LEAD, Feet, Footstep
from wbmpc.planner.journey import Journey
from wbmpc.planner.settings import GaitSettings
from wbmpc.rotations import angle_difference
from wbmpc.scenario import GoTask, StepTask, Task, WalkTask
from wbmpc.signals import Vector

STILL = 1e-6  # [m/s, rad/s] a command below is to stand


class Stepping:
    """The footsteps that the tasks ask for, one at a time.

    A velocity command puts each foot where the body will need it (Herdt et al. 2010): the foot on the side of a
    sideways motion takes all of it, that on the side of a turn the turn, and the other one closes up: legs never cross.
    """

    def __init__(self, tasks: tuple[Task, ...], settings: GaitSettings, footholds: Footholds) -> None:
        self._settings, self._footholds = settings, footholds
        self._journeys = [
            Journey(i, task, settings, footholds) for i, task in enumerate(tasks) if isinstance(task, GoTask)
        ]
        self._walks = [(i, task) for i, task in enumerate(tasks) if isinstance(task, WalkTask)]
        commands = [command for _, walk in self._walks for command in walk.commands]
        commands.sort(key=lambda command: command.time)
        self._command_times = [command.time for command in commands]  # [s] ascending
        self._time_of_command = np.array(self._command_times)  # the same for kernels
        self._commands = np.array([(*command.velocity, command.yaw_rate) for command in commands]).reshape(-1, 3)
        self._steps = [(i, task) for i, task in enumerate(tasks) if isinstance(task, StepTask)]
        self._done: set[int] = set()

    @property
    def has_commands(self) -> bool:
        """Whether any task gives a velocity command, now or at another time."""
        return len(self._commands) > 0

    def landed(self, step: Footstep) -> None:
        """A step has been made."""
        if any(i == step.task for i, _ in self._steps):
            self._done.add(step.task)

    def command(self, time: float) -> Vector | None:
        """Velocity command (forward, left, yaw rate) [m/s, rad/s]; None before the first one."""
        if not self.has_commands:
            return None
        given = bisect_right(self._command_times, time + 1e-9)
        return self._commands[given - 1] if given else None

    def next(self, feet: Feet, time: float, *, made: tuple[int, ...] = ()) -> Footstep | None:
        """The next step at `time` [s] from `feet`, None to stand; `made`: tasks of steps already previewed."""
        for index, task in self._steps:
            if index not in self._done and index not in made and task.start <= time + 1e-9:
                return self._commanded(index, task, feet)
        for journey in self._journeys:
            if journey.task.start <= time + 1e-9:
                return journey.next(feet)
        command = self.command(time)
        return None if command is None else self._walk(feet, command)

    def stopped_short(self, feet: Feet, time: float) -> bool:
        """Whether `feet` that have no next step are not where they were to go."""
        return any(journey.task.start <= time and not journey.arrived(feet) for journey in self._journeys)

    def velocities(self, headings: Vector, times: Vector) -> Vector:
        """Wanted CoM velocities (n, 2) in world [m/s] at `times` (n,) [s] with the robot's `headings` (n,) [rad]."""
        if not self.has_commands:
            return np.zeros((len(times), 2))
        velocities: Vector = _velocities(self._time_of_command, self._commands, headings, times)
        return velocities

    def _commanded(self, index: int, task: StepTask, feet: Feet) -> Footstep:
        side = ("left", "right").index(task.foot)
        settings, stance_yaw, footholds = self._settings, float(feet.yaws[1 - side]), self._footholds
        stance, start, target = feet.positions[1 - side], feet.positions[side], np.array(task.target)
        own = footholds.height(stance[:2], stance_yaw)
        position = footholds.on_ground(target, task.yaw, stance=float(stance[2]), own=own)
        crossed = footholds.crossed(start[:2], target, task.yaw, lowest=float(min(start[2], position[2])))
        return Footstep(
            side=side,
            position=position,
            yaw=stance_yaw + angle_difference(task.yaw, stance_yaw),  # not around by whole turns
            swing_time=task.duration,
            double_support=settings.stride_double_support,
            clearance=max(settings.step_height, crossed or 0.0),
            lead=CAREFUL_LEAD,
            adaptable=False,
            task=index,
        )

    def _walk(self, feet: Feet, command: Vector) -> Footstep | None:
        settings = self._settings
        moving = max(map(abs, command.tolist())) > STILL
        if not moving and (feet.last < 0 or feet.aligned):
            return None
        side, position, yaw = _walking_step(
            *(feet.positions, feet.yaws, feet.last, command, settings.swing_time + settings.double_support),
            *(settings.step_width, settings.turning_room, settings.narrowest),
        )
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


@kernel
def turning_room(room: float, angle: float) -> float:
    """Width [m] that soles need besides when one is turned by `angle` [rad] against the other; `room` by 90°."""
    return room * abs(np.sin(angle))


@kernel
def _walking_step(
    positions: Vector,
    yaws: Vector,
    last: int,
    command: Vector,
    period: float,
    step_width: float,
    room: float,
    narrowest: float,
) -> tuple[int, Vector, float]:
    """Which foot goes, where to (3,) [m] and its yaw [rad], from feet at `positions` (2, 3), `yaws` (2,).

    Args:
        last: side of the foot that moved last, -1: none.
        command: (3,) forward, left [m/s], yaw rate [rad/s].
        period: [s] of one step.
        step_width, narrowest: [m]; `room` as in `turning_room`.
    """
    vx, vy, omega = command
    sideways, turning = 0 if vy >= 0.0 else 1, 0 if omega >= 0.0 else 1  # the foot that takes each motion
    side = (sideways if abs(vy) >= 0.1 * abs(omega) else turning) if last < 0 else 1 - last
    stance, sign = 1 - side, 1.0 if side == 0 else -1.0
    start = yaws[stance]
    yaw = start + (2.0 * period * omega if side == turning else 0.0)
    # lateral and turning motion are taken by one foot, for two steps; the forward one by both
    width = step_width + turning_room(room, yaw - start)
    offset = np.array([vx * period, sign * width + (2.0 * period * vy if side == sideways else 0.0)])
    c, s = np.cos(0.5 * (start + yaw)), np.sin(0.5 * (start + yaw))
    shift = np.dot(np.array([[c, -s], [s, c]]), offset)
    apart = sign * np.array([-np.sin(start), np.cos(start)])
    short = max(narrowest - np.dot(apart, shift), 0.0)  # in a fast turn backwards
    position = positions[stance].copy()
    for axis in range(2):
        position[axis] += shift[axis] + short * apart[axis]
    return side, position, yaw


@kernel
def _velocities(command_times: Vector, commands: Vector, headings: Vector, times: Vector) -> Vector:
    out = np.zeros((len(times), 2))
    for k in range(len(times)):
        given = np.searchsorted(command_times, times[k] + 1e-9, side="right")
        if given > 0:
            forward, left = commands[given - 1, 0], commands[given - 1, 1]
            c, s = np.cos(headings[k]), np.sin(headings[k])
            out[k, 0], out[k, 1] = c * forward - s * left, s * forward + c * left
    return out
