"""Versions of everything that a result depends on; imports none of it."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

VERSIONED = ("wbmpc", "mujoco", "pin", "numpy", "numba", "scipy", "daqp", "osqp", "qpsolvers", "highspy", "rerun-sdk")


def versions() -> dict[str, str]:
    """Version by package name, Python's first; "absent" when a package is not installed."""
    found = {"python": platform.python_version()}
    for name in VERSIONED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    return found


def source_hash(root: Path | None = None) -> str:
    """Digest of the program's own source: rows of another version must not be mixed with new ones."""
    root = root or Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
