"""Random draws over a scenario's declared ranges, in parallel processes, resumable after a kill.

Draw i depends on (seed, i) alone, never on the number of processes or on the order in which they finish.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import JsonValue

from wbmpc.errors import WbmpcError
from wbmpc.pool import Died, finished
from wbmpc.scenario import Scenario, Variation, load_scenario, vary
from wbmpc.sweep_journal import Journal
from wbmpc.verdict import Verdict, finite
from wbmpc.versions import source_hash

DIGITS = 6  # significant digits of a drawn number: what the reproduce command shows is what ran


@dataclass(frozen=True, slots=True)
class Draw:
    """One run of a sweep; plain data, since it travels to another process."""

    index: int
    path: str  # scenario file
    seed: int  # of the run
    values: Mapping[str, JsonValue]  # drawn, by dotted path
    overrides: Mapping[str, JsonValue]  # the user's own --set, by dotted path


def draw_values(variations: Sequence[Variation], *, seed: int, index: int) -> tuple[dict[str, JsonValue], int]:
    """Values by dotted path, and the seed of the run, of draw `index` of the sweep with `seed`."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    values: dict[str, JsonValue] = {}
    for variation in variations:
        if variation.uniform is not None:
            values[variation.key] = float(f"{rng.uniform(*variation.uniform):.{DIGITS}g}")
        else:
            choices = variation.choice or ()
            values[variation.key] = choices[int(rng.integers(len(choices)))]
    return values, int(rng.integers(2**31))


def scenario_of(scenario: Scenario, draw: Draw) -> Scenario:
    """The scenario of one draw, with the sweep's own checks where it declares some.

    Raises:
        ScenarioError: the drawn values do not make a valid scenario together.
    """
    checks = scenario.sweep.checks if scenario.sweep else None
    return vary(scenario, {**draw.values, "seed": draw.seed}, checks=checks)


def run_draw(draw: Draw) -> dict[str, Any]:
    """Run one draw; the row of the journal. Nothing in it depends on time or machine load."""
    from wbmpc.session import run_scenario  # MuJoCo, Pinocchio and the solvers: only when something runs

    row = _begun(draw)
    try:
        scenario = scenario_of(load_scenario(draw.path, draw.overrides), draw)
        verdict = run_scenario(scenario, name=scenario.name, recording=None).verdict
    except WbmpcError:
        raise
    except Exception as error:  # one draw that breaks the program must not lose the others
        first_line = (str(error).splitlines() or [""])[0]
        return _broken(row, f"{type(error).__name__}: {first_line}")
    return {**row, **_outcome(verdict)}


def _begun(draw: Draw) -> dict[str, Any]:
    return {"draw": draw.index, "seed": draw.seed, "set": dict(draw.values)}


def _broken(row: dict[str, Any], error: str) -> dict[str, Any]:
    return {**row, "passed": False, "error": error, "checks": []}


def _outcome(verdict: Verdict) -> dict[str, Any]:
    outcome: dict[str, Any] = finite(
        {
            "passed": verdict.passed,
            "error": None,
            "checks": [asdict(check) for check in verdict.checks],
            "metrics": dict(verdict.metrics),
            "state_sha256": verdict.state_sha256,
        }
    )
    return outcome


def run_draws(
    draws: Sequence[Draw],
    journal: Journal,
    *,
    jobs: int,
    on_done: Callable[[dict[str, Any]], None],
    work: Callable[[Draw], dict[str, Any]] = run_draw,
) -> list[dict[str, Any]]:
    """Run the draws that the journal does not have yet, in `jobs` processes.

    Args:
        on_done: called with the row of each draw when it is finished and safely in the journal; a draw whose process
            died is reported, and run again when the sweep is resumed.
        work: what runs one draw; importable by name, since processes are spawned.

    Returns:
        The rows of all `draws`, sorted by draw.
    """
    rows = {row["draw"]: row for row in journal.rows}
    todo = [draw for draw in draws if draw.index not in rows]
    with closing(finished(work, todo, jobs=jobs)) as results:
        for index, result in results:
            if isinstance(result, Died):
                row = _broken(_begun(todo[index]), result.reason)  # not in the journal: may be well another time
            else:
                row = result
                journal.append(row)
            rows[row["draw"]] = row
            on_done(row)
    return [rows[draw.index] for draw in draws]


def severity(row: Mapping[str, Any], ignored: Sequence[str] = ()) -> tuple[int, float]:
    """How bad a draw is: number of failed checks, then the largest relative violation; negative: the margin left.

    Checks named in `ignored` count only when they fail.
    """
    if row["error"] is not None:
        return (math.inf, math.inf)  # type: ignore[return-value]
    worst = -math.inf
    for check in row["checks"]:
        if check["passed"] and check["name"] in ignored:
            continue
        if check["value"] is None:
            worst = math.inf
        elif check["threshold"]:
            distance = abs(check["value"] - check["threshold"]) / abs(check["threshold"])
            worst = max(worst, -distance if check["passed"] else distance)
    return sum(not check["passed"] for check in row["checks"]), worst


def header_of(path: Path, *, seed: int, overrides: Mapping[str, JsonValue], robot: Path) -> dict[str, Any]:
    """What must be equal for a journal to be continued."""
    return {
        "format": 1,
        "scenario_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "robot_sha256": hashlib.sha256(robot.read_bytes()).hexdigest(),
        "source_sha256": source_hash(),
        "seed": seed,
        "set": json.loads(json.dumps(dict(overrides))),
    }
