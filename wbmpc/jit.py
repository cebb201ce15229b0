"""How hot loops are compiled: one decorator, machine code cached beside the source."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])
_STAMP = "_source_stamp"


def kernel(function: F) -> F:
    """Compile `function` at its first call, without the interpreter's lock, and keep the code for the next process.

    Arithmetic is that of the source: no reordering (`fastmath` off), 1/0 is inf as in numpy. With NUMBA_DISABLE_JIT=1
    kernels run as plain Python, for a debugger.
    """
    options = {"nogil": True, "error_model": "numpy"}
    try:
        compiled = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no folder to keep code in: every process compiles for itself
        compiled = numba.njit(**options)(function)
    stamp = _stamp(function)
    cache = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if hasattr(cache, _STAMP):  # numba itself looks at the file of the kernel only, not at those it calls
        setattr(cache, _STAMP, stamp)
    if not numba.config.DISABLE_JIT:
        setattr(compiled, _STAMP, stamp)
    answer: F = compiled
    return answer


def _stamp(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Age and size of the file that holds `function`, and of every other kernel's that it calls."""
    source = Path(inspect.getfile(function)).stat()
    names, known = function.__code__.co_names, function.__globals__
    called = [getattr(known[name], _STAMP) for name in names if hasattr(known.get(name), _STAMP)]
    return (source.st_mtime, source.st_size, *called)
