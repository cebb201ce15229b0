"""What the tasks ask of the feet: the next footstep from where the feet stand."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import CAREFUL_LEAD, SIDE_SIGN, Feet, Footstep
from wbmpc.planner.journey import Journey
from wbmpc.planner.settings import GaitSettings
from wbmpc.rotations import angle_difference, plane_rotation
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
        self._command_times = np.array([command.time for command in commands])  # [s]
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
        given = np.flatnonzero(self._command_times <= time + 1e-9)
        return self._commands[given[-1]] if given.size else None

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
        out = np.zeros((len(times), 2))
        if not len(self._commands):
            return out
        given = self._command_times <= times[:, None] + 1e-9  # (n, commands); the last one counts
        latest = given.shape[1] - 1 - np.argmax(given[:, ::-1], axis=1)
        forward, left = self._commands[latest, :2].T * given.any(axis=1)
        c, s = np.cos(headings), np.sin(headings)
        out[:, 0], out[:, 1] = c * forward - s * left, s * forward + c * left
        return out

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
        moving = float(np.abs(command).max()) > STILL
        if not moving and (feet.last < 0 or feet.aligned):
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
        shift = plane_rotation(0.5 * (float(feet.yaws[stance]) + yaw)) @ offset
        apart = SIDE_SIGN[side] * plane_rotation(float(feet.yaws[stance]))[:, 1]
        position = feet.positions[stance].copy()
        position[:2] += shift + max(settings.narrowest - float(apart @ shift), 0.0) * apart  # a fast turn backwards
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
