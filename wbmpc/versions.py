"""Versions of everything that a result depends on; imports none of it."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

VERSIONED = ("wbmpc", "mujoco", "pin", "numpy", "scipy", "daqp", "osqp", "qpsolvers", "highspy", "rerun-sdk")


def versions() -> dict[str, str]:
    """Version by package name, Python's first; "absent" when a package is not installed."""
    found = {"python": platform.python_version()}
    for name in VERSIONED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    return found
