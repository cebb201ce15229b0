"""The table at the end of `wbmpc run` with several runs."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from rich import box
from rich.table import Table
from rich.text import Text

from wbmpc.checks.result import CheckResult
from wbmpc.checks.settings import UniversalSettings
from wbmpc.commands.exits import ExitCode
from wbmpc.commands.one_run import Job, Outcome
from wbmpc.commands.tables import console, golden_words, number


def print_runs(ended: Sequence[tuple[Job, Outcome]]) -> None:
    """Table of runs, those that went wrong last: what was expected, how each ended, and by what."""
    table = Table(title="runs", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("scenario", "run", "expected"):
        table.add_column(heading, overflow="fold")
    table.add_column("verdict", no_wrap=True)
    table.add_column("values, or failing checks", overflow="fold")
    for heading in ("simulated [s]", "wall [s]"):
        table.add_column(Text(heading), justify="right", no_wrap=True)  # rich takes a plain "[s]" for markup
    previous = ""
    for job, outcome in sorted(ended, key=lambda pair: pair[1].code):
        passed = outcome.code is ExitCode.PASSED
        verdict = Text("PASS", style="green") if passed else Text("FAIL", style="bold red")
        words = how_it_ended(outcome)
        name = "" if passed and job.scenario.name == previous else job.scenario.name
        previous = job.scenario.name
        times = ("-" if isnan(t) else f"{t:.1f}" for t in (outcome.simulated_time, outcome.wall_time))
        table.add_row(name, job.variant, job.expected, verdict, Text(words), *times)
    console().print(table)


def how_it_ended(outcome: Outcome) -> str:
    """The values of the scenario's own checks, or what failed and what came first, or why there is no verdict."""
    if not outcome.checks:
        return outcome.line.partition(": ")[2]
    failing = [check for check in outcome.checks if not check.passed]
    universal = tuple(UniversalSettings.model_fields)
    shown = failing or [check for check in outcome.checks if check.name not in universal] or outcome.checks
    words = ", ".join(_value(check) for check in shown)
    if outcome.golden is not None and not outcome.golden["passed"]:
        return golden_words(outcome.golden)
    if failing and outcome.triage:
        words += f"; first {outcome.triage.cause} at {outcome.triage.time:.2f} s"
    return f"fails {words}" if failing else words


def _value(check: CheckResult) -> str:
    unit = "" if check.unit == "1" else f" {check.unit}"
    return f"{check.name} {number(check.value)}{unit}"
