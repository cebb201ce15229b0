"""When the robot is down, and when it has been down for so long that the rest of the run tells nothing more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks.settings import NoFall
from wbmpc.recorder import Recorder

_Mask = NDArray[np.bool_]


def down(recorder: Recorder, config: NoFall, *, first: int = 0) -> tuple[_Mask, _Mask]:
    """Ticks from `first` on at which the CoM is too low (n,), and at which the torso is too far tilted (n,).

    What is not a number counts as down.
    """
    height = recorder.com[first:, 2] - recorder.sole_position[first:, :, 2].min(axis=1)
    return ~(height >= config.min_com_height), ~(recorder.torso_up[first:] >= config.min_torso_up)


class FallWatch:
    """Says when a run may end early: the robot has been down, without a break, for `stop_after`.

    `no_fall` has failed by then, whatever follows, so that no verdict turns from fail to pass.
    """

    def __init__(self, recorder: Recorder, config: NoFall, *, timestep: float) -> None:
        """`timestep` [s] of the recorder's ticks."""
        self._recorder, self._config = recorder, config
        self._ticks = None if config.stop_after is None else max(1, round(config.stop_after / timestep))

    def __call__(self) -> str | None:
        """The reason to end the run now; None: go on."""
        if self._ticks is None or self._recorder.ticks < self._ticks:
            return None
        low, tilted = down(self._recorder, self._config, first=self._recorder.ticks - self._ticks)
        if (low | tilted).all():
            return f"the robot has been down for {self._config.stop_after:g} s"
        return None
