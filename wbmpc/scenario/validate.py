"""Plain data -> Scenario, or every finding against it: schema first, then consistency, then the experiments."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import JsonValue, ValidationError

from wbmpc.errors import RobotError
from wbmpc.scenario.consistency import check_names, find_inconsistencies, find_unknown_names
from wbmpc.scenario.diagnosis import Finding, diagnose
from wbmpc.scenario.overrides import UnknownPath, key_path, set_value
from wbmpc.scenario.robot_file import find_robot, read_robot_names
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.wording import KeyPath, dotted_path, near_misses


def validate(
    data: Mapping[str, Any], *, source: Path, experiments: bool = True
) -> tuple[Scenario | None, list[Finding]]:
    """Validate a document; the scenario is None exactly when there are findings.

    `source` is the file that the data came from: relative paths in the scenario start at its directory.
    `experiments` asks whether every counterfactual and variation makes a valid scenario, too.
    """
    try:
        # Through JSON, since pydantic's strict mode takes a list for a tuple there and nowhere else.
        scenario = Scenario.model_validate_json(json.dumps(data))
    except ValidationError as error:
        return None, diagnose(error, data)
    scenario._source = source
    # Each step takes for granted what the one before has checked.
    findings = find_inconsistencies(scenario) or _robot_findings(scenario)
    if experiments and not findings:
        findings = list(_experiment_findings(scenario))
    return (None, findings) if findings else (scenario, [])


def without_experiments(scenario: Scenario) -> dict[str, Any]:
    """The effective document of one run: counterfactuals and sweep left out, since a changed run has none."""
    document = scenario.to_document()
    del document["counterfactuals"], document["sweep"]
    return document


def _robot_findings(scenario: Scenario) -> list[Finding]:
    try:
        path = find_robot(scenario.robot, scenario_directory=scenario.source.parent)
        return list(find_unknown_names(scenario, read_robot_names(path)))
    except RobotError as error:
        return [Finding(("robot",), str(error))]


def _experiment_findings(scenario: Scenario) -> Iterator[Finding]:
    """Every changed run must itself be valid, and name checks that it has."""
    document = without_experiments(scenario)
    for name, experiment in scenario.counterfactuals.items():
        path: KeyPath = ("counterfactuals", name)
        changes: dict[str, Any] = dict(experiment.set)
        unknown = list(_unknown_paths(document, changes))
        if unknown:
            yield from (Finding((*path, "set", key), message, at_key=True) for key, message in unknown)
            continue
        extra = [check.model_dump(mode="json") for check in experiment.checks]
        changed, findings = _changed(document, changes, source=scenario.source, extra_checks=extra)
        for finding in findings:
            blamed = blamed_changes(document, changes, finding.path) or list(changes)
            yield Finding((*path, "set", blamed[0]), _blame(finding, document, changes), finding.at_key)
        if experiment.failing and experiment.expect == "pass":
            yield Finding((*path, "failing"), "only with 'expect: fail'", at_key=True)
        for index, check in enumerate(experiment.failing if changed else ()):
            assert changed is not None
            if check not in check_names(changed):
                message = f"no check '{check}'" + near_misses(check, check_names(changed))
                yield Finding((*path, "failing", index), message)
    yield from _sweep_findings(scenario, document)


def _sweep_findings(scenario: Scenario, document: dict[str, Any]) -> Iterator[Finding]:
    seen: set[str] = set()
    for index, variation in enumerate(scenario.sweep.variations if scenario.sweep else ()):
        path: KeyPath = ("sweep", "variations", index)
        if variation.key in seen:
            yield Finding((*path, "key"), f"'{variation.key}' is varied twice")
        seen.add(variation.key)
        unknown = list(_unknown_paths(document, {variation.key: None}))
        if unknown:
            yield Finding((*path, "key"), unknown[0][1])
            continue
        for value in variation.extremes:
            changes = {variation.key: value}
            _, findings = _changed(document, changes, source=scenario.source)
            if findings:
                unknown_key = findings[0].at_key
                where = "key" if unknown_key else "uniform" if variation.uniform else "choice"
                yield Finding((*path, where), _blame(findings[0], document, changes))
                break


def _unknown_paths(document: Mapping[str, Any], changes: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for key in changes:
        try:
            key_path(document, key)
        except UnknownPath as error:
            yield key, str(error)


def _changed(
    document: dict[str, Any],
    changes: Mapping[str, JsonValue],
    *,
    source: Path,
    extra_checks: list[dict[str, Any]] | None = None,
) -> tuple[Scenario | None, list[Finding]]:
    changed = copy.deepcopy(document)
    for key, value in changes.items():
        set_value(changed, key, value)
    changed["checks"] = [*changed["checks"], *(extra_checks or ())]
    return validate(changed, source=source, experiments=False)


def _blame(finding: Finding, document: Mapping[str, Any], changes: Mapping[str, Any]) -> str:
    """The message, with the finding's own path when that is not the changed key itself."""
    same = any(key_path(document, key) == finding.path for key in changes)
    return finding.message if same else f"{dotted_path(finding.path)}: {finding.message}"


def blamed_changes(document: Mapping[str, Any], changes: Mapping[str, Any], path: KeyPath) -> list[str]:
    """The changes that lie on the way to a finding's path or inside it; several fields may share the blame."""

    def related(key: str) -> bool:
        other = key_path(document, key)
        length = min(len(other), len(path))
        return other[:length] == path[:length]

    return [key for key in changes if related(key)]
