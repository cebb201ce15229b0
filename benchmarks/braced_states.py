"""States and setpoints of `reach` while a hand braces: what trackers are compared on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.replaced import replaced
from wbmpc.loop import run_lockstep
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import load_scenario, robot_path
from wbmpc.signals import HandMode, RobotState, Setpoint, TorqueCommand
from wbmpc.tracker.tracker import Tracker

REACH = Path(__file__).parents[1] / "scenarios" / "reach.yaml"
STARTS = (6.5, 7.5, 8.5, 9.5)  # [s] when to begin recording: leaning further, and the hold
TICKS = 100  # recorded from each start


@dataclass(frozen=True)
class Ticks:
    """Consecutive ticks of the tracker, in stretches of TICKS."""

    robot: Robot
    step: float  # [s]
    states: list[RobotState]
    setpoints: list[Setpoint]

    @property
    def brace(self) -> int:
        """Side of the palm that braces, the same in all ticks."""
        modes = np.array([setpoint.hand_mode for setpoint in self.setpoints])
        braced = (modes == HandMode.CONTACT).all(axis=0)
        if braced.sum() != 1 or not all(setpoint.foot_stance.all() for setpoint in self.setpoints):
            raise RuntimeError("no stretch of `reach` with both feet and one hand in contact where one was")
        return int(braced.argmax())


class _Enough(Exception):
    """All ticks are recorded."""


def record() -> Ticks:
    """Run `reach` in lockstep and keep what its tracker was asked in the stretches of STARTS."""
    scenario = load_scenario(REACH)
    robot, step = Robot.load(robot_path(scenario)), scenario.loop.timestep
    recorder = Recorder(robot, expected_ticks=round(scenario.duration * scenario.loop.physics_rate))
    ticks = Ticks(robot, step, [], [])

    def listening(solve: Callable[..., TorqueCommand]) -> Callable[..., TorqueCommand]:
        def listen(tracker: Tracker, state: RobotState, setpoint: Setpoint) -> TorqueCommand:
            tick = round(state.time / step)
            if any(0 <= tick - round(start / step) < TICKS for start in STARTS):
                ticks.states.append(deepcopy(state))
                ticks.setpoints.append(deepcopy(setpoint))
            elif tick > STARTS[-1] / step:
                raise _Enough
            return solve(tracker, state, setpoint)

        return listen

    with replaced(Tracker, "solve", listening), suppress(_Enough):
        run_lockstep(scenario, robot=robot, recorder=recorder)
    return ticks


def plain(ticks: Ticks) -> Ticks:
    """The same ticks without what only this project's tracker knows: obstacles of the arms, urgency, a mass
    estimate."""
    keep_out = np.array(ticks.setpoints[0].arm_keep_out)
    keep_out[..., 3] = -np.inf
    return replace(
        ticks,
        states=[replace(state, mass_scale=1.0) for state in ticks.states],
        setpoints=[replace(s, arm_keep_out=keep_out, hand_urgency=np.zeros(2)) for s in ticks.setpoints],
    )
