"""The evidence that a recording holds: the same columns at the file's rate, and the verdict."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any, cast

from wbmpc.checks.context import CheckContext
from wbmpc.checks.registry import evaluate_checks
from wbmpc.checks.result import CheckResult
from wbmpc.errors import WbmpcError
from wbmpc.facts import facts_of
from wbmpc.provenance import settings_of
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.columns import columns_of
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import recorded_run, recorded_verdict
from wbmpc.robot import Robot
from wbmpc.scenario import resolve_patches, robot_path
from wbmpc.triage.first import Evidence


def evidence_of(recording: Recording, *, robot: Path | None = None) -> tuple[Evidence, list[CheckResult]]:
    """Evidence and checks of a recorded run. `robot`: its MJCF, where it is no longer in its place.

    A run that was killed has no verdict: then the always-on checks are made of what is in the file.

    Raises:
        WbmpcError: no recording of this project, without a sample, or of a robot that is gone or has changed.
    """
    run, columns = recorded_run(recording), columns_of(recording)
    try:
        scenario = settings_of(run.document, robot=robot)
    except WbmpcError as error:
        raise WbmpcError(f"{recording.path}: {error}") from None
    facts = facts_of(columns.model, Robot.load(robot_path(scenario)), scenario, resolve_patches(scenario))
    facts = replace(facts, timestep=1.0 / scenario.recording.rate)  # of a sample: durations are counted in them
    context = CheckContext(cast(Recorder, columns), facts)  # it has the columns that are asked for here
    verdict = recorded_verdict(recording)
    if verdict is None:
        checks = evaluate_checks(context, universal=scenario.universal, checks=())
    else:
        checks = [_check(row) for row in verdict["checks"]]
    return Evidence(context, scenario, columns.model), checks


def _check(row: dict[str, Any]) -> CheckResult:
    return CheckResult(**{**row, "value": nan if row["value"] is None else row["value"]})
