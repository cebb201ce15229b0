"""A verdict (the content of NAME.json) as the page shows it; only that it is a mapping is taken for granted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from wbmpc.checks.settings import UniversalSettings

_SCALE = 2.0  # a bar ends at so many thresholds


@dataclass(frozen=True, slots=True)
class Bar:
    """A value against its threshold; the threshold is in the middle."""

    width: float  # [%]
    over: bool  # longer than can be drawn


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One row of the checks' table."""

    name: str
    passed: bool
    universal: bool  # on in every scenario
    value: Any
    threshold: Any
    unit: str
    message: str
    first_violation: Any  # [s] None: never, or not a matter of time
    bar: Bar | None


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether a run passed and what failed: as much of a `Verdict` as a counterfactual is judged by."""

    checks: Sequence[CheckRow]
    passed: bool

    @property
    def failing(self) -> tuple[str, ...]:
        """Names of the failed checks."""
        return tuple(check.name for check in self.checks if not check.passed)


def judgement_of(verdict: Mapping[str, Any]) -> Judgement | None:
    """None when the verdict does not say whether the run passed: there was none."""
    if not isinstance(verdict.get("passed"), bool):
        return None
    return Judgement(check_rows(verdict), verdict["passed"])


def check_rows(verdict: Mapping[str, Any]) -> list[CheckRow]:
    """The checks in their order."""
    checks = verdict.get("checks")
    return [_row(check) for check in checks if isinstance(check, Mapping)] if isinstance(checks, list) else []


def triage_rows(verdict: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """What the verdict says of the first cause of a failure: named parts, "" for a sentence; empty without one."""
    triage = verdict.get("triage")
    if isinstance(triage, Mapping):
        sentence = [("", triage["message"])] if triage.get("message") else []
        rest = [(key.replace("_", " "), value) for key, value in triage.items() if key != "message"]
        return sentence + [(key, value) for key, value in rest if isinstance(value, str | int | float) and value != ""]
    return [("", triage)] if isinstance(triage, str) and triage else []


def numbers(verdict: Mapping[str, Any], block: str) -> list[tuple[str, Any]]:
    """Names and values of `metrics`, `timing` or `versions`."""
    found = verdict.get(block)
    return [(str(name), value) for name, value in found.items()] if isinstance(found, Mapping) else []


def shown(value: Any) -> str:
    """A number with four significant digits, a word as it is; "–" for what could not be measured."""
    if value is None or (isinstance(value, float) and not isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}".replace("-", "−")
    return str(value)


def _row(check: Mapping[str, Any]) -> CheckRow:
    name, unit = str(check.get("name", "")), str(check.get("unit", ""))
    return CheckRow(
        name=name,
        passed=check.get("passed") is True,
        universal=name in UniversalSettings.model_fields,
        value=check.get("value"),
        threshold=check.get("threshold"),
        unit="" if unit == "1" else unit,
        message=str(check.get("message") or ""),
        first_violation=check.get("first_violation"),
        bar=_bar(check.get("value"), check.get("threshold")),
    )


def _bar(value: Any, threshold: Any) -> Bar | None:
    """None where there is nothing to compare: no number, or a threshold of zero."""
    if not all(isinstance(v, int | float) and isfinite(v) for v in (value, threshold)) or threshold == 0:
        return None
    share = value / threshold / _SCALE
    return Bar(round(100 * min(max(share, 0.0), 1.0), 1), share > 1.0)
