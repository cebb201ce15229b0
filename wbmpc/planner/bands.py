"""Where the CoM may be so that hands and feet reach: |R − C| ≤ d of every end-effector, as one band per axis."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.settings import HeightSettings
from wbmpc.signals import Vector

UNBOUNDED = 0.3  # [m] d of a hand that does not bind the CoM
NO_FOOT = np.empty((0, 0, 2))


def height_band(settings: HeightSettings, references: Vector, distance: Vector, plane: float) -> Vector:
    """Admissible band (N, 2) of the CoM height [m]: the legs' range, narrowed by |c_z − r_z| ≤ d of the hands.

    Args:
        references: (ends, N, 3) their references, nan for a free one ([M] eq. QP1).
        distance: (ends,) d of each [m].
        plane: height of the feet [m].
    """
    return _between(references, distance, plane + settings.lowest, plane + settings.highest)


@kernel
def _between(references: Vector, distance: Vector, lowest: float, highest: float) -> Vector:
    ends, n = references.shape[0], references.shape[1]
    band = np.empty((n, 2))
    for k in range(n):
        low, high = lowest, highest
        for end in range(ends):
            z = references[end, k, 2]
            if not np.isnan(z):
                low, high = max(low, z - distance[end]), min(high, z + distance[end])
        band[k, 0], band[k, 1] = low, high
    return band


@kernel
def horizontal_band(palms: Vector, distance: Vector, foot: Vector, foot_distance: Vector) -> Vector:
    """Admissible band (2, N, 2) of the horizontal CoM: axis, knot, lowest and highest [m]; ±inf where nothing binds.

    Args:
        palms: (hands, N, 3) references in world [m], nan rows for free ones.
        distance: (hands, 2) d of each, per axis [m].
        foot: (feet, N, 2) places of a foot on its way [m]; `NO_FOOT` without one.
        foot_distance: (feet, N, 2) its d [m].

    Where two end-effectors disagree the band is the point between their bounds.
    """
    n = palms.shape[1]
    band = np.empty((2, n, 2))
    for axis in range(2):
        for k in range(n):
            low, high = -np.inf, np.inf
            for hand in range(len(palms)):
                place, d = palms[hand, k, axis], distance[hand, axis]
                if not np.isnan(place):
                    low, high = max(low, place - d), min(high, place + d)
            for i in range(len(foot)):
                place, d = foot[i, k, axis], foot_distance[i, k, axis]
                low, high = max(low, place - d), min(high, place + d)
            if low > high:
                low = high = 0.5 * (low + high)
            band[axis, k, 0], band[axis, k, 1] = low, high
    return band
