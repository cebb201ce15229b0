"""Stretches of time in which something holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def stretches(active: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """[start, stop) of every run of true entries in `active` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(active, dtype=np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def joined(active: NDArray[np.bool_], gap: int) -> list[tuple[int, int]]:
    """[start, stop) of the stretches of `active` (n,); those less than `gap` entries apart are one."""
    found: list[tuple[int, int]] = []
    for start, stop in stretches(active):
        if found and start - found[-1][1] < gap:
            found[-1] = (found[-1][0], stop)
        else:
            found.append((start, stop))
    return found
