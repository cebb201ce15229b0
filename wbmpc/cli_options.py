"""Arguments and options that several commands take."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer


def finite(value: float | None) -> float | None:
    """Refuse nan and inf, which pass for numbers on a command line and between its bounds."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"must be a finite number, got {value}")
    return value


Files = Annotated[list[Path], typer.Argument(metavar="SCENARIO", help="Scenario files (YAML).", show_default=False)]
ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (YAML).", show_default=False)]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="An .rrd file.", show_default=False)]
RecordingFiles = Annotated[list[Path], typer.Argument(metavar="RECORDING", help="The .rrd files.", show_default=False)]
RobotFile = Annotated[
    Path | None, typer.Option("--robot", metavar="FILE", help="The robot's MJCF, if it is elsewhere now.")
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers [the scenario's].")]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the results.")]
Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        default_factory=list,
        help="Set a scenario key by its dotted path (lists by index), e.g. tasks.0.target.0=0.45; repeatable.",
        show_default=False,
    ),
]
Changes = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        default_factory=list,
        help="What to change, by the scenario's dotted path, or forbid=PATCH; repeatable.",
        show_default=False,
    ),
]
Jobs = Annotated[int | None, typer.Option("--jobs", min=1, help="Parallel processes [one per core].")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")]
