"""MuJoCo's viewer on a copy of the run's state: what is done in it reaches the run only as `Inputs`."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections import deque
from typing import Any, Protocol

import mujoco
import numpy as np

from wbmpc.errors import WbmpcError
from wbmpc.interact.exchange import Frame, Inputs, MousePush
from wbmpc.interact.overlay import draw, shapes_of
from wbmpc.pool import Died, Worker
from wbmpc.scenario import Scenario, build_world, resolve_patches, robot_path

DISTANCE, AZIMUTH, ELEVATION = 1.2, 130.0, -15.0  # [m], [deg], [deg] of the camera at first
CLOSING = 10.0  # [s] for the last frame


class AnyWindow(Protocol):
    """A window, wherever it is drawn."""

    def exchange(self, frame: Frame) -> Inputs | None:
        """Give a frame, take what was done since the one before; None: the window is still busy with that one."""
        ...

    def close(self) -> None: ...


class Window:
    """The window itself, in the process that it is drawn by.

    MuJoCo draws in a thread of its own. It may write into the data that it is given (a reset by its own menu, sliders);
    here that is a copy, which the next frame overwrites.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Open it.

        Raises:
            WbmpcError: there is no display, or the viewer cannot be had on it.
        """
        viewer = _viewer_module()
        self._model = build_world(scenario, robot_path(scenario))
        self._data = mujoco.MjData(self._model)
        self._patches = resolve_patches(scenario)
        self._keys: deque[int] = deque()
        self._caption = ("", "")
        others = threading.enumerate()
        self.viewer = viewer.launch_passive(
            self._model, self._data, key_callback=self._keys.append, show_left_ui=False, show_right_ui=False
        )
        self._drawing = [thread for thread in threading.enumerate() if thread not in others]
        camera = self.viewer.cam
        camera.distance, camera.azimuth, camera.elevation = DISTANCE, AZIMUTH, ELEVATION
        camera.lookat[:] = self._data.subtree_com[1]

    def exchange(self, frame: Frame) -> Inputs:
        """Draw a frame. See `AnyWindow`."""
        viewer, data = self.viewer, self._data
        if not viewer.is_running():
            return Inputs(closed="the window was closed")
        data.qpos[:], data.qvel[:], data.ctrl[:] = frame.qpos, frame.qvel, frame.control
        mujoco.mj_forward(self._model, data)
        with viewer.lock():
            draw(viewer.user_scn, shapes_of(frame, self._patches))
        if frame.caption != self._caption:  # it waits until a frame is drawn
            self._caption = frame.caption
            viewer.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPLEFT, *frame.caption))
        viewer.sync()  # which also turns a drag of the mouse into a force, in the copy
        keys = tuple(self._keys.popleft() for _ in range(len(self._keys)))
        return Inputs(keys, push_of(self._model, data, viewer.perturb))

    def close(self) -> None:
        """Close the window and wait until it is gone, as drawing at Python's end would crash; may be called twice."""
        self.viewer.close()
        for thread in self._drawing:
            thread.join(CLOSING)


def push_of(model: mujoco.MjModel, data: mujoco.MjData, perturb: mujoco.MjvPerturb) -> MousePush | None:
    """The pull of a drag: MuJoCo's spring between the grabbed point and the mouse; None: nothing is pulled.

    A drag that turns a body is none: a pure moment is not what a disturbance of a scenario is.
    """
    body = int(perturb.select)
    if not perturb.active & mujoco.mjtPertBit.mjPERT_TRANSLATE or body <= 0:
        return None
    data.xfrc_applied[:] = 0.0
    mujoco.mjv_applyPerturbForce(model, data, perturb)
    force = data.xfrc_applied[body, :3].copy()
    data.xfrc_applied[:] = 0.0
    return MousePush(body, force, np.array(perturb.localpos)) if force.any() else None


class WindowProcess:
    """The window in a process of its own: drawing takes no turns of the ticks' interpreter."""

    def __init__(self, scenario: Scenario) -> None:
        """Open it and wait until it is there.

        Raises:
            WbmpcError: there is no display, or the window's process has ended instead.
        """
        _ask_for_display()
        self._worker: Worker[Any, Any] = Worker(_serve, 0, scenario)
        opened = self._worker.result()
        if isinstance(opened, Died):
            raise WbmpcError(f"the window did not open: {opened.reason}")
        self._gone = ""
        self._busy = False

    def exchange(self, frame: Frame) -> Inputs | None:
        """See `AnyWindow`; never waits."""
        if self._gone:
            return Inputs(closed=self._gone)
        if self._busy:
            if not self._worker.connection.poll():
                return None
            answer = self._worker.result()
            inputs = Inputs(closed=f"the window is gone: {answer.reason}") if isinstance(answer, Died) else answer
            self._gone = inputs.closed
        else:
            inputs = Inputs()
        self._busy = True
        self._worker.give(0, frame)
        return inputs

    def close(self) -> None:
        """Close the window, and end its process."""
        self._worker.end()


def open_window(scenario: Scenario) -> AnyWindow:
    """The window of a run, in a process of its own where the system allows that (macOS: `mjpython` shows only its own).

    Raises:
        WbmpcError: there is no display, or the viewer cannot be had on it.
    """
    return Window(scenario) if sys.platform == "darwin" else WindowProcess(scenario)


_window: Window | None = None  # of this process, when it is the window's


def _serve(item: Scenario | Frame) -> Inputs:
    """In the window's process: open it, or show a frame."""
    global _window
    if isinstance(item, Scenario):
        _window = Window(item)
        return Inputs()
    assert _window is not None
    return _window.exchange(item)


def _ask_for_display() -> None:
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise WbmpcError("no display here: DISPLAY and WAYLAND_DISPLAY are not set (`wbmpc run` needs none)")


def _viewer_module() -> Any:
    """mujoco.viewer, once it is known that it will not wait for a window that never comes."""
    _ask_for_display()
    try:
        import glfw
        import mujoco.viewer
    except (ImportError, RuntimeError) as error:
        raise WbmpcError(f"MuJoCo's viewer cannot be had: {error}") from None
    if sys.platform == "darwin":
        if mujoco.viewer._MJPYTHON is None:
            raise WbmpcError("on macOS MuJoCo's viewer needs its own Python: mjpython -m wbmpc interact SCENARIO")
        return mujoco.viewer
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)  # it warns of what is said here in a line
        there = glfw.init()
    if not there:
        display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
        raise WbmpcError(f"no display here: {display} cannot be opened")
    return mujoco.viewer
