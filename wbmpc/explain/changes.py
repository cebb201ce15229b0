"""What `--set` may change in the middle of a run, and the scenario that it makes of the recorded one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any

from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario import Scenario, vary

FORBID = "forbid"
# Of a planner that has a past: its settings, what it believes of the patches, and which of these it may choose.
OF_A_PLAN = (FORBID, "planner.*", "patches.*.friction", "patches.*.force_cap")
# Of a run that goes on: also what the planner is not told.
OF_A_RUN = (
    *OF_A_PLAN,
    *("tracker.*", "sensors.*", "disturbances", "disturbances.*", "loop.planner_delay"),
    *("world.floor.friction", "world.objects.*.friction", "world.tiles.friction", "world.staircase.friction"),
    *("plant.friction", "plant.mass_scale", "plant.body_mass_scale", "plant.body_mass_scale.*"),
)
_SIZES = {"planner.horizon_steps", "planner.horizon_step"}


@dataclass(frozen=True, slots=True)
class Change:
    """One change to a recorded run."""

    scenario: Scenario  # the recorded one, changed
    forbidden: Sequence[str]  # patches that stage 3 may not choose
    words: Sequence[str]  # "planner.contact.distance_cost: 0.4 -> 4"


def change_of(scenario: Scenario, overrides: Mapping[str, Any], *, allowed: Sequence[str]) -> Change:
    """Apply `overrides` (by dotted path; `forbid`: a patch or a list of them) to a recorded run's scenario.

    Raises:
        ScenarioError: a path is none of `allowed`, a patch does not exist, or the changed scenario is not valid.
    """
    values = dict(overrides)
    forbidden = _patches(scenario, values.pop(FORBID)) if FORBID in values else ()
    problems = [
        Problem(f"--set {key}", f"cannot change in the middle of a run; what can: {', '.join(allowed)}")
        for key in values
        if key in _SIZES or not any(fnmatchcase(key, pattern) for pattern in allowed)
    ]
    if problems:
        raise ScenarioError(problems)
    changed = vary(scenario, values) if values else scenario
    before, after = scenario.to_document(), changed.to_document()
    words = [f"{key}: {_short(_value(before, key))} -> {_short(_value(after, key))}" for key in values]
    return Change(changed, forbidden, [*words, *(f"{FORBID} {name}" for name in forbidden)])


def _patches(scenario: Scenario, value: Any) -> tuple[str, ...]:
    names = value if isinstance(value, list) else [value]
    for name in names:
        if not isinstance(name, str) or name not in scenario.patches:
            near = get_close_matches(str(name), scenario.patches, n=1)
            choices = f"choices: {', '.join(scenario.patches)}" if scenario.patches else "the scenario has none"
            hint = f", did you mean '{near[0]}'?" if near else ""
            raise ScenarioError([Problem(f"--set {FORBID}", f"unknown patch '{name}'{hint} ({choices})")])
    return tuple(names)


def _short(value: Any) -> str:
    """A value as text; of a block only that it is one."""
    if isinstance(value, dict | list):
        return f"{len(value)} {'keys' if isinstance(value, dict) else 'items'}"
    return str(value)


def _value(document: Any, key: str) -> Any:
    """What stands at a dotted path; None where it was not."""
    for part in key.split("."):
        if isinstance(document, list):
            document = document[int(part)]
        elif isinstance(document, dict):
            document = document.get(part)
        else:
            return None
    return document
