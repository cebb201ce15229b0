"""Wall times of methods of a run, without touching their code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from time import perf_counter
from typing import Any

import numpy as np


@contextmanager
def timed(*methods: tuple[type, str]) -> Iterator[list[list[float]]]:
    """Time every call of these methods; the answer holds one list of seconds for each of them, in order.

    A timer costs about a third of a microsecond a call.
    """
    samples: list[list[float]] = [[] for _ in methods]
    originals = [owner.__dict__[name] for owner, name in methods]

    def timer(original: Any, seconds: list[float]) -> Any:
        @wraps(original)
        def call(*args: Any, **kwargs: Any) -> Any:
            start = perf_counter()
            result = original(*args, **kwargs)
            seconds.append(perf_counter() - start)
            return result

        return call

    try:
        for (owner, name), original, seconds in zip(methods, originals, samples, strict=True):
            setattr(owner, name, timer(original, seconds))
        yield samples
    finally:
        for (owner, name), original in zip(methods, originals, strict=True):
            setattr(owner, name, original)


def yardstick(repeats: int = 2000) -> float:
    """Median time [s] of a fixed numpy kernel (a 64 × 64 product and its Cholesky factor): how fast the machine is."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(64, 64))
    seconds = np.empty(repeats)
    for k in range(repeats):
        start = perf_counter()
        np.linalg.cholesky(factor @ factor.T + 64.0 * np.eye(64))
        seconds[k] = perf_counter() - start
    return float(np.median(seconds))
