"""`wbmpc interact`: a scenario in MuJoCo's viewer, in real time, with a person at the controls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from pydantic import JsonValue

from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.tables import print_checks, timing_line
from wbmpc.files import make_folder
from wbmpc.scenario import Scenario, load_scenario


@dataclass(frozen=True, slots=True)
class InteractOptions:
    """The options of `wbmpc interact`."""

    out: Path
    overrides: Mapping[str, JsonValue]  # by dotted path
    seed: int | None  # None: the scenario's own
    duration: float  # [s] at least so long a run may be
    pace: float  # of real time, at first
    record: bool


def interact(path: Path, options: InteractOptions) -> ExitCode:
    """Open the window and run until the person ends it; then again when they want to begin anew.

    The exit code is 0 however the robot has done: a run that somebody took part in proves nothing.

    Raises:
        ScenarioError: the scenario or an override is not valid.
        WbmpcError: there is no display for the window, or the output folder cannot be made.
    """
    scenario = load_scenario(path, options.overrides, options.seed)
    scenario = scenario.model_copy(update={"duration": max(scenario.duration, options.duration)})
    make_folder(options.out)
    from wbmpc.interact.controls import HELP
    from wbmpc.interact.window import open_window

    window = open_window(scenario)
    say(HELP)
    try:
        for number in count(1):
            name = f"{scenario.name}.interactive" + (f"-{number}" if number > 1 else "")
            if not _run(scenario, name, window, options):
                return ExitCode.PASSED
    finally:
        window.close()
    raise AssertionError("count has no end")


def _run(scenario: Scenario, name: str, window, options: InteractOptions) -> bool:  # type: ignore[no-untyped-def]
    """One run and its files; whether another one is wanted."""
    from wbmpc.interact.operator import Operator
    from wbmpc.session import run_scenario

    operator = Operator(window, scenario, pace=options.pace)
    recording = options.out / f"{name}.rrd" if options.record else None
    result = run_scenario(scenario, name=name, recording=recording, realtime=True, operator=operator)
    verdict = result.verdict
    verdict.write(options.out / f"{name}.json")
    print_checks(f"{name}  (interactive: no test; seed {verdict.seed})", verdict.checks)
    print(timing_line(name, verdict.timing))
    passed = len(verdict.checks) - len(verdict.failing)
    print(f"INTERACTIVE {name}: {passed} of {len(verdict.checks)} checks hold", flush=True)
    return operator.ask("The run is over. Backspace: begin anew. End: quit.")
