"""What a check answers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbmpc.signals import Vector

RELATIVE_TOLERANCE = 1e-9  # a value that equals its threshold up to rounding is within it


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One row of the verdict."""

    name: str
    passed: bool
    value: float  # nan when it could not be measured, which never passes
    threshold: float
    unit: str
    message: str
    first_violation: float | None  # [s] when the threshold was first violated; None: never, or not a matter of time


def at_most(name: str, value: float, threshold: float, unit: str, message: str, *, when: float | None) -> CheckResult:
    """Pass when value <= threshold; nan and inf fail. `when` [s] is kept only by a failing result."""
    passed = math.isfinite(value) and value <= threshold + RELATIVE_TOLERANCE * abs(threshold)
    return CheckResult(name, passed, value, threshold, unit, message, None if passed else when)


def at_least(name: str, value: float, threshold: float, unit: str, message: str, *, when: float | None) -> CheckResult:
    """Pass when value >= threshold; nan and inf fail. `when` [s] is kept only by a failing result."""
    passed = math.isfinite(value) and value >= threshold - RELATIVE_TOLERANCE * abs(threshold)
    return CheckResult(name, passed, value, threshold, unit, message, None if passed else when)


def failed(name: str, threshold: float, unit: str, message: str, *, when: float | None = None) -> CheckResult:
    """A check that could not be measured."""
    return CheckResult(name, False, math.nan, threshold, unit, message, when)


def first_time(time: Vector, violated: ArrayLike) -> float | None:
    """Time [s] of the first true entry of `violated` (n,), None when there is none."""
    index = np.flatnonzero(np.asarray(violated))
    return float(time[index[0]]) if index.size else None
