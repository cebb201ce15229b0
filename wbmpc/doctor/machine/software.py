"""Python, packages, settings of threads, compiled code, disk."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

from packaging.requirements import Requirement

from wbmpc.doctor.check import Answer
from wbmpc.pool import THREADS

LEAST_PYTHON = (3, 11)
LITTLE, TOO_LITTLE = 2e9, 1e8  # [byte] of disk; a recording has some 10 MB for 15 s


def python(_: None = None) -> Answer:
    """The interpreter."""
    found = ".".join(str(part) for part in sys.version_info[:3])
    wanted = ".".join(str(part) for part in LEAST_PYTHON)
    old = [f"Python {found}, at least {wanted} needed"] if sys.version_info < LEAST_PYTHON else []
    inside = "in a virtual environment" if sys.prefix != sys.base_prefix else "no virtual environment"
    return Answer(f"{found}, {sys.implementation.name}, {inside}", old)


def packages(_: None = None) -> Answer:
    """What this project declares to need, against what is installed."""
    try:
        declared = requires("wbmpc") or []
    except PackageNotFoundError:
        return Answer("", (), ["wbmpc is not installed, only found on the path: its requirements are not known"])
    return compared([Requirement(text) for text in declared])


def compared(requirements: list[Requirement]) -> Answer:
    """Versions of requirements that apply here; extras are not looked at."""
    wanted = [item for item in requirements if item.marker is None or item.marker.evaluate({"extra": ""})]
    found, failures = [], []
    for item in wanted:
        try:
            here = version(item.name)
        except PackageNotFoundError:
            failures.append(f"{item.name} is not installed, {item.specifier or 'any version'} needed")
            continue
        found.append(f"{item.name} {here}")
        if not item.specifier.contains(here, prereleases=True):
            failures.append(f"{item.name} {here}, {item.specifier} needed")
    return Answer(", ".join(found), failures)


def threads(_: None = None) -> Answer:
    """Threads of the linear algebra: the matrices are small."""
    return threads_of(environment_at_start())


def threads_of(environment: Mapping[str, str]) -> Answer:
    """What the user's variables ask for; `wbmpc` itself takes one thread whatever they say."""
    many = [f"{name}={environment[name]}" for name in THREADS if environment.get(name, "1") != "1"]
    words = f"{', '.join(many)}: `wbmpc` takes 1 all the same, but a program that imports it does not"
    return Answer("one each", (), [words] if many else [])


def environment_at_start() -> Mapping[str, str]:
    """The variables that this process was given, before the program set some itself."""
    try:
        entries = Path("/proc/self/environ").read_bytes().split(b"\0")
    except OSError:  # no Linux
        return os.environ
    return dict(entry.decode(errors="replace").split("=", 1) for entry in entries if b"=" in entry)


def kernels(_: None = None) -> Answer:
    """Whether the hot loops' machine code is there, and can be kept."""
    import wbmpc.warm_up  # noqa: F401  # imports them all
    from wbmpc.jit import KERNELS, uncached

    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return Answer("", (), ["NUMBA_DISABLE_JIT is set: the hot loops run as plain Python, a hundred times slower"])
    missing = uncached()
    words = f"{len(KERNELS) - missing} of {len(KERNELS)} hot loops compiled"
    return Answer(words, (), [f"{words}, the others at the first run: about a minute"] if missing else [])


def disk(_: None = None) -> Answer:
    """Space for recordings, here."""
    return space(shutil.disk_usage(Path.cwd()).free)


def space(free: float) -> Answer:
    """Free bytes, judged."""
    words = f"{free / 1e9:.1f} GB free in the working directory"
    if free < TOO_LITTLE:
        return Answer("", [words])
    return Answer(words, (), [words] if free < LITTLE else [])
