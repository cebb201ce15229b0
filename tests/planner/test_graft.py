"""Other settings for a planner with a past: all of them arrive, and nothing else changes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from closed_loop import PERIOD, make_planner, run, scenario, state_at
from numpy.testing import assert_allclose

from wbmpc.planner.graft import FROM_SETTINGS, forbid, graft
from wbmpc.planner.listening import listening
from wbmpc.planner.planner import Planner
from wbmpc.planner.settings import PlannerSettings
from wbmpc.scenario import Scenario
from wbmpc.signals import SIDES, RobotState
from wbmpc.strict import StrictModel

SIZES = {"horizon_steps", "horizon_step"}  # of arrays everywhere
OTHER = {"formulation": "paper", "qp_backend": "osqp", "miqp_backend": "daqp", "middle_share": 0.1, "most_contacts": 1}


def all_different(settings: StrictModel) -> dict[str, Any]:
    """Every setting with another value that is allowed."""
    changed: dict[str, Any] = {}
    for name in type(settings).model_fields:
        value = getattr(settings, name)
        if name in SIZES:
            changed[name] = value
        elif name in OTHER:
            changed[name] = OTHER[name]
        elif isinstance(value, StrictModel):
            changed[name] = all_different(value)
        elif isinstance(value, bool):
            changed[name] = not value
        else:
            changed[name] = value - 2 if isinstance(value, int) else 0.9 * value or 0.001
    return changed


def changed(given: Scenario) -> Scenario:
    patches = {
        name: patch.model_copy(update={"friction": 0.77, "force_cap": 7.7}) for name, patch in given.patches.items()
    }
    settings = PlannerSettings.model_validate(all_different(given.planner))
    return given.model_copy(update={"planner": settings, "patches": patches})


def differences(one: Any, other: Any, path: str, seen: set[int]) -> Iterator[str]:
    """Where two objects of this package differ in a number, a text or a setting."""
    if isinstance(one, np.ndarray):
        if one.dtype.kind in "fiub" and not np.array_equal(one, other, equal_nan=one.dtype.kind == "f"):
            yield path
    elif isinstance(one, str | int | float | bool | StrictModel):
        if one != other and one == one:
            yield path
    elif isinstance(one, list | tuple):
        if len(one) != len(other):
            yield path
        for i, pair in enumerate(zip(one, other, strict=False)):
            yield from differences(*pair, f"{path}[{i}]", seen)
    elif isinstance(one, dict):
        for key in one:
            if isinstance(key, str | int | bool | tuple) and key in other:
                yield from differences(one[key], other[key], f"{path}[{key}]", seen)
    elif type(one).__module__.startswith("wbmpc.") and id(one) not in seen:
        seen.add(id(one))
        names = list(vars(one)) if hasattr(one, "__dict__") else list(type(one).__slots__)
        for name in names:
            yield from differences(getattr(one, name, None), getattr(other, name, None), f"{path}.{name}", seen)


def test_a_planner_without_a_past_becomes_the_other_one() -> None:
    """Whatever a planner's constructor makes of its settings: if it is not in FROM_SETTINGS, it shows here."""
    given = scenario("reach")
    planner = make_planner(given)
    assert len(list(differences(planner, make_planner(changed(given)), "planner", set()))) > 50
    assert not list(differences(planner, make_planner(given), "planner", set()))
    graft(planner, make_planner(changed(given)))
    left = [path for path in differences(planner, make_planner(changed(given)), "planner", set())]
    # A hand keeps the pace of its present approach: that is part of the past, and chosen anew with the next contact.
    assert {path.split(".")[-2] for path in left} == {"_pace"}


def test_every_name_that_is_taken_over_is_there() -> None:
    def names(part: Any, seen: set[int]) -> set[str]:
        if id(part) in seen or not type(part).__module__.startswith("wbmpc.planner"):
            return set()
        seen.add(id(part))
        inner = [getattr(part, name, None) for name in (vars(part) if hasattr(part, "__dict__") else ())]
        return (set(vars(part)) if hasattr(part, "__dict__") else set()).union(*(names(p, seen) for p in inner))

    assert names(make_planner(scenario("reach")), set()) >= FROM_SETTINGS


@pytest.fixture(scope="module")
def states() -> list[RobotState]:
    """Snapshots of a reach until shortly before stage 3 fires, and the one at which it does."""
    given = scenario("reach")
    made = run(given, 3.0)
    firing = next(k for k, report in enumerate(made.reports) if report.candidates)
    return replayed(given, firing)


def replayed(given: Scenario, last: int) -> list[RobotState]:
    from closed_loop import ROBOT

    planner, states = make_planner(given), []
    q, v = ROBOT.home_q.copy(), np.zeros(ROBOT.nv)
    for k in range(last + 1):
        states.append(state_at(k * PERIOD, q, v))
        plan = planner.solve(states[-1])
        q, v = ROBOT.integrate(q, PERIOD * plan.velocity), plan.velocity
        np.clip(q[7:], ROBOT.joint_lower, ROBOT.joint_upper, out=q[7:])
    return states


def before(given: Scenario, states: list[RobotState]) -> Planner:
    planner = make_planner(given)
    for state in states[:-1]:
        planner.solve(state)
    return planner


def test_the_past_stays(states: list[RobotState]) -> None:
    """The same settings once more: only the first guesses of the solvers are gone."""
    given = scenario("reach")
    as_it_was, grafted = before(given, states).solve(states[-1]), before(given, states)
    graft(grafted, make_planner(given))
    again = grafted.solve(states[-1])
    assert as_it_was.report.candidates
    assert_allclose(again.report.com, as_it_was.report.com, atol=1e-9)
    assert again.report.events == as_it_was.report.events
    assert_allclose(again.velocity, as_it_was.velocity, atol=1e-7)


def test_a_price_that_is_grafted_counts_in_the_next_choice(states: list[RobotState]) -> None:
    given = scenario("reach")
    plain = before(given, states).solve(states[-1]).report
    planner = before(given, states)
    dearer = given.planner.contact.model_copy(update={"distance_cost": 2.0 * given.planner.contact.distance_cost})
    settings = given.planner.model_copy(update={"contact": dearer})
    graft(planner, make_planner(given.model_copy(update={"planner": settings})))
    costs = {(c.patch, c.hand): c.cost for c in plain.candidates if np.isfinite(c.cost)}
    now = {(c.patch, c.hand): c.cost for c in planner.solve(states[-1]).report.candidates}
    assert costs
    assert all(now[key] > cost + 0.05 for key, cost in costs.items())


def test_a_forbidden_contact_makes_another_be_chosen(states: list[RobotState]) -> None:
    given = scenario("reach")
    chosen = [c.patch for c in before(given, states).solve(states[-1]).report.candidates if c.chosen]
    assert len(chosen) == 1
    planner = before(given, states)
    forbid(planner, chosen[0])
    report = planner.solve(states[-1]).report
    instead = [c.patch for c in report.candidates if c.chosen]
    assert len(instead) == 1
    assert instead != chosen
    assert "forbidden" in {c.reason for c in report.candidates if c.patch == chosen[0]}
    assert any(f"chose {instead[0]} for the {side} hand" in event for event in report.events for side in SIDES)


def test_listening_changes_nothing(states: list[RobotState]) -> None:
    given = scenario("reach")
    one, other = before(given, states), before(given, states)
    stages = [other._height_stage, other._need_stage, other._contacts.candidates._choice]
    with listening(other) as heard:
        plan = other.solve(states[-1])
    np.testing.assert_array_equal(plan.report.com, one.solve(states[-1]).report.com)
    assert [other._height_stage, other._need_stage, other._contacts.candidates._choice] == stages
    assert {call.stage for call in heard} >= {"height", "need", "choice", "motion"}
