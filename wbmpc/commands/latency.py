"""`wbmpc latency`: a scenario at growing plan delays, the table, NAME_latency.json and its figure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import JsonValue
from rich import box
from rich.table import Table
from rich.text import Text

from wbmpc.checks.settings import UniversalSettings
from wbmpc.commands.exits import ExitCode
from wbmpc.commands.progress import counted
from wbmpc.commands.tables import console, number
from wbmpc.errors import ScenarioError, WbmpcError
from wbmpc.figures.figure import FORMATS, save_figure
from wbmpc.figures.latency import latency_figure
from wbmpc.files import make_folder
from wbmpc.latency import KEY, Row, at_delay, boundary, first_failed, key_check, margin, run_delays
from wbmpc.pool import available_cores
from wbmpc.scenario import Scenario, load_scenario
from wbmpc.verdict import write_json
from wbmpc.versions import versions

DELAYS = (0.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0, 150.0, 200.0)  # [ms]


@dataclass(frozen=True, slots=True)
class LatencyOptions:
    """The options of `wbmpc latency`."""

    delays: Sequence[float]  # [ms] empty: DELAYS
    jobs: int | None  # None: one per core
    seed: int | None  # None: the scenario's own
    out: Path
    suffix: str  # of the figure
    overrides: Mapping[str, JsonValue]  # by dotted path


def latency(path: Path, options: LatencyOptions) -> ExitCode:
    """Sweep the plan delay of one scenario file and write OUT/NAME_latency.json and the figure beside it.

    A delay at which the scenario fails is an answer: the exit code is 0 unless a run broke the program.

    Raises:
        ScenarioError: the scenario or an override is not valid.
        WbmpcError: a delay that no scenario may ask for, an unknown kind of figure, or the folder cannot be made.
    """
    suffix = f".{options.suffix.removeprefix('.')}"
    if suffix not in FORMATS:
        raise WbmpcError(f"--format {options.suffix}: choose one of {', '.join(f[1:] for f in FORMATS)}")
    scenario = load_scenario(path, options.overrides, options.seed)
    delays = [_ticks(scenario, delay) for delay in options.delays or DELAYS]  # known before minutes of runs
    make_folder(options.out)
    with counted(scenario.name, len(set(delays))) as advance:
        rows = run_delays(
            scenario, delays, jobs=options.jobs or available_cores(), on_done=lambda row: advance(_word(row))
        )
    target = options.out / f"{scenario.name}_latency"
    write_json(target.with_suffix(".json"), document_of(scenario, rows, options.overrides))
    _print(scenario, rows)
    sound = [row for row in rows if row["error"] is None]
    if sound:
        figure = latency_figure(
            f"{scenario.name}: margins of its checks against the plan delay",
            delay=[1e3 * row["delay"] for row in sound],
            passed=[row["passed"] for row in sound],
            margins=_margins(sound),
        )
        save_figure(figure, target.with_suffix(suffix))
        print(target.with_suffix(suffix), flush=True)
    return ExitCode.PASSED if len(sound) == len(rows) else ExitCode.INTERNAL_ERROR


def document_of(scenario: Scenario, rows: Sequence[Row], overrides: Mapping[str, JsonValue]) -> dict[str, Any]:
    """NAME_latency.json: the same bytes for any number of processes."""
    passes, fails = boundary(rows)
    return {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "set": dict(overrides),
        "planner_period": scenario.loop.planner_period_ticks * scenario.loop.timestep,
        "passes_up_to": passes,
        "fails_from": fails,
        "versions": versions(),
        "results": list(rows),
    }


def _ticks(scenario: Scenario, milliseconds: float) -> int:
    ticks = milliseconds * 1e-3 * scenario.loop.physics_rate
    if not math.isfinite(ticks) or abs(ticks - round(ticks)) > 1e-6:
        raise WbmpcError(
            f"--delay {milliseconds:g}: not a multiple of the timestep, {1e3 * scenario.loop.timestep:g} ms"
        )
    try:
        at_delay(scenario, round(ticks))
    except ScenarioError as error:
        raise WbmpcError(f"--delay {milliseconds:g}: {KEY} {error.problems[0].message}") from None
    return round(ticks)


def _margins(rows: Sequence[Row]) -> dict[str, list[float]]:
    """By name: the scenario's own checks, and the universal ones that fail somewhere."""
    failed = {check["name"] for row in rows for check in row["checks"] if not check["passed"]}
    names = [
        c["name"] for c in rows[0]["checks"] if c["name"] in failed or c["name"] not in UniversalSettings.model_fields
    ]
    found = [{check["name"]: margin(check) for check in row["checks"]} for row in rows]
    return {name: [margins[name] for margins in found] for name in names}


def _word(row: Row) -> str:
    return f"{1e3 * row['delay']:g} ms {'ERROR' if row['error'] else 'PASS' if row['passed'] else 'FAIL'}"


def _value(check: Mapping[str, Any], key: str = "value") -> str:
    unit = "" if check["unit"] == "1" else f" {check['unit']}"
    return f"{number(float('nan') if check[key] is None else check[key])}{unit}"


def _print(scenario: Scenario, rows: Sequence[Row]) -> None:
    key = next((key_check(row) for row in rows if row["error"] is None), "")
    table = Table(title=f"{scenario.name}: plan delay", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(Text("delay [ms]"), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column(Text(key), no_wrap=True)
    table.add_column("first failed check", overflow="fold")
    for row in rows:
        failed = first_failed(row)
        if row["error"]:
            words, verdict = row["error"], Text("ERROR", style="bold red")
        elif failed is None:
            words, verdict = "", Text("pass", style="green")
        else:
            when = "" if failed["first_violation"] is None else f", {failed['first_violation']:.2f} s"
            words = f"{failed['name']} {_value(failed)} against {_value(failed, 'threshold')}{when}"
            verdict = Text("FAIL", style="bold red")
        value = next((_value(check) for check in row["checks"] if check["name"] == key), "")
        table.add_row(f"{1e3 * row['delay']:g}", verdict, Text(value), Text(words))
    console().print(table)
    print(conclusion(scenario.name, rows), flush=True)


def conclusion(name: str, rows: Sequence[Row]) -> str:
    """Up to which delay the scenario passes, in words."""
    passes, fails = boundary(rows)
    if passes is None:
        return f"{name} passes at no delay tried"
    if fails is None:
        return f"{name} passes up to {1e3 * passes:g} ms, the largest delay tried"
    return f"{name} passes up to {1e3 * passes:g} ms and fails from {1e3 * fails:g} ms"
