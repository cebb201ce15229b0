"""How hot loops are compiled: two decorators, machine code cached beside the source."""

from __future__ import annotations

import ctypes
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import binding as llvm

F = TypeVar("F", bound=Callable[..., Any])
_STAMP, _MODULE = "_source_stamp", "_shared_module"  # numba's own names
KERNELS: list[Any] = []  # all that this process has imported, in order


def kernel(function: F) -> F:
    """Compile `function` at its first call and keep the code for the next process; it gives up the interpreter's lock.

    For the planner's thread: the ticks go on while it runs. Arithmetic is that of the source: no reordering (`fastmath`
    off), 1/0 is inf as in numpy. With NUMBA_DISABLE_JIT=1 kernels run as plain Python, for a debugger.
    """
    return _compiled(function, nogil=True)


def short_kernel(function: F) -> F:
    """The same for the tick's thread, keeping the lock: to get it back from a busy planner takes longer than the work.

    Also for kernels that only other kernels call.
    """
    return _compiled(function, nogil=False)


def uncached() -> int:
    """How many of KERNELS have no code kept from an earlier process."""
    files = [getattr(getattr(kernel, "_cache", None), "_cache_file", None) for kernel in KERNELS]
    return sum(file is None or not file._load_index() for file in files)


def forget_sources() -> None:
    """Give back what loading the kernels has taken besides their machine code, some 50 MB.

    numba parses each cached kernel's bitcode and keeps it, for callers that are still to be compiled. Kept packed, it
    takes a tenth of that, and is parsed again when such a caller comes.
    """
    for compiled in KERNELS:
        for result in getattr(compiled, "overloads", {}).values():
            module = getattr(result.library, _MODULE, None)
            if isinstance(module, llvm.ModuleRef):
                setattr(result.library, _MODULE, _Packed(module))
                module.close()
    trim()


def trim() -> None:
    """Hand freed memory back to the system, where the C library can (glibc)."""
    give_back = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if give_back is not None:
        give_back(0)


class _Packed:
    """Bitcode in the place of an LLVM module that is linked into others, each time as a copy."""

    def __init__(self, module: llvm.ModuleRef) -> None:
        self._bitcode = module.as_bitcode()

    def as_bitcode(self) -> bytes:
        return self._bitcode

    def clone(self) -> llvm.ModuleRef:
        return llvm.parse_bitcode(self._bitcode)


def _compiled(function: F, *, nogil: bool) -> F:
    options = {"nogil": nogil, "error_model": "numpy"}
    try:
        compiled: F = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no folder to keep code in: every process compiles for itself
        compiled = numba.njit(**options)(function)
    cache = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if hasattr(cache, _STAMP):  # numba itself looks at the file of the kernel only, not at those it calls
        stamp = _stamp(function)
        setattr(cache, _STAMP, stamp)
        setattr(compiled, _STAMP, stamp)
    KERNELS.append(compiled)
    return compiled


def _stamp(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Age and size of the file that holds `function`, and of every other kernel's that it calls."""
    source = Path(inspect.getfile(function)).stat()
    names, known = function.__code__.co_names, function.__globals__
    called = [getattr(known[name], _STAMP) for name in names if hasattr(known.get(name), _STAMP)]
    return (source.st_mtime, source.st_size, *called)
