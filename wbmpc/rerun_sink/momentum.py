"""The centroidal momentum rate that really was: differences of the simulator's momentum, whatever made it change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class MomentumRate:
    """Mean rates between samples; remembers the last sample, so that blocks join."""

    def __init__(self, model: Any) -> None:
        """`model`: compiled MjModel of robot and world; the robot is what hangs on its first joint."""
        self._mass = float(model.body_subtreemass[model.jnt_bodyid[0]])
        self._last: tuple[float, FloatArray] | None = None

    def between(self, time: FloatArray, velocity: FloatArray, angular: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates since the sample before, over samples at `time` (n,) [s].

        Args:
            velocity: (n, 3) [m/s] of the CoM.
            angular: (n, 3) [N·m·s] angular momentum about the CoM.

        Returns:
            Times (m,) [s] in the middle of each interval, and rates (m, 6) in world: linear [N], and angular about the
            CoM [N·m]. m = n, one less in the first call.
        """
        momentum = np.hstack([self._mass * velocity, angular])
        if self._last is not None:
            time, momentum = np.append(self._last[0], time), np.vstack([self._last[1], momentum])
        if len(time):
            self._last = float(time[-1]), momentum[-1]
        step = np.diff(time)
        return time[:-1] + 0.5 * step, np.diff(momentum, axis=0) / step[:, None]
