"""The environment in which stage 3 meets its peers: this project's pinned packages, and Gurobi and SCIP beside them.

    python -m benchmarks.stage3_env          makes .venv-peers-stage3, anew when its requirements have changed
    python -m benchmarks.stage3_env --lock   pins requirements/peers_stage3.in anew

Gurobi's own licence of limited size comes with its package and needs no network.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / ".venv-peers-stage3"
PYTHON = FOLDER / "bin" / "python"
SOURCE = ROOT / "requirements" / "peers_stage3.in"
PINNED = SOURCE.with_suffix(".txt")
REQUIREMENTS = (ROOT / "requirements" / "run.txt", PINNED)
STAMP = FOLDER / ".synced"


def lock() -> None:
    """Pin the newest peers that fit the package's own pins."""
    _uv(
        "pip", "compile", str(SOURCE.relative_to(ROOT)), "--quiet", "--generate-hashes", "--no-emit-index-url",
        "--python-version", "3.11", "--custom-compile-command", "python -m benchmarks.stage3_env --lock",
        "--output-file", str(PINNED.relative_to(ROOT)),
    )  # fmt: skip


def make() -> Path:
    """The environment's interpreter, installed first where that is needed."""
    if not STAMP.exists() or any(path.stat().st_mtime > STAMP.stat().st_mtime for path in REQUIREMENTS):
        subprocess.run([sys.executable, "-m", "venv", str(FOLDER)], check=True)
        _uv("pip", "sync", "--require-hashes", *map(str, REQUIREMENTS))
        STAMP.touch()
    return PYTHON


def _uv(*arguments: str) -> None:
    uv = Path(sys.executable).with_name("uv")  # where `make setup` has put it
    environment = {**os.environ, "VIRTUAL_ENV": str(FOLDER)}
    subprocess.run([str(uv if uv.exists() else "uv"), *arguments], check=True, cwd=ROOT, env=environment)


def main() -> None:
    """Make or lock."""
    parser = argparse.ArgumentParser(description="The environment of benchmarks.stage3_peers.")
    parser.add_argument("--lock", action="store_true", help="only pin the requirements anew")
    if parser.parse_args().lock:
        lock()
    else:
        print(f"{make().relative_to(ROOT)} -m benchmarks.stage3_peers")


if __name__ == "__main__":
    main()
