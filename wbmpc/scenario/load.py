"""File -> validated Scenario, and changed copies of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wbmpc.checks.settings import ScenarioCheck
from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario.diagnosis import Finding
from wbmpc.scenario.overrides import apply_overrides
from wbmpc.scenario.robot_file import find_robot
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.validate import blamed_changes, validate, without_experiments
from wbmpc.scenario.wording import dotted_path
from wbmpc.scenario.yaml_reader import read_document


def load_scenario(path: str | Path, overrides: Mapping[str, Any] | None = None, seed: int | None = None) -> Scenario:
    """Read, validate and override a scenario file.

    Args:
        path: the YAML file.
        overrides: new values by dotted path, as `parse_overrides` makes them from `KEY=VALUE` arguments.
        seed: replaces the file's seed.

    Raises:
        ScenarioError: one problem per mistake, in the order of the file.
    """
    document = read_document(path)
    scenario, findings = validate(document.data, source=Path(path))
    if scenario is None:
        problems = [document.problem(finding.path, finding.message, at_key=finding.at_key) for finding in findings]
        raise ScenarioError(sorted(problems, key=_line))
    if overrides:
        scenario = _changed(scenario, scenario.to_document(), overrides, option="--set")
    if seed is not None:
        scenario = _changed(scenario, scenario.to_document(), {"seed": seed}, option="--seed")
    return scenario


def vary(scenario: Scenario, changes: Mapping[str, Any], *, checks: Sequence[ScenarioCheck] | None = None) -> Scenario:
    """One changed run of a scenario, for counterfactuals and sweeps; it has neither of them itself.

    Args:
        scenario: the scenario to change; not touched.
        changes: new values by dotted path.
        checks: in place of the scenario's own checks.

    Raises:
        ScenarioError: the changed scenario is not valid.
    """
    document = without_experiments(scenario)
    if checks is not None:
        document["checks"] = [check.model_dump(mode="json") for check in checks]
    return _changed(scenario, document, changes, option="--set")


def counterfactual(scenario: Scenario, name: str) -> Scenario:
    """The run of one of the scenario's counterfactuals, with its additional checks.

    Raises:
        KeyError: there is none of this name.
    """
    experiment = scenario.counterfactuals[name]
    return vary(scenario, experiment.set, checks=(*scenario.checks, *experiment.checks))


def robot_path(scenario: Scenario) -> Path:
    """The MJCF of the scenario's robot.

    Raises:
        RobotError: there is no such file.
    """
    return find_robot(scenario.robot, scenario_directory=scenario.source.parent)


def _changed(scenario: Scenario, document: dict[str, Any], changes: Mapping[str, Any], *, option: str) -> Scenario:
    changed_document = apply_overrides(document, changes)
    # The experiments are valid for the file as it is; whether they fit a changed one shows when they are run.
    changed, findings = validate(changed_document, source=scenario.source, experiments=False)
    if changed is None:
        raise ScenarioError(_change_problem(finding, changed_document, changes, option) for finding in findings)
    return changed


def _change_problem(finding: Finding, document: Mapping[str, Any], changes: Mapping[str, Any], option: str) -> Problem:
    blamed = blamed_changes(document, changes, finding.path) or list(changes)
    path = dotted_path(finding.path)
    message = finding.message if blamed == [path] else f"{path}: {finding.message}"
    return Problem(option if option == "--seed" else f"{option} {', '.join(blamed)}", message)


def _line(problem: Problem) -> tuple[int, int]:
    _, line, column = problem.place.rsplit(":", 2)
    return int(line), int(column)
