"""Kernels: cached, compiled anew when what they call has changed, alive without a cache and without a compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numba
import pytest

from wbmpc import jit

ROOT = Path(__file__).parents[1]
CALLEE = "from wbmpc.jit import short_kernel\n\n@short_kernel\ndef share(x):\n    return {factor} * x\n"
CALLER = "from callee import share\nfrom wbmpc.jit import kernel\n\n@kernel\ndef twice(x):\n    return 2.0 * share(x)\n"


def printed(code: str, folder: Path, **environment: str) -> str:
    """What a fresh interpreter prints that finds modules in `folder` too."""
    path = os.pathsep.join([str(ROOT), str(folder)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_a_changed_callee_in_another_file_compiles_its_caller_anew(tmp_path: Path) -> None:
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=3.0))
    (tmp_path / "caller.py").write_text(CALLER)
    code = "import caller; print(caller.twice(1.0), sum(caller.twice.stats.cache_hits.values()))"
    assert printed(code, tmp_path) == "6.0 0"
    assert printed(code, tmp_path) == "6.0 1"
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=50.0))
    assert printed(code, tmp_path) == "100.0 0"


def test_a_caller_can_be_compiled_after_its_callee_has_forgotten_its_source(tmp_path: Path) -> None:
    (tmp_path / "callee.py").write_text(CALLEE.format(factor=3.0))
    (tmp_path / "caller.py").write_text(CALLER)
    load = "import callee; callee.share(1.0); "
    printed(load, tmp_path)
    forget = "from wbmpc.jit import forget_sources; forget_sources(); forget_sources(); "
    code = f"{load}{forget}import caller; print(caller.twice(1.0), sum(callee.share.stats.cache_hits.values()))"
    assert printed(code, tmp_path) == "6.0 1"


def test_without_a_compiler_kernels_are_plain_python(tmp_path: Path) -> None:
    code = (
        "import numpy as np; from wbmpc.loop import within; "
        "print(within(np.array([1.0, -2.0]), 3.0), within(np.array([np.nan]), 3.0), hasattr(within, 'signatures'))"
    )
    assert printed(code, tmp_path, NUMBA_DISABLE_JIT="1") == "True False False"


@pytest.mark.parametrize("decorate", [jit.kernel, jit.short_kernel])
def test_where_no_code_can_be_kept_kernels_compile_all_the_same(
    decorate: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = numba.njit

    def no_place(*, cache: bool = False, **options: object) -> object:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return original(**options)

    monkeypatch.setattr(jit, "numba", SimpleNamespace(njit=no_place))
    halved = decorate(lambda x: 1.0 / x)  # type: ignore[operator]
    jit.KERNELS.remove(halved)
    assert halved(4.0) == 0.25
    assert halved(0.0) == float("inf")  # as in numpy, no exception


def test_nothing_is_compiled_in_the_middle_of_a_run(tmp_path: Path) -> None:
    """A kernel that meets a new combination of types or memory layouts would stop the ticks for seconds."""
    code = """
import sys
sys.path.insert(0, {tests!r})
from short_run import finished, short
from wbmpc.jit import KERNELS
from wbmpc.warm_up import compile_kernels

compile_kernels()
compiled = [len(kernel.signatures) for kernel in KERNELS]
for name in {names}:
    finished(short(name, duration=0.9))
for kernel, before in zip(KERNELS, compiled):
    if len(kernel.signatures) > before:
        print(kernel.py_func.__module__, kernel.py_func.__name__, kernel.signatures)
"""
    names = ["two_hands", "walk", "push_wall", "stairs", "box_lift"]
    assert printed(code.format(tests=str(ROOT / "tests"), names=names), tmp_path) == ""
