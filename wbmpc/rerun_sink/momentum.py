"""The centroidal momentum rate that really was: differences of MuJoCo's momentum, whatever forces made it change."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class MomentumRate:
    """Mean rates between samples of the robot's state; remembers the last sample, so that blocks join."""

    def __init__(self, model: Any) -> None:
        """`model`: compiled MjModel of robot and world; the robot is what hangs on its first joint."""
        self._model, self._data = model, mujoco.MjData(model)
        self._root = int(model.jnt_bodyid[0])
        self._mass = float(model.body_subtreemass[self._root])
        self._last: tuple[float, FloatArray] | None = None

    def between(self, time: FloatArray, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates since the sample before, over samples at `time` (n,) [s] with `qpos` (n, nq), `qvel` (n, nv).

        Returns:
            Times (m,) [s] in the middle of each interval, and rates (m, 6) in world: linear [N], and angular about the
            CoM [N·m]. m = n, one less in the first call.
        """
        momentum = np.array([self._momentum(*state) for state in zip(qpos, qvel, strict=True)]).reshape(-1, 6)
        if self._last is not None:
            time, momentum = np.append(self._last[0], time), np.vstack([self._last[1], momentum])
        if len(time):
            self._last = float(time[-1]), momentum[-1]
        step = np.diff(time)
        return time[:-1] + 0.5 * step, np.diff(momentum, axis=0) / step[:, None]

    def _momentum(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        """(6,) linear [N·s] and angular about the CoM [N·m·s]."""
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        return np.concatenate([self._mass * data.subtree_linvel[self._root], data.subtree_angmom[self._root]])
