"""The command line that makes a run again."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path

from pydantic import JsonValue


def run_command(path: Path, *, seed: int | None, changes: Mapping[str, JsonValue]) -> str:
    """`wbmpc run PATH --seed SEED --set KEY=VALUE ...`, quoted for a POSIX shell; a seed of None is the scenario's."""
    words = ["wbmpc", "run", str(path)]
    if seed is not None:
        words += ["--seed", str(seed)]
    for key, value in changes.items():
        words += ["--set", f"{key}={json.dumps(value)}"]
    return shlex.join(words)
