"""How hot loops are compiled: one decorator, machine code cached beside the source."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` at its first call, without the interpreter's lock, and keep the code for the next process.

    Arithmetic is that of the source: no reordering (`fastmath` off), 1/0 is inf as in numpy.
    """
    compiled: F = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled
