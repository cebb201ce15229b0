"""`wbmpc sweep`: draws, progress, the table and NAME.sweep.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import JsonValue
from rich import box
from rich.table import Table
from rich.text import Text
from scipy.stats import binomtest

from wbmpc.checks.settings import UniversalSettings
from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.progress import counted
from wbmpc.commands.reproduce import run_command
from wbmpc.commands.tables import console, number
from wbmpc.errors import WbmpcError
from wbmpc.files import make_folder
from wbmpc.pool import available_cores
from wbmpc.scenario import load_scenario, robot_path
from wbmpc.sweep import Draw, draw_values, header_of, run_draws, scenario_of, severity
from wbmpc.sweep_journal import Journal
from wbmpc.verdict import write_json
from wbmpc.versions import versions

CONFIDENCE = 0.95
WORST_SHOWN = 5


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """The options of `wbmpc sweep`."""

    draws: int
    jobs: int | None  # None: one per core
    seed: int
    min_rate: float  # smallest pass rate for exit code 0
    out: Path
    overrides: Mapping[str, JsonValue]  # by dotted path


def sweep(path: Path, options: SweepOptions) -> ExitCode:
    """Run the sweep of one scenario file and write OUT/NAME.sweep.json.

    Raises:
        ScenarioError: the scenario or an override is not valid.
        WbmpcError: the scenario declares no sweep, or the journal belongs to another one.
    """
    scenario = load_scenario(path, options.overrides)
    if scenario.sweep is None:
        raise WbmpcError(f"{path}: the scenario declares no sweep (the key sweep.variations)")
    variations = scenario.sweep.variations
    draws = []
    for index in range(options.draws):
        values, seed = draw_values(variations, seed=options.seed, index=index)
        draws.append(Draw(index, str(path), seed, values, options.overrides))
    for draw in draws:
        scenario_of(scenario, draw)  # a bad draw is known before hours of runs
    make_folder(options.out)
    header = header_of(path, seed=options.seed, overrides=options.overrides, robot=robot_path(scenario))
    journal = Journal(options.out / f"{scenario.name}.sweep.jsonl", header)
    done = sum(row["draw"] < options.draws for row in journal.rows)
    if done:
        say(f"{done} of {options.draws} draws are done already, going on")
    jobs = options.jobs or available_cores()
    with counted(scenario.name, options.draws, done, log=True) as advance:
        rows = run_draws(draws, journal, jobs=jobs, on_done=lambda row: advance(_word(row)))
    document = summary(scenario.name, options.seed, rows, header)
    write_json(options.out / f"{scenario.name}.sweep.json", document)
    journal.remove()
    _print(path, options, document)
    if any(row["error"] for row in rows):
        return ExitCode.INTERNAL_ERROR
    return ExitCode.PASSED if document["pass_rate"] >= options.min_rate else ExitCode.FAILED


def summary(name: str, seed: int, rows: Sequence[Mapping[str, Any]], header: Mapping[str, Any]) -> dict[str, Any]:
    """NAME.sweep.json: the same bytes for any number of processes."""
    passed = sum(row["passed"] for row in rows)
    # Clopper-Pearson: exact, so it never claims more than the draws show, even when all pass.
    interval = binomtest(passed, len(rows)).proportion_ci(CONFIDENCE, method="exact")
    return {
        "scenario": name,
        "seed": seed,
        "set": header["set"],
        "draws": len(rows),
        "passed": passed,
        "pass_rate": passed / len(rows),
        "interval": {"method": "Clopper-Pearson", "level": CONFIDENCE, "low": interval.low, "high": interval.high},
        "scenario_sha256": header["scenario_sha256"],
        "versions": versions(),
        "results": list(rows),
    }


def _word(row: Mapping[str, Any]) -> str:
    return f"draw {row['draw']} {'PASS' if row['passed'] else 'FAIL'}"


def _failed(row: Mapping[str, Any]) -> str:
    if row["error"]:
        return str(row["error"])
    failed = [c for c in row["checks"] if not c["passed"]]
    return ", ".join(f"{c['name']} {number(float('nan') if c['value'] is None else c['value'])}" for c in failed)


def _print(path: Path, options: SweepOptions, document: Mapping[str, Any]) -> None:
    name, rows = document["scenario"], document["results"]
    universal = tuple(UniversalSettings.model_fields)
    worst = sorted(rows, key=lambda row: severity(row, universal), reverse=True)[:WORST_SHOWN]
    table = Table(title=f"{name}: worst draws", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("draw", justify="right")
    table.add_column("result")
    table.add_column("failed checks", overflow="fold")
    for row in worst:
        table.add_row(str(row["draw"]), "pass" if row["passed"] else "FAIL", Text(_failed(row)))
    console().print(table)
    print("again:")
    for row in worst:
        print(f"  {run_command(path, seed=row['seed'], changes={**options.overrides, **row['set']})}")
    low, high = document["interval"]["low"], document["interval"]["high"]
    rate = f"{document['passed']} of {document['draws']} draws passed: {document['pass_rate']:.1%}"
    verdict = "PASS" if document["pass_rate"] >= options.min_rate else "FAIL"
    print(f"{verdict} {name}: {rate} (95 % interval {low:.1%} to {high:.1%})", flush=True)
