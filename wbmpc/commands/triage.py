"""`wbmpc triage`: why recorded runs failed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from wbmpc.commands.exits import ExitCode
from wbmpc.commands.tables import cause_lines, console
from wbmpc.rerun_sink.reading import Recording
from wbmpc.triage import Triage
from wbmpc.triage import triage as first_cause
from wbmpc.triage.from_file import evidence_of


def triage(recordings: Sequence[Path], *, robot: Path | None) -> ExitCode:
    """Print the first cause of each recorded run's failure, and all that was found in order of time.

    To know why a run failed is no failure: the exit code is 0.

    Raises:
        WbmpcError: one of them is no recording, holds no sample, or its robot is gone or has changed.
    """
    for path in recordings:
        answer = first_cause(*evidence_of(Recording(path), robot=robot))
        if answer is None:
            print(f"{path}: every check passed", flush=True)
            continue
        _print_found(path, answer)
        for line in cause_lines(answer, path):
            print(line, flush=True)
    return ExitCode.PASSED


def _print_found(path: Path, answer: Triage) -> None:
    table = Table(title=str(path), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(Text("time [s]"), justify="right", no_wrap=True)
    table.add_column("found", no_wrap=True)
    table.add_column("what", overflow="fold")
    for finding in answer.found:
        table.add_row(f"{finding.start:.2f}", str(finding.cause), Text(finding.what))
    console().print(table)
