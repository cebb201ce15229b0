"""The recording's texts: stage 3's candidates, and the verdict."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbmpc.signals import SIDES, CandidateReport, PlanReport

VERDICT = "/verdict/data"  # the content of NAME.json
_NOTHING = "–"  # stands for a number that does not exist
_BETWEEN = re.compile(r"(?<!\\)\|")  # a bar that is no part of a cell


def candidate_lines(candidates: Sequence[CandidateReport]) -> list[str]:
    """One log line for each candidate: what it would cost, and why it won or lost."""
    return [f"{'✓' if c.chosen else '×'} {c.patch} ({SIDES[c.hand]} hand): {c.reason}" for c in _ranked(candidates)]


def firing_document(plan: PlanReport) -> str:
    """Markdown of a firing of stage 3: what it was asked, the candidates it weighed, cheapest first, and the others."""
    firing = plan.firing
    if firing is None:
        return "Stage 3 did not fire."
    knots = ["task's end" if np.isinf(time) else f"{time:.2f} s" for time in firing.knot_times]
    asked = [
        (f"at {knot}", *(f"{1e3 * x:+.1f}" for x in (*shift, *zmp)))
        for knot, shift, zmp in zip(knots, firing.delta_z, firing.zmp, strict=True)
    ]
    weighed = [c for c in _ranked(firing.candidates) if np.isfinite(c.cost)]
    others = [c for c in _ranked(firing.candidates) if not np.isfinite(c.cost)]
    stage = plan.stage3
    chosen = " and ".join(f"**{c.patch}** for the {SIDES[c.hand]} hand" for c in weighed if c.chosen)
    parts = [
        f"### Stage 3 fired at {plan.time:.2f} s: {chosen or 'no candidate helps'}",
        _table(["ΔZ asked", "x [mm]", "y [mm]", "ZMP without contact: x [mm]", "y [mm]"], asked),
        f"Beside: {', '.join(firing.held) or 'no other contact'}. The feet are to keep {1e3 * firing.reserve:.0f} mm "
        f"more than their margin. {stage.iterations} solves, {1e3 * stage.solve_time:.2f} ms, {stage.status.name}.",
    ]
    if weighed:
        head = ["weighed", "hand", "cost", "= way", "+ force", "+ shift", "why"]
        parts.append(_table(head, [_cost_row(c) for c in weighed]))
        head = ["weighed", "hand", *(f"force at {knot} [N]" for knot in knots), "friction margin [N]"]
        parts.append(_table([*head, "reach slack [mm]"], [_force_row(c) for c in weighed]))
    if others:
        rows = [(c.patch, SIDES[c.hand], _slack(c), c.reason) for c in others]
        parts.append(_table(["dismissed", "hand", "reach slack [mm]", "why"], rows))
    return "\n\n".join(parts)


def _cost_row(c: CandidateReport) -> tuple[str, ...]:
    costs = (f"{x:.4f}" for x in (c.cost, c.way_cost, c.force_cost, c.shift_cost))
    return (_title(c), SIDES[c.hand], *costs, f"{c.reason} (with {', '.join(c.beside)})" if c.beside else c.reason)


def _force_row(c: CandidateReport) -> tuple[str, ...]:
    forces = (", ".join(f"{x:.1f}" for x in force) for force in c.forces)
    return (_title(c), SIDES[c.hand], *forces, f"{c.friction_margin:.2f}", _slack(c))


def _title(candidate: CandidateReport) -> str:
    return f"**{candidate.patch}**" if candidate.chosen else candidate.patch


def _slack(candidate: CandidateReport) -> str:
    return f"{1e3 * candidate.reach_slack:+.0f} ({candidate.reach_limit})"


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a document."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def parts_of(markdown: str) -> tuple[str, list[str | Table]]:
    """Title, and paragraphs and tables of a document made here, whatever their columns."""
    title, *rest = markdown.strip().split("\n\n")
    if not title.startswith("#"):
        title, rest = "", [title, *rest]
    return title.lstrip("# "), [_read_table(part) if part.startswith("|") else part for part in rest if part]


def _read_table(markdown: str) -> Table:
    lines = [_BETWEEN.split(line.strip())[1:-1] for line in markdown.split("\n")]
    cells = [[cell.strip().replace("\\|", "|") for cell in line] for line in lines]
    return Table(cells[0], cells[2:])


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
    if cause := verdict.get("triage"):
        lines = [f"First cause: **{cause['cause']}** at {cause['time']:.2f} s: {cause['message']}"]
        found = [(f"{f['time']:.2f}", f["cause"], f["message"]) for f in cause["found"]]
        parts += [*lines, f"Look at: {cause['look_at']}", _table(["time [s]", "found", ""], found)]
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
