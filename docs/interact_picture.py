"""The picture of docs/live.md: the window of `wbmpc interact` in the middle of a run; `make interact-picture`.

The run is made in lockstep up to then, so the picture is of no machine's speed. The window is the real one, on a
virtual display (needs Xvfb), whose frame buffer is a file.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from wbmpc.interact.operator import Operator
from wbmpc.interact.window import Window
from wbmpc.loop import Session, Turn, run_lockstep
from wbmpc.recorder import Recorder
from wbmpc.robot import Robot
from wbmpc.scenario import build_world, load_scenario, robot_path

HERE = Path(__file__).parent
TIME = 8.0  # [s] simulated
SCREEN = (1200, 840)  # [px] of which MuJoCo's window takes two thirds
DRAWING = 3.0  # [s] of the wall clock, without a graphics card


def photograph(screen: Path) -> Image.Image:
    """The window on a display whose screen is this file, in X's dump format (XWD): a header, a colour map, pixels."""
    content = screen.read_bytes()
    header = np.frombuffer(content, ">u4", 25)
    size, width, height, line, colours = (int(header[k]) for k in (0, 4, 5, 12, 19))
    pixels = np.frombuffer(content, np.uint8, line * height, size + 12 * colours).reshape(height, line)
    picture = pixels[:, : 4 * width].reshape(height, width, 4)[:, :, 2::-1]  # stored blue, green, red
    rows, columns = (np.flatnonzero(picture.any(axis=2).any(axis=axis)) for axis in (1, 0))  # the rest is black
    return Image.fromarray(picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy())


def show(session: Session, screen: Path) -> None:
    """Open the window on what the session has come to, and keep a picture of it."""
    scenario = load_scenario(HERE.parent / "scenarios" / "reach.yaml")
    window = Window(scenario)
    end = time.monotonic() + DRAWING
    while time.monotonic() < end:
        Operator(window, scenario).attend(session, None, 0)  # no slots: nobody changes the pace
        time.sleep(0.1)
    photograph(screen).save(HERE / "pictures" / "interact.webp", quality=82, method=6)
    window.close()


def main(screen: Path) -> None:
    """The run up to then, in the environment of the virtual display."""
    scenario = load_scenario(HERE.parent / "scenarios" / "reach.yaml")
    tick = round(TIME / scenario.loop.timestep)
    scenario = scenario.model_copy(update={"duration": TIME + scenario.loop.timestep})
    robot, model = Robot.load(robot_path(scenario)), build_world(scenario, robot_path(scenario))
    recorder = Recorder(robot, expected_ticks=tick + 1, plant_nq=model.nq, plant_nv=model.nv)
    turn = Turn(tick, lambda session: show(session, screen))
    run_lockstep(scenario, robot=robot, recorder=recorder, model=model, turn=turn)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            read, write = os.pipe()
            geometry = "x".join(map(str, SCREEN)) + "x24"
            command = ["Xvfb", "-displayfd", str(write), "-screen", "0", geometry, "-fbdir", folder, "-nolisten", "tcp"]
            server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
            os.close(write)
            try:
                with os.fdopen(read) as pipe:
                    environment = {**os.environ, "DISPLAY": f":{pipe.readline().strip()}", "LIBGL_ALWAYS_SOFTWARE": "1"}
                subprocess.run([sys.executable, __file__, f"{folder}/Xvfb_screen0"], env=environment, check=True)
            finally:
                server.terminate()
                server.wait()
        print(HERE / "pictures" / "interact.webp")
