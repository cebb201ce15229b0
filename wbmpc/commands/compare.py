"""`wbmpc compare`: two results beside each other."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from wbmpc.commands.exits import ExitCode
from wbmpc.commands.tables import console
from wbmpc.comparison import Comparison, Tolerance, compare_results

SHOWN = 12  # signals, those that differ first


def compare(first: Path, second: Path, *, atol: float, rtol: float, everything: bool) -> ExitCode:
    """Print the metrics and checks of both, and where their signals part; exit code 1 when they differ.

    Raises:
        WbmpcError: one of them is neither a verdict nor a recording.
    """
    comparison = compare_results(first, second, Tolerance(atol, rtol))
    _print_numbers(first, second, comparison)
    if comparison.ticks is not None:
        _print_signals(comparison, everything=everything)
    within = "" if not atol and not rtol else f" within {atol:g} + {rtol:g} of the value"
    print(f"same{within}" if comparison.same else f"different{within}", flush=True)
    return ExitCode.PASSED if comparison.same else ExitCode.FAILED


def _print_numbers(first: Path, second: Path, comparison: Comparison) -> None:
    table = Table(title="metrics and checks", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for heading in (str(first), str(second), "B less A"):
        table.add_column(Text(heading), justify="right")
    table.add_column("")
    for row in comparison.numbers:
        cells = [Text("-" if value is None else f"{value:.6g}") for value in (row.a, row.b)]
        gap = "" if row.a is None or row.b is None or row.a == row.b else f"{row.b - row.a:+.3g}"
        table.add_row(row.name, *cells, gap, Text("differs", style="bold red") if row.differs else "")
    if comparison.numbers:
        console().print(table)


def _print_signals(comparison: Comparison, *, everything: bool) -> None:
    assert comparison.ticks is not None
    a, b = comparison.ticks
    lengths = f"{a} ticks each" if a == b else f"{a} and {b} ticks"
    if comparison.first_tick is None:
        print(f"state: the same to the bit, {lengths}")
    else:
        print(f"state: differs from tick {comparison.first_tick} on, {lengths}")
    if not comparison.signals:
        return
    shown = comparison.signals if everything else comparison.signals[:SHOWN]
    table = Table(title="signals, in order of the first difference", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("signal", overflow="fold")
    for heading in ("from [s]", "A", "B", "largest", "at [s]"):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for row in shown:
        largest = ("", "") if isnan(row.largest) else (f"{row.largest:.3g}", f"{row.largest_time:.2f}")
        table.add_row(Text(row.name), f"{row.time:.3f}", Text(row.a), Text(row.b), *largest)
    console().print(table)
    if len(shown) < len(comparison.signals):
        print(f"and {len(comparison.signals) - len(shown)} more signals (--all)")
