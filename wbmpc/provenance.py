"""What a run was made of, as data that a recording keeps: scenario, robot, versions; and the way back to a scenario."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wbmpc.errors import WbmpcError
from wbmpc.scenario import Scenario, robot_path
from wbmpc.scenario.robot_file import MODELS
from wbmpc.scenario.validate import validate, without_experiments
from wbmpc.scenario.wording import dotted_path
from wbmpc.versions import source_hash, versions

FORMAT = 1
_NO_MATTER = {"rerun-sdk"}  # it writes the motion down and has no part in it


def document_of(scenario: Scenario, name: str, *, realtime: bool) -> dict[str, Any]:
    """Everything but the plans' times that a run depends on: overrides and seed are resolved in the scenario."""
    robot = robot_path(scenario).resolve()
    return {
        "format": FORMAT,
        "name": name,
        "realtime": realtime,
        "scenario": without_experiments(scenario),
        "robot": str(robot),
        "robot_sha256": _digest(robot),
        "versions": versions(),
        "source_sha256": source_hash(),
    }


def scenario_of(document: Mapping[str, Any], *, robot: Path | None = None) -> Scenario:
    """The scenario of a run.

    Args:
        document: what `document_of` made.
        robot: the robot's MJCF, where it is no longer in its place.

    Raises:
        WbmpcError: other versions made the run, its robot is gone or has changed, or the scenario is no longer valid.
    """
    if document.get("format") != FORMAT:
        raise WbmpcError(f"the run is written in format {document.get('format')}, this is {FORMAT}")
    if others := _other_versions(document["versions"]):
        raise WbmpcError(f"made with other versions, which may round otherwise: {', '.join(others)}")
    return settings_of(document, robot=robot)


def settings_of(document: Mapping[str, Any], *, robot: Path | None = None) -> Scenario:
    """The same to read in, not to run: whatever versions made it.

    Raises:
        WbmpcError: its robot is gone or has changed, or the scenario is no longer valid.
    """
    path = robot or _place_of(document)
    if not path.is_file():
        raise WbmpcError(f"no robot {path}; say with --robot where its MJCF is now")
    if _digest(path) != document["robot_sha256"]:
        raise WbmpcError(f"the robot {path} is not the one of the run: its content differs")
    data = {**document["scenario"], "robot": str(path.resolve())}
    scenario, findings = validate(data, source=path, experiments=False)
    if scenario is None:
        raise WbmpcError(f"its scenario is not valid: {dotted_path(findings[0].path)}: {findings[0].message}")
    return scenario


def same_source(document: Mapping[str, Any]) -> bool:
    """Whether the program's own source is the one that made the run."""
    return bool(document["source_sha256"] == source_hash())


def _other_versions(recorded: Mapping[str, str]) -> list[str]:
    here = versions()
    names = sorted((recorded.keys() | here.keys()) - _NO_MATTER)
    return [
        f"{name} {recorded.get(name, 'absent')} (here {here.get(name, 'absent')})"
        for name in names
        if recorded.get(name, "absent") != here.get(name, "absent")
    ]


def _place_of(document: Mapping[str, Any]) -> Path:
    """Where the robot was; a named one is wherever models/ is now."""
    named = document["scenario"]["robot"]
    if named.endswith(".xml"):
        return Path(document["robot"])
    return MODELS / f"{named}.xml"


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
