"""The enumeration's bounds and its costs of given sets; its answers are in test_contact_choice.py."""

from __future__ import annotations

from itertools import combinations
from typing import get_args

import numpy as np
import pytest
from contact_case import MASS, SETTINGS, lean
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_contact_choice import LEFT, LEFTWARDS, RIGHT, SLOTS, forces_of, random_options

from wbmpc.planner.contact_choice import ContactChoice, Option
from wbmpc.planner.contact_cuts import collect_multipliers, cut_by_infeasibility, cut_by_optimum, empty_table
from wbmpc.planner.contact_sets import ContactSets
from wbmpc.planner.contact_stage import ENUMERATION, make_contact_choice
from wbmpc.planner.knot_qp import (
    GRIP,
    NEED,
    Grips,
    empty_room,
    pack_need,
    pack_patch,
    pack_prices,
    solve_knot,
    unpack_grips,
    unpack_need,
)
from wbmpc.planner.settings import PlannerSettings
from wbmpc.qp import MIQP_BACKENDS
from wbmpc.rotations import contact_frame
from wbmpc.signals import GRAVITY, SolveStatus

SEEDS = st.integers(0, 2**32 - 1)
KNOTS = 4


def grips_of(options: list[Option]) -> Grips:
    packed = np.zeros((len(options), GRIP))
    for row, option in zip(packed, options, strict=True):
        pack_patch(option.patch, row)
    return unpack_grips(packed, pack_prices(SETTINGS), MASS * GRAVITY)


def many_options(seed: int, count: int) -> list[Option]:
    options: list[Option] = []
    while len(options) < count:
        more = random_options(seed + 7919 * len(options), weak=seed % 2 == 0)
        options += [Option(option.patch, option.hand, option.price) for option in more]
    return options[:count]


def every_set(options: list[Option]) -> list[tuple[int, ...]]:
    return [members for size in (1, 2) for members in combinations(range(len(options)), size)]


@pytest.mark.parametrize("knots", [1, 2, 16])
def test_nothing_better_among_many_options(knots: int) -> None:
    """32 options: the winner, with hardly any set solved, is the cheapest of all sets, every one of them solved."""
    fast, dismissed, answered = ContactSets(32, SETTINGS, mass=MASS, knots=knots), 0, 0
    for seed in range(12):
        options = many_options(seed, 32)
        need = lean(0.003 * seed, sideways=0.004 * (seed - 6), knots=knots, growth=0.01 / knots)
        answer, sets = fast.solve(need, options, left=LEFTWARDS), every_set(options)
        costs = [cost for cost, _ in fast.costs(need, options, sets, left=LEFTWARDS)]
        assert answer.objective == pytest.approx(min(costs), rel=1e-9, abs=1e-12)
        if np.isfinite(answer.objective):
            answered += 1
            assert costs[sets.index(tuple(sorted(answer.winners)))] == answer.objective
        dismissed += np.isfinite(costs).sum() > 2 * answer.solution.iterations
    assert answered >= 6
    assert dismissed >= 3


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, weak=st.booleans(), beyond=st.floats(0.005, 0.04), sideways=st.floats(-0.05, 0.05))
def test_costs_of_given_sets(seed: int, weak: bool, beyond: float, sideways: float) -> None:
    """Held contacts are paid for; sets that no hands can hold cost inf; the rest agrees with a second writing."""
    options, need = random_options(seed, weak=weak), lean(beyond, sideways=sideways)
    fast = ContactSets(SLOTS, SETTINGS, mass=MASS)
    sets = every_set(options)
    for members, (cost, forces) in zip(sets, fast.costs(need, options, sets, left=LEFTWARDS), strict=True):
        chosen = [options[i] for i in members]
        hands, patches = {option.hand for option in chosen}, {id(option.patch) for option in chosen}
        across = {option.hand: option.patch.position[1] for option in chosen}
        crossed = len(across) == 2 and across[LEFT] - across[RIGHT] < 0.05
        expected = None
        if len(hands) == len(patches) == len(chosen) and not crossed:
            expected = forces_of(need, [option.patch for option in chosen])
        if expected is None:
            assert cost == np.inf
            continue
        prices = sum(option.price for option in chosen if not option.held)
        assert cost == pytest.approx(expected[0] + prices, rel=1e-7, abs=1e-9)
        assert_allclose(forces, expected[1], atol=1e-5)


def test_the_plain_problem_knows_the_same_costs() -> None:
    plain, fast = ContactChoice(SLOTS, SETTINGS, mass=MASS, backend="daqp"), ContactSets(SLOTS, SETTINGS, mass=MASS)
    finite = 0
    for seed in range(12):
        options, need = random_options(seed, weak=False), lean(0.02)
        sets = every_set(options)
        ours, theirs = (solver.costs(need, options, sets, left=LEFTWARDS) for solver in (fast, plain))
        for (cost, forces), (other_cost, other_forces) in zip(ours, theirs, strict=True):
            assert cost == pytest.approx(other_cost, rel=1e-3, abs=1e-4)
            if np.isfinite(cost):
                finite += 1
                assert_allclose(forces, other_forces, atol=0.05)
    assert finite >= 10


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, beyond=st.floats(0.005, 0.03), sideways=st.floats(-0.04, 0.04))
def test_multipliers_bound_the_cost_of_every_set(seed: int, beyond: float, sideways: float) -> None:
    """Below every set's true cost, and equal to that of the set they come from; a proof dismisses nothing feasible."""
    options = [Option(option.patch, option.hand, option.price) for option in random_options(seed, weak=seed % 2 == 0)]
    question = lean(beyond, sideways=sideways, knots=KNOTS, growth=0.003)
    packed = np.zeros((KNOTS, NEED))
    pack_need(question, packed)
    need, grips, room = unpack_need(packed, MASS * GRAVITY), grips_of(options), empty_room()
    sets = [s for s in every_set(options) if len(s) == 1 or options[s[0]].hand != options[s[1]].hand]
    costs = []
    for members in sets:
        expected = forces_of(question, [options[i].patch for i in members])
        costs.append(np.inf if expected is None else expected[0] + sum(options[i].price for i in members))
    for own, members in enumerate(sets):
        table = empty_table(len(options), KNOTS)
        table.price[:] = [option.price for option in options]
        for s, (first, *second) in enumerate(sets):
            table.first[s], table.second[s] = first, second[0] if second else -1
        constant = 0.0
        for k in range(KNOTS):
            value = solve_knot(room, need, k, grips, members[0], members[1] if len(members) > 1 else -1, 0.0)
            if value == np.inf:
                cut_by_infeasibility(table, len(sets), room, need, k, grips)
                break
            constant += collect_multipliers(table, room, need, k, grips.slack_price)
        else:
            cut_by_optimum(table, len(sets), constant, need, grips)
            assert table.bound[own] == pytest.approx(costs[own], rel=1e-7, abs=1e-9)
        assert (table.bound[: len(sets)] <= np.array(costs) * (1.0 + 1e-7) + 1e-9).all()


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS)
def test_contact_frames_are_those_of_the_plain_problem(seed: int) -> None:
    """The tangents matter: they are where the four sides of the cone are."""
    options = random_options(seed, weak=False)
    for option, axes in zip(options, grips_of(options).axes, strict=True):
        assert_allclose(axes, contact_frame(option.patch.normal).T, atol=1e-14)


def test_every_backend_of_the_schema_exists() -> None:
    names = get_args(PlannerSettings.model_fields["miqp_backend"].annotation)
    assert set(names) == {ENUMERATION, *MIQP_BACKENDS}
    for name in names:
        choice = make_contact_choice(name, 2, SETTINGS, mass=MASS)
        answer = choice.solve(lean(0.02), many_options(3, 2), left=LEFTWARDS)
        assert answer.solution.status in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE)
