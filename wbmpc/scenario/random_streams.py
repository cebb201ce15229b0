"""The random numbers of a run: one independent stream for each thing that draws, all from the scenario's seed."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Who draws. A number, once given, stays: it decides what a seed draws."""

    SENSOR_NOISE = 1
    TILES = 2
    GROUND_ERROR = 3
    OPERATOR = 4


def generator(seed: int, stream: Stream) -> np.random.Generator:
    """A new generator at the beginning of a stream; nothing that another stream draws can change it."""
    return np.random.default_rng(np.random.SeedSequence([seed, int(stream)]))
