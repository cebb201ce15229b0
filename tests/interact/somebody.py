"""A process of a test: the window opens, somebody pulls the torso as the mouse does, moves the target, closes it.

Prints what the run has recorded of that, as JSON.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import mujoco
import numpy as np

from wbmpc.checks.context import CheckContext
from wbmpc.checks.momentum import MomentumBalanceCheck
from wbmpc.facts import facts_of
from wbmpc.interact.controls import Key
from wbmpc.interact.exchange import Frame, Inputs
from wbmpc.interact.operator import Operator
from wbmpc.interact.window import Window
from wbmpc.realtime import run_realtime
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import build_world, load_scenario, resolve_patches, robot_path
from wbmpc.warm_up import compile_kernels

TARGET = (0.15, 0.13, 0.30)  # needs no contact
PULL, KEYS = range(3, 9), 10  # frames, since a machine without a graphics card draws how few it likes
STAY = 1.5  # [s] simulated, from the keys to the end


class Somebody(Window):
    """Does to MuJoCo's viewer what mouse and keyboard do to it, at set frames."""

    frames, pressed = 0, float("inf")  # pressed: when the keys were [s]

    def exchange(self, frame: Frame) -> Inputs:
        time, perturb = self.time(), self.viewer.perturb
        with self.viewer.lock():
            body = self._model.body("torso").id
            perturb.select, perturb.localpos[:] = body, 0.0
            if self.frames in PULL:
                perturb.localmass = self._model.body_mass[body]  # as mjv_initPerturb finds it, from the drawn scene
                perturb.refselpos[:] = self._data.xpos[body] + [0.02, 0.0, 0.0]
                perturb.active = mujoco.mjtPertBit.mjPERT_TRANSLATE
            else:
                perturb.active = 0
        if self.frames == KEYS:
            self.pressed = time
            for _ in range(4):
                self.key_callback(Key.UP.value)
        if time >= self.pressed + STAY:
            self.viewer.close()
        self.frames += 1
        return super().exchange(frame)


def main(out: str) -> None:
    scenario = load_scenario(Path("scenarios/reach.yaml"), {})
    task = scenario.tasks[0].model_copy(
        update={"target": TARGET, "hand": "left", "start": 0.1, "arrive_by": 1.0, "hold": 60.0}
    )
    loop = scenario.loop.model_copy(update={"realtime_planner": "thread"})
    scenario = scenario.model_copy(update={"tasks": (task,), "duration": 20.0, "loop": loop})
    robot, model = Robot.load(robot_path(scenario)), build_world(scenario, robot_path(scenario))
    recorder = Recorder(robot, expected_ticks=3000, plant_nq=model.nq, plant_nv=model.nv)
    compile_kernels()  # drawing without a graphics card leaves little of the cores for that
    window = Somebody(scenario)
    window.time = lambda: float(recorder.time[-1]) if recorder.ticks else 0.0
    window.key_callback = window._keys.append
    # Half the pace: the planner of a busy machine keeps up better.
    operator = Operator(window, scenario, pace=0.5)
    run_realtime(scenario, robot=robot, recorder=recorder, model=model, operator=operator)
    window.close()
    facts = facts_of(model, robot, scenario, resolve_patches(scenario))
    balance = MomentumBalanceCheck(scenario.universal.momentum_balance)
    pushed = recorder.external_force.any(axis=1)
    answer = {
        "ticks": recorder.ticks,
        "pushed": int(pushed.sum()),
        "largest": float(np.abs(recorder.external_force).max()),
        "forwards": bool(recorder.external_force[pushed].mean(axis=0)[0] > 0.0),
        "goal": float(np.nanmax(recorder.plans[-1].hand_reference[0, :, 0])),
        "balance": balance.evaluate(CheckContext(recorder, facts), "momentum_balance").passed,
        "events": [event.text for event in recorder.events],
        "drawn": int(window.viewer.user_scn.ngeom),
    }
    Path(out).write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
