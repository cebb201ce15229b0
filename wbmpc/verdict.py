"""The machine-readable answer of one run: NAME.json, whose names are documented in docs/results.md and stay stable."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wbmpc.checks.result import CheckResult
from wbmpc.files import writing
from wbmpc.recorder import Recorder
from wbmpc.signals import SolveStatus, StageReport, Vector
from wbmpc.triage.causes import Triage
from wbmpc.versions import versions


@dataclass(frozen=True)
class Verdict:
    """Everything in NAME.json."""

    scenario: str
    seed: int
    checks: Sequence[CheckResult]
    metrics: Mapping[str, float]
    solver: Mapping[str, Mapping[str, float]]
    timing: Mapping[str, float]  # wall times: LoopTiming.summary
    state_sha256: str
    triage: Triage | None = None  # why it failed; None when it passed
    golden: Mapping[str, Any] | None = None  # GoldenResult.as_dict; None when it was compared with none
    versions: Mapping[str, str] = field(default_factory=versions)

    @property
    def passed(self) -> bool:
        """All checks passed, and there was at least one."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def failing(self) -> tuple[str, ...]:
        """Names of the failed checks."""
        return tuple(check.name for check in self.checks if not check.passed)

    @property
    def real_time_factor(self) -> float:
        """Simulated time per wall time."""
        return self.timing["real_time_factor"]

    def as_dict(self) -> dict[str, Any]:
        """The JSON document: only finite numbers, None where a value could not be measured."""
        document = {
            "scenario": self.scenario,
            "seed": self.seed,
            "passed": self.passed,
            "checks": [asdict(check) for check in self.checks],
            "triage": None if self.triage is None else self.triage.as_dict(),
            "golden": None if self.golden is None else dict(self.golden),
            "metrics": dict(self.metrics),
            "solver": {stage: dict(row) for stage, row in self.solver.items()},
            "timing": dict(self.timing),
            "versions": dict(self.versions),
            "state_sha256": self.state_sha256,
        }
        return finite(document)

    def write(self, path: Path) -> None:
        """Write the JSON document to `path`, whole or not at all."""
        write_json(path, self.as_dict())


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON document with a stable layout; a killed process leaves the old file or the new one.

    Raises:
        WbmpcError: the file cannot be written.
    """
    partial = path.with_name(path.name + ".partial")
    with writing(path):
        partial.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        partial.replace(path)


def solver_statistics(recorder: Recorder) -> dict[str, dict[str, float]]:
    """Per stage: number of solves, failures, and p50, p99, max of the wall time of one solve [s].

    Stages: `tracker` (a whole tick), `stage1`, `stage2`, `stage3` (when it fired), `plan` (a whole plan).
    """
    statistics = {"tracker": _row(recorder.command_solve_time, int(recorder.command_fallback.sum()))}
    for stage in ("stage1", "stage2", "stage3"):
        reports: list[StageReport] = [getattr(plan, stage) for plan in recorder.plans]
        ran = [report for report in reports if report.status != SolveStatus.NOT_RUN]
        failures = sum(report.status != SolveStatus.SOLVED for report in ran)
        statistics[stage] = _row(np.array([report.solve_time for report in ran]), failures)
    statistics["plan"] = _row(np.array([plan.plan_time for plan in recorder.plans]), 0)
    return statistics


def _row(times: Vector, failures: int) -> dict[str, float]:
    if times.size == 0:
        return {"solves": 0, "failures": failures, "p50": math.nan, "p99": math.nan, "max": math.nan}
    p50, p99, most = (float(t) for t in np.percentile(times, [50, 99, 100]))
    return {"solves": int(times.size), "failures": failures, "p50": p50, "p99": p99, "max": most}


def finite(value: Any) -> Any:
    """The value with every nan and inf replaced by None, which JSON can say."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
