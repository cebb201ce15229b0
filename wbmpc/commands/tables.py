"""What the commands print about results, on standard output."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from wbmpc.checks.result import CheckResult

PLAIN_WIDTH = 160  # columns where the output is no terminal: wide enough that no cell is cut


def console() -> Console:
    """Standard output; of a fixed width where it is no terminal, so that files and logs do not depend on it."""
    found = Console()
    return found if found.is_terminal else Console(width=PLAIN_WIDTH)


def number(value: float) -> str:
    """Four significant digits; "-" for what could not be measured."""
    return f"{value:.4g}" if math.isfinite(value) else "-"


def print_checks(title: str, checks: Sequence[CheckResult]) -> None:
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
    console().print(table)


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
