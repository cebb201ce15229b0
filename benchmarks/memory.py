"""Memory of a long run: peak, and growth per simulated second against the recording's.

    python -m benchmarks memory

Each run has a process of its own (`python -m benchmarks.memory SECONDS [FILE.rrd]`), so that a peak is that run's.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.report import Section, Table
from wbmpc.recorder import Recorder
from wbmpc.scenario import load_scenario
from wbmpc.session import run_scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SCENARIO, SECONDS = "reach", 60.0
SETTLED = 0.25  # share of a run after which its growth is fitted: libraries are loaded, tables have grown
MEGABYTE = 1e6
NOTE = f"""`{SCENARIO}` prolonged to {SECONDS:g} simulated seconds; it stands after the reach. Growth is a line fitted
to the resident memory, looked at twice a simulated second, after the first quarter. The recorder keeps what
happened at every tick of a run in memory, because checks read it, and the controller's signals as often as the
recording shows them: these columns, the contacts, 64 bytes each, and the plans with what they were made from, about
7 kB each, are what a second must add. The peak is while the checks judge the run, a block of ticks after another."""


def resident() -> float:
    """Resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def _peak() -> float:
    """Most resident memory of this program so far [MB]; `ru_maxrss` would count its parent's from before its start."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024 / MEGABYTE


def run(seconds: float, recording: Path | None) -> dict[str, Any]:
    """One run in this process."""
    samples: list[tuple[float, float]] = []
    scenario = load_scenario(SCENARIOS / f"{SCENARIO}.yaml", {"duration": seconds})
    result = run_scenario(
        scenario, name=SCENARIO, recording=recording, on_progress=lambda time: samples.append((time, resident()))
    )
    return {
        "samples": samples,
        "peak": _peak(),
        "columns": _column_bytes(result.recorder) / MEGABYTE / seconds,
        "file": recording.stat().st_size / MEGABYTE / seconds if recording else 0.0,
    }


def _column_bytes(recorder: Recorder) -> int:
    return sum(recorder.column(name).nbytes for name in recorder.names)


def measure() -> Section:
    """One run with a recording, one without."""
    table = Table(
        ("run", "peak, MB", "at first, MB", "at the end, MB", "growth, MB/s", "columns, MB/s", "recording, MB/s")
    )
    with TemporaryDirectory() as folder:
        for kind, paths in (("with a recording", [str(Path(folder) / "run.rrd")]), ("without", [])):
            command = [sys.executable, "-m", "benchmarks.memory", str(SECONDS), *paths]
            answer = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            times, memory = np.array(answer["samples"]).T
            settled = times > SETTLED * SECONDS
            growth = np.polyfit(times[settled], memory[settled], 1)[0]
            numbers = (answer["peak"], memory[0], memory[-1])
            rates = (growth, answer["columns"], answer["file"])
            table.rows.append((kind, *(f"{x:.0f}" for x in numbers), *(f"{x:.2f}" for x in rates)))
    return Section("memory", "Memory of a long run", [table], [NOTE])


if __name__ == "__main__":
    print(json.dumps(run(float(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)))
