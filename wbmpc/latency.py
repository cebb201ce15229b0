"""One scenario at one plan delay after the other: how old a plan may be at its first use before the scenario fails.

In lockstep, where the delay is simulated: nothing here depends on the machine or on the number of processes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from typing import Any

from wbmpc.checks.settings import UniversalSettings
from wbmpc.errors import WbmpcError
from wbmpc.pool import Died, finished
from wbmpc.scenario import Scenario, vary
from wbmpc.verdict import finite

Row = dict[str, Any]  # of the table, one delay: plain data, without wall times
KEY = "loop.planner_delay"


def at_delay(scenario: Scenario, ticks: int) -> Scenario:
    """The scenario with plans that take effect `ticks` after their snapshot.

    Raises:
        ScenarioError: more than a scenario may ask for.
    """
    return vary(scenario, {KEY: ticks / scenario.loop.physics_rate})


def run_delay(scenario: Scenario) -> Row:
    """Run one delay; its row."""
    from wbmpc.session import run_scenario  # MuJoCo, Pinocchio and the solvers: only when something runs

    try:
        verdict = run_scenario(scenario, name=scenario.name).verdict
    except WbmpcError:
        raise
    except Exception as error:  # a delay that breaks the program must not lose the others
        first_line = (str(error).splitlines() or [""])[0]
        return _row(scenario, error=f"{type(error).__name__}: {first_line}")
    row: Row = finite(
        {
            **_row(scenario),
            "passed": verdict.passed,
            "checks": [asdict(check) for check in verdict.checks],
            "metrics": dict(verdict.metrics),
            "state_sha256": verdict.state_sha256,
        }
    )
    return row


def run_delays(
    scenario: Scenario,
    delays: Sequence[int],
    *,
    jobs: int,
    on_done: Callable[[Row], None],
    work: Callable[[Scenario], Row] = run_delay,
) -> list[Row]:
    """Run the given delays, then bisect between the first that fails and the one before it, to one planner period.

    Args:
        delays: in ticks.
        jobs: parallel processes; the bisection is made in this one.
        on_done: called with each row as it comes.
        work: what runs one; importable by name, since processes are spawned.

    Returns:
        The rows, sorted by delay.
    """
    runs = [at_delay(scenario, ticks) for ticks in sorted(set(delays))]
    rows: list[Row] = []
    with closing(finished(work, runs, jobs=jobs)) as results:
        for index, result in results:
            rows.append(_row(runs[index], error=result.reason) if isinstance(result, Died) else result)
            on_done(rows[-1])
    while (middle := _between(rows, scenario)) is not None:
        rows.append(work(at_delay(scenario, middle)))
        on_done(rows[-1])
    return sorted(rows, key=lambda row: float(row["delay"]))


def boundary(rows: Sequence[Row]) -> tuple[float | None, float | None]:
    """The largest delay that passes and the smallest that fails [s], going up from the first one that passes.

    What fails below the first that passes is too fresh a plan, not too old a one. Above the first failure the outcome
    need not be monotone. A run that broke the program says nothing. None where there is no such delay.
    """
    passes, fails = None, None
    for row in sorted(rows, key=lambda row: float(row["delay"])):
        if row["error"] is not None:
            continue
        if row["passed"]:
            passes = row["delay"]
        elif passes is not None:
            fails = row["delay"]
            break
    return passes, fails


def first_failed(row: Row) -> Mapping[str, Any] | None:
    """Of the failed checks the one that was violated first, in the run's time."""
    failed = [check for check in row["checks"] if not check["passed"]]
    return min(failed, key=lambda c: math.inf if c["first_violation"] is None else c["first_violation"], default=None)


def margin(check: Mapping[str, Any]) -> float:
    """Distance of a check's value from its threshold over the threshold, −1 … 1; negative when it failed."""
    value, threshold, sign = check["value"], check["threshold"], 1.0 if check["passed"] else -1.0
    if value is None or not threshold:
        return sign
    return sign * min(abs(value - threshold) / abs(threshold), 1.0)


def key_check(row: Row) -> str:
    """Name of the check to follow over the delays: the scenario's first one that is neither a count nor a ratio."""
    own = [check for check in row["checks"] if check["name"] not in UniversalSettings.model_fields]
    name: str = next((check for check in own if check["unit"] != "1"), own[0])["name"]
    return name


def _between(rows: Sequence[Row], scenario: Scenario) -> int | None:
    """The tick count to try next; None when the boundary is known to a planner period."""
    passes, fails = boundary(rows)
    if passes is None or fails is None:
        return None
    period = scenario.loop.planner_period_ticks
    low, high = (round(delay * scenario.loop.physics_rate) for delay in (passes, fails))
    if high - low <= period:
        return None
    middle = low + max((high - low) // (2 * period), 1) * period
    tried = {round(row["delay"] * scenario.loop.physics_rate) for row in rows}
    return None if middle in tried else middle  # a run that broke the program is not asked again


def _row(scenario: Scenario, error: str | None = None) -> Row:
    return {"delay": scenario.loop.planner_delay, "passed": False, "error": error, "checks": []}
