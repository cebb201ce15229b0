"""The recording's texts: stage 3's candidates, and the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wbmpc.signals import SIDES, CandidateReport, PlanReport

_NOTHING = "–"  # stands for a number that does not exist


def candidate_lines(candidates: Sequence[CandidateReport]) -> list[str]:
    """One log line for each candidate: what it would cost, and why it won or lost."""
    return [f"{'✓' if c.chosen else '×'} {c.patch} ({SIDES[c.hand]} hand): {c.reason}" for c in _ranked(candidates)]


def candidate_table(plan: PlanReport) -> str:
    """Markdown table of the candidates of one firing of stage 3, cheapest first."""
    head = ["", "patch", "hand", "cost", "reach margin [mm]", "friction margin [N]", "force [N]", "why"]
    rows = [
        (
            "**chosen**" if c.chosen else "",
            c.patch,
            SIDES[c.hand],
            _number(c.cost),
            f"{1e3 * c.reach_slack:+.0f}",
            _number(c.friction_margin),
            ", ".join(f"{x:.1f}" for x in c.force) if np.isfinite(c.cost) else _NOTHING,
            c.reason,
        )
        for c in _ranked(plan.candidates)
    ]
    return f"### Stage 3 fired at {plan.time:.2f} s\n\n{_table(head, rows)}"


def verdict_document(verdict: Mapping[str, Any]) -> str:
    """Markdown of a verdict: `passed`, `checks` (name, passed, value, threshold, unit, message) and `metrics`."""
    passed = verdict.get("passed")
    title = "no verdict" if passed is None else "PASS" if passed else "FAIL"
    parts = [f"## {verdict.get('scenario', '')}: {title}"]
    if checks := verdict.get("checks"):
        rows = [
            (
                "✓" if c.get("passed") else "×",
                c.get("name"),
                _number(c.get("value")),
                _number(c.get("threshold")),
                c.get("unit"),
                c.get("message"),
            )
            for c in checks
        ]
        parts.append(_table(["", "check", "value", "threshold", "unit", "message"], rows))
    if metrics := verdict.get("metrics"):
        parts.append(_table(["metric", "value"], [(name, _number(value)) for name, value in metrics.items()]))
    return "\n\n".join(parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(value) for value in line) + " |" for line in lines)


def _cell(value: Any) -> str:
    return "" if value is None else str(value).replace("|", "\\|").replace("\n", " ")


def _ranked(candidates: Sequence[CandidateReport]) -> list[CandidateReport]:
    return sorted(candidates, key=lambda c: (not c.chosen, c.cost))


def _number(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.4g}" if np.isfinite(value) else _NOTHING
    return "" if value is None else str(value)
