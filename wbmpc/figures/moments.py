"""The moments of a run that a strip of pictures should show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.figures.trace import TOUCH, Trace
from wbmpc.footage import Footage

FloatArray = NDArray[np.float64]
# One unit of difference between two moments, for each thing that can differ.
_POSTURE = 0.5  # [rad] root of the sum of squares over the joints
_PLACE = 0.08  # [m] of the base
_HAND = 2.0  # a hand that pushes, against one that does not
_TIME = 1.0  # the whole run: of two moments that look alike, the one farther from the others


def key_moments(footage: Footage, trace: Trace, count: int) -> list[float]:
    """At most `count` times [s], in order: the first, the last, and those that differ most from each other in between.

    Each further moment is the one farthest from all chosen so far (farthest-point sampling), in a distance over the
    joints, the base, which hands push, and time; then it moves to the stillest moment nearby: a hold rather than the
    way to it.
    """
    base, joints = footage.qpos[:, :3], footage.qpos[:, 7:]
    features = np.column_stack(
        [
            joints / _POSTURE,
            base / _PLACE,
            _HAND * (trace.hand_force > TOUCH),
            _TIME * footage.time / max(float(footage.time[-1]), 1e-9),
        ]
    )
    chosen = _farthest(features, count)
    return [float(footage.time[row]) for row in sorted({_stillest(features, row, chosen) for row in chosen})]


def _farthest(features: FloatArray, count: int) -> list[int]:
    """Rows of `features` (n, k): the first, the last, then always the one farthest from all chosen so far."""
    last = len(features) - 1
    chosen = [0, last][: min(count, last + 1)]
    distance = np.min([np.linalg.norm(features - features[k], axis=1) for k in chosen], axis=0)
    while len(chosen) < min(count, last + 1):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(features - features[chosen[-1]], axis=1))
    return chosen


def _stillest(features: FloatArray, row: int, chosen: list[int]) -> int:
    """The row of least motion about `row`, in the stretch that resembles no other chosen one more; ends stay ends."""
    if row in (0, len(features) - 1):
        return row
    distance = np.linalg.norm(features - features[row], axis=1)
    near = distance < 0.5 * min(distance[other] for other in chosen if other != row)
    first = row - int(np.argmin(near[row::-1]))  # the first and the last row are never near
    stop = row + int(np.argmin(near[row:]))
    speed = np.linalg.norm(np.gradient(features, axis=0), axis=1)[first + 1 : stop]
    return first + 1 + int(np.argmin(speed)) if len(speed) else row
