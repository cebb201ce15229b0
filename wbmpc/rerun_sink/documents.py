"""The recording's texts: stage 3's candidates, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wbmpc.signals import SIDES, CandidateReport, PlanReport


def candidate_lines(candidates: Sequence[CandidateReport]) -> list[str]:
    """One log line for each candidate: what it would cost, and why it won or lost."""
    return [f"{'✔' if c.chosen else '✘'} {c.patch} ({SIDES[c.hand]} hand): {c.reason}" for c in _ranked(candidates)]


def candidate_table(plan: PlanReport) -> str:
    """Markdown table of the candidates of one firing of stage 3, cheapest first."""
    rows = [
        f"| {'**chosen**' if c.chosen else ''} | {c.patch} | {SIDES[c.hand]} | {_number(c.cost)} "
        f"| {1e3 * c.reach_slack:+.0f} mm | {_number(c.friction_margin)} N "
        f"| {', '.join(f'{x:.1f}' for x in c.force)} N | {c.reason} |"
        for c in _ranked(plan.candidates)
    ]
    head = "| | patch | hand | cost | reach margin | friction margin | force | why |\n|---|---|---|---|---|---|---|---|"
    return f"### Stage 3 fired at {plan.time:.2f} s\n\n" + "\n".join([head, *rows])


def verdict_document(verdict: Mapping[str, Any]) -> str:
    """Markdown of a verdict: `passed`, `checks` (name, passed, value, threshold, unit, message) and `metrics`."""
    passed = verdict.get("passed")
    title = "no verdict" if passed is None else "PASS" if passed else "FAIL"
    lines = [f"## {verdict.get('scenario', '')}: {title}"]
    checks = verdict.get("checks") or []
    if checks:
        lines += ["", "| | check | value | threshold | unit | message |", "|---|---|---|---|---|---|"]
        lines += [
            f"| {'✔' if c.get('passed') else '✘'} | {c.get('name', '')} | {_number(c.get('value'))} "
            f"| {_number(c.get('threshold'))} | {c.get('unit') or ''} | {c.get('message') or ''} |"
            for c in checks
        ]
    metrics = verdict.get("metrics") or {}
    if metrics:
        lines += ["", "| metric | value |", "|---|---|"]
        lines += [f"| {name} | {_number(value)} |" for name, value in metrics.items()]
    return "\n".join(lines)


def _ranked(candidates: Sequence[CandidateReport]) -> list[CandidateReport]:
    return sorted(candidates, key=lambda c: (not c.chosen, c.cost))


def _number(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.4g}" if np.isfinite(value) else "–"
    return "" if value is None else str(value)
