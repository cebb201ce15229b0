"""What `wbmpc branch` prints: which signals parted, in which order, and the checks and metrics of both futures."""

from __future__ import annotations

from itertools import zip_longest

from rich.text import Text

from wbmpc.branch import Branch
from wbmpc.checks.result import CheckResult
from wbmpc.commands.tables import console, number, plain_table
from wbmpc.explain.changes import Change


def print_partings(both: Branch, change: Change) -> None:
    """What diverged, the first first."""
    words = ", ".join(change.words) or "no change"
    if not both.partings:
        print(f"with {words}: nothing diverges, the futures are the same to the bit", flush=True)
        return
    table = plain_table(
        f"what diverged first, with {words}",
        *("signal", "tick>", "time [s]>", "where", "first by>", "seen from [s]>", "at most>", "at [s]>", "unit"),
    )
    for p in both.partings:
        seen = "-" if p.visible is None else f"{p.visible:.3f}"
        sizes = (
            number(p.first),
            seen,
            number(p.largest),
            f"{p.largest_at:.3f}" if p.largest_at == p.largest_at else "-",
        )
        table.add_row(*(Text(cell) for cell in (p.signal, str(p.tick), f"{p.time:.3f}", p.component, *sizes, p.unit)))
    console().print(table)


def print_verdicts(both: Branch) -> None:
    """The checks of both futures, and the metrics that differ."""
    one, other = both.original.verdict, both.changed.verdict
    table = plain_table("checks", "check", "threshold>", "unit", "original>", "", "branch>", "")
    for a, b in zip_longest(one.checks, other.checks):
        known = a or b
        cells = [Text(known.name), Text(number(known.threshold)), Text(known.unit), *_cells(a), *_cells(b)]
        table.add_row(*cells)
    console().print(table)
    names = [name for name in one.metrics if name in other.metrics and one.metrics[name] != other.metrics[name]]
    if names:
        table = plain_table("metrics that differ", "metric", "original>", "branch>")
        for name in names:
            table.add_row(name, number(one.metrics[name]), number(other.metrics[name]))
        console().print(table)


def _cells(check: CheckResult | None) -> list[Text]:
    if check is None:
        return [Text("-"), Text("")]
    word = Text("pass", style="green") if check.passed else Text("FAIL", style="bold red")
    return [Text(number(check.value)), word]
