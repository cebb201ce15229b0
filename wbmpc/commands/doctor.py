"""`wbmpc doctor`: what would keep scenarios from running here, or a robot from being one, and what to do about it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from wbmpc.commands.exits import ExitCode
from wbmpc.commands.progress import counted
from wbmpc.commands.tables import console
from wbmpc.doctor.check import Finding, Status
from wbmpc.doctor.machine.checks import CHECKS as MACHINE_CHECKS
from wbmpc.doctor.machine.checks import examine_machine
from wbmpc.doctor.robot.checks import CHECKS as ROBOT_CHECKS
from wbmpc.doctor.robot.checks import examine_robot
from wbmpc.errors import RobotError
from wbmpc.scenario.robot_file import find_robot

STYLES = {Status.OK: "green", Status.WARN: "yellow", Status.FAIL: "bold red", Status.SKIPPED: "dim"}


def doctor(robot: str, *, as_json: bool) -> ExitCode:
    """Examine machine and robot, print what was found.

    Args:
        robot: a model's name in models/, or the path of an .xml file.
        as_json: one JSON document instead of tables.

    Raises:
        RobotError: there is no such file.
    """
    path = Path(robot)
    if not path.is_file():
        if robot.endswith(".xml"):
            raise RobotError(f"{robot}: no such robot model")
        path = find_robot(robot, scenario_directory=Path())
    with counted("doctor", len(MACHINE_CHECKS) + len(ROBOT_CHECKS)) as advance:
        machine, body = examine_machine(advance), examine_robot(path, advance)
    everything = [*machine, *body]
    failed = [finding for finding in everything if finding.status is Status.FAIL]
    if as_json:
        document = {
            "passed": not failed,
            "machine": [asdict(finding) for finding in machine],
            "robot": {"path": str(path), "checks": [asdict(finding) for finding in body]},
        }
        print(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        _print("machine", machine)
        _print(f"robot {_shown(path)}", body)
        print(_last_line(everything), flush=True)
    return ExitCode.FAILED if failed else ExitCode.PASSED


def _print(title: str, findings: Sequence[Finding]) -> None:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("check", no_wrap=True)
    table.add_column("", no_wrap=True)
    table.add_column("found, and what to do", overflow="fold")
    for finding in findings:
        text = Text(finding.found)
        if finding.status in (Status.WARN, Status.FAIL):
            text.append(f"\n→ {finding.hint}", style="italic")
        table.add_row(finding.name, Text(finding.status, style=STYLES[finding.status]), text)
    console().print(table)


def _last_line(findings: Sequence[Finding]) -> str:
    names = {status: [f.name for f in findings if f.status is status] for status in Status}
    parts = [f"{len(names[Status.OK])} of {len(findings)} checks ok"]
    if names[Status.SKIPPED]:
        parts.append(f"{len(names[Status.SKIPPED])} skipped")
    if names[Status.WARN]:
        parts.append(f"to know: {', '.join(names[Status.WARN])}")
    if names[Status.FAIL]:
        parts.append(f"must be fixed: {', '.join(names[Status.FAIL])}")
    return "; ".join(parts)


def _shown(path: Path) -> str:
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
