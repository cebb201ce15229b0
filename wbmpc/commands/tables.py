"""What the commands print about results, on standard output."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from wbmpc.checks.result import CheckResult
from wbmpc.triage.causes import Triage

PLAIN_WIDTH = 160  # columns where the output is no terminal: wide enough that no cell is cut


def console() -> Console:
    """Standard output; of a fixed width where it is no terminal, so that files and logs do not depend on it."""
    found = Console()
    return found if found.is_terminal else Console(width=PLAIN_WIDTH)


def plain_table(title: str, *headings: str) -> Table:
    """A table with these columns; a heading that ends in > is of numbers."""
    table = Table(title=Text(title) if title else None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in headings:
        right = heading.endswith(">")
        table.add_column(Text(heading.removesuffix(">")), justify="right" if right else "left", overflow="fold")
    return table


def number(value: float) -> str:
    """Four significant digits; "-" for what could not be measured."""
    return f"{value:.4g}" if math.isfinite(value) else "-"


def plain_text(table: Table) -> str:
    """A table as text without colours, as wide as a file's."""
    text = "".join(segment.text for segment in Console(width=PLAIN_WIDTH, color_system=None).render(table))
    return "\n".join(line.rstrip() for line in text.splitlines()).rstrip()


def print_checks(title: str, checks: Sequence[CheckResult]) -> None:
    """Table of checks, value against threshold."""
    console().print(checks_table(title, checks))


def checks_table(title: str, checks: Sequence[CheckResult]) -> Table:
    """Table of checks, value against threshold."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading, justify in (("check", "left"), ("value", "right"), ("threshold", "right"), ("unit", "left")):
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    table.add_column("result", no_wrap=True)
    table.add_column("message", overflow="fold")
    for check in checks:
        result = Text("pass", style="green") if check.passed else Text("FAIL", style="bold red")
        when = "" if check.first_violation is None else f" (first at t = {check.first_violation:.3f} s)"
        row = (check.name, number(check.value), number(check.threshold), check.unit)
        table.add_row(*(Text(cell) for cell in row), result, Text(check.message + when))
    return table


def cause_lines(triage: Triage, recording: Path | None) -> list[str]:
    """Why a run failed, what to look at, and how to open its recording there (None: it has none)."""
    lines = [f"first cause: {triage.cause} at {triage.time:.2f} s: {triage.message}", f"look at: {triage.look_at}"]
    if recording is not None:
        picture = recording.with_suffix(".png")
        lines.append(
            f"open: rerun {recording} (timeline at {triage.time:.2f} s), or "
            f"wbmpc render {recording} --time {triage.time:.2f} --out {picture}"
        )
    return lines


def golden_words(golden: Mapping[str, Any]) -> str:
    """How a run is off its golden result, from its verdict's `golden`."""

    def word(value: float | None) -> str:
        return "null" if value is None else f"{value:.5g}"

    rows = [
        f"{r['name']} {word(r['value'])} (± {r['allowed']:.2g} of {word(r['golden'])})" for r in golden["deviations"]
    ]
    return f"off {golden['file']}: {', '.join(rows)}"


def timing_line(name: str, timing: Mapping[str, float]) -> str:
    """How a real-time run kept up, from its verdict's `timing`."""
    late = 100 * timing["late_plans"] / max(timing["plans"], 1)
    ready = ", ".join(f"{level} {number(1e3 * timing[f'plan_ready_{level}'])}" for level in ("p50", "p99", "max"))
    return (
        f"{name}: {number(timing['planner_rate'])} plans/s, {late:.1f} % late, {timing['skipped_plans']} skipped, "
        f"ready after [ms] {ready}; {timing['missed_deadlines']} of {timing['ticks']} ticks missed, "
        f"drift {timing['drift']:.3f} s"
    )


def final_line(name: str, failures: Sequence[CheckResult], note: str = "") -> str:
    """`PASS reach`, or `FAIL reach: ` and what failed."""
    if not failures and not note:
        return f"PASS {name}"
    parts = [note] if note else []
    for check in failures:
        unit = "" if check.unit == "1" else f" {check.unit}"
        parts.append(f"{check.name} {number(check.value)}{unit} against {number(check.threshold)}{unit}")
    return f"FAIL {name}: {'; '.join(parts)}"
