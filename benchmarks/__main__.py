"""Measure, print, and write down.

    python -m benchmarks [PART ...] [--write docs]

Without parts, all of them. Nothing here is a threshold: the numbers are the machine's. Trust the ratios, of blocks
that alternate within one run, and compare absolute times with the yardstick only, a fixed numpy kernel timed before
and after each part. `tracker` and `stages` need the peers' environment (`make peers`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from rich.console import Console

from benchmarks.report import Section, machine, write
from benchmarks.stopwatch import yardstick

PARTS = {  # name on the command line: module with `measure() -> Section`, imported when it is its turn
    "tracker": "tracker_peer",
    "stages": "stage_peers",
    "plan": "plan_peer",
    "growth": "growth",
    "realtime": "real_time",
    "memory": "memory",
    "runs": "runs",
    "backends": "backend_table",
    "profile": "profile_reach",
}


def main() -> None:
    """Run the parts that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure, print, and write down.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} [all]")
    parser.add_argument("--write", type=Path, metavar="DOCS", help="replace the sections of these parts in this folder")
    arguments = parser.parse_args()
    if unknown := [part for part in arguments.parts if part not in PARTS]:
        parser.error(f"no such part: {', '.join(unknown)} (choices: {', '.join(PARTS)})")
    console = Console(width=120, highlight=False)
    for part in arguments.parts or PARTS:
        measure: Callable[[], Section] = import_module(f"benchmarks.{PARTS[part]}").measure
        before = yardstick()
        section = measure()
        footer = f"{machine()}; yardstick {1e6 * before:.0f} µs before, {1e6 * yardstick():.0f} µs after"
        section.show(console)
        console.print(footer)
        if arguments.write:
            write(arguments.write, section, footer)


if __name__ == "__main__":
    main()
