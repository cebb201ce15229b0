"""MuJoCo's steps, called without giving up the interpreter's lock.

MuJoCo's Python functions release the lock in every call. With a busy planner in another thread, getting it back takes
longer than the 20 µs of the call: four such calls made a tick of the threaded loop miss its slot.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import mujoco

_FOLDER = Path(mujoco.__file__).parent
# The library that the bindings have loaded; PyDLL keeps the lock, CDLL would release it.
_LIBRARY = ctypes.PyDLL(str(next(path for path in sorted(_FOLDER.glob("*mujoco.*")) if path.suffix != ".py")))


class Physics:
    """The steps of one model and its data."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._objects = (model, data)  # alive as long as their addresses are used
        self._arguments = ctypes.c_void_p(model._address), ctypes.c_void_p(data._address)

    def step1(self) -> None:
        """`mj_step1`: everything that depends on position and velocity."""
        _LIBRARY.mj_step1(*self._arguments)

    def step2(self) -> None:
        """`mj_step2`: actuation, constraint forces, integration."""
        _LIBRARY.mj_step2(*self._arguments)

    def subtree_velocity(self) -> None:
        """`mj_subtreeVel`: velocities of the bodies' subtrees."""
        _LIBRARY.mj_subtreeVel(*self._arguments)
