"""`wbmpc explain`: one plan of a recording solved again, taken apart, and set beside one with a change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wbmpc.commands.exits import ExitCode
from wbmpc.commands.explain_tables import print_candidates, print_notable, print_outcome, print_stages
from wbmpc.commands.progress import simulated_time
from wbmpc.errors import WbmpcError
from wbmpc.explain.changes import OF_A_PLAN, change_of
from wbmpc.explain.explanation import Explanation
from wbmpc.explain.explanation import explain as solve_again
from wbmpc.explain.past import Past, open_past
from wbmpc.files import prepare, writing


@dataclass(frozen=True, slots=True)
class ExplainOptions:
    """The options of `wbmpc explain`."""

    at: float | None  # [s]; None: list the plans that are worth a look
    overrides: Mapping[str, Any]  # by dotted path
    robot: Path | None
    json: Path | None  # where the whole answer goes, "-" for standard output
    most: int  # active constraints printed for each stage


def explain(path: Path, options: ExplainOptions) -> ExitCode:
    """Print the explanation; exit code 1 when the plan is not the recorded one to the bit.

    Raises:
        ScenarioError: a change that cannot be made.
        WbmpcError: as `open_past`, a time outside the recording, or a change without a time.
    """
    past = open_past(path, robot=options.robot)
    if options.at is None:
        for option, given in (("--set", options.overrides), ("--json", options.json)):
            if given:
                raise WbmpcError(f"{option}: say with --at which plan")
        print_notable(past)
        return ExitCode.PASSED
    index = past.index_at(options.at)
    if options.json not in (None, Path("-")):
        prepare(options.json)
    change = change_of(past.run.scenario, options.overrides, allowed=OF_A_PLAN) if options.overrides else None
    time = past.plans[index].state.time
    with simulated_time(f"{past.run.name} again", time) as on_progress:
        answer = solve_again(past, index, change, lambda k: on_progress(past.plans[k].state.time))
    if options.json is not None:
        _write(answer, past, options.json)
    if options.json != Path("-"):
        print(_identity(answer, past), flush=True)
        print_outcome(answer)
        print_stages(answer, options.most)
        print_candidates(answer)
    return ExitCode.PASSED if answer.identical else ExitCode.FAILED


def _identity(answer: Explanation, past: Past) -> str:
    """Whether the plan is the recorded one, in a line."""
    here = f"{past.run.name}: plan {answer.index + 1} of {len(past.plans)}, from the snapshot of {answer.time:.3f} s"
    if answer.identical:
        before = "" if answer.parted is None else f"; plan {answer.parted + 1} before it was not"
        return f"{here}: the recorded plan, bit for bit{before or f', and so are the {answer.index} before it'}"
    first = answer.index if answer.parted is None else answer.parted
    source = "" if past.run.same_source else "; the program's source is not the one that made the recording"
    apart = ", ".join(f"{name} {1e3 * value:.3g} mm" for name, value in answer.differences.items())
    return f"{here}: NOT the recorded plan ({apart} apart; plan {first + 1} is the first that differs){source}"


def _write(answer: Explanation, past: Past, target: Path) -> None:
    document = {"run": past.run.name, "same_source": past.run.same_source} | answer.as_dict()
    text = json.dumps(document, indent=2, ensure_ascii=False)
    if target == Path("-"):
        print(text, flush=True)
        return
    with writing(target):
        target.write_text(text + "\n", encoding="utf-8")
