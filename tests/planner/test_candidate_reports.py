"""What the recording says of a candidate, against the problem that was solved and against plain mechanics."""

from __future__ import annotations

import numpy as np
import pytest
from contact_case import BEHIND, FRONT, MASS, POLYGON, SETTINGS, TABLE, WALL, lean, patch, pressure
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_contact_choice import INSTANCES, admissible, random_options

from wbmpc.planner.candidate_reports import Weighed, cost_parts, friction_margin, weigh
from wbmpc.planner.contact_choice import ContactChoice, Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contact_stage import make_contact_choice
from wbmpc.planner.firing import worst_knots
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY

LEFTWARDS = np.array([0.0, 1.0])
WEIGHT = MASS * GRAVITY


def weighed(need: Need, *patches: PatchPose, backend: str = "enumeration") -> list[Weighed]:
    """Each patch alone, for the right hand, at a price of 0.1."""
    options = [Option(place, 1, 0.1) for place in patches]
    choice = make_contact_choice(backend, len(options), SETTINGS, mass=MASS)
    sets = [(i,) for i in range(len(options))]
    return weigh(choice, need, options, sets, left=LEFTWARDS, settings=SETTINGS, mass=MASS)


@settings(max_examples=60, deadline=None)
@given(**INSTANCES)
def test_the_parts_are_the_cost(seed: int, weak: bool, most: int, beyond: float, sideways: float) -> None:
    options, need = random_options(seed, weak=weak), lean(beyond, sideways=sideways)
    sets = list(admissible(options, most))
    choice = make_contact_choice("enumeration", len(options), SETTINGS, mass=MASS)
    for answer in weigh(choice, need, options, sets, left=LEFTWARDS, settings=SETTINGS, mass=MASS):
        assert (answer.hindrance == "") == bool(np.isfinite(answer.cost))
        if np.isfinite(answer.cost):
            assert sum(answer.parts) == pytest.approx(answer.cost, rel=1e-7, abs=1e-9)
            assert min(answer.parts) >= 0.0


def test_the_parts_of_the_plain_problem_are_its_cost() -> None:
    options = [Option(TABLE, 1, 0.1), Option(WALL, 0, 0.2)]
    choice = ContactChoice(2, SETTINGS, mass=MASS, backend="daqp")
    ((cost, forces),) = choice.costs(lean(0.03), options, [(0, 1)], left=LEFTWARDS)
    parts = cost_parts(lean(0.03), options, forces, settings=SETTINGS, mass=MASS)
    assert parts.way == pytest.approx(0.3)
    assert sum(parts) == pytest.approx(cost, rel=1e-3)


def test_each_part_is_what_its_name_says() -> None:
    """By hand: a push of 3 N up and 1 N back on the table, at one knot."""
    need, force = lean(0.03, knots=1), np.array([-1.0, 0.0, 3.0])
    parts = cost_parts(need, [Option(TABLE, 1, 0.25)], force[None, None], settings=SETTINGS, mass=MASS)
    assert parts.way == 0.25
    expected = 0.5 * (SETTINGS.force_cost * 3.0**2 + SETTINGS.tangent_cost * 1.0**2) / WEIGHT**2
    assert parts.force == pytest.approx(expected)
    # The feet carry what is left: how far their pressure is from where ΔZ wants it is the shift that is missing.
    there = pressure(need, 0, [TABLE.position], force[None])
    missing = (WEIGHT - 3.0) * (there - (need.zmp[0] + need.delta_z[0])) / WEIGHT
    assert parts.shift == pytest.approx(0.5 * SETTINGS.shift_slack_cost * float(missing @ missing))


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_friction_margin_is_the_distance_to_the_cone_along_the_surface(seed: int) -> None:
    """More tangential force by the margin is on the true cone: μ is the tangent of the angle to the normal."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    tangent = np.cross(normal, rng.normal(size=3))
    tangent /= np.linalg.norm(tangent)
    friction, push, slide = rng.uniform(0.2, 1.0), rng.uniform(1.0, 10.0), rng.uniform(0.0, 12.0)
    margin = friction_margin(patch(np.zeros(3), normal, friction=friction), np.array([push * normal + slide * tangent]))
    at_the_edge = push * normal + (slide + margin) * tangent
    cosine = at_the_edge @ normal / np.linalg.norm(at_the_edge)
    assert np.arccos(cosine) == pytest.approx(np.arctan(friction), abs=1e-6)
    assert (margin >= 0.0) == (slide <= friction * push)


def test_the_worst_knot_gives_the_margin() -> None:
    forces = np.array([[0.0, 0.0, 4.0], [1.0, 0.0, 4.0], [0.0, 0.5, 4.0]])
    assert friction_margin(TABLE, forces) == pytest.approx(0.5 * 4.0 - 1.0)


def test_forces_of_weighed_candidates_are_in_their_cones_and_keep_the_pressure_inside() -> None:
    need = lean(0.03)
    (table,) = weighed(need, TABLE)
    assert friction_margin(TABLE, table.forces) > 0.0
    assert (table.forces @ TABLE.normal <= TABLE.force_cap + 1e-9).all()
    for k in range(len(need.zmp)):
        there = pressure(need, k, [TABLE.position], table.forces[k][None])
        assert (POLYGON.normals @ there <= POLYGON.offsets + 1e-9)[np.isfinite(POLYGON.offsets)].all()


@pytest.mark.parametrize("backend", ["enumeration", "daqp"])
def test_why_none_of_its_forces_does(backend: str) -> None:
    weak, slippery = patch(TABLE.position, cap=0.4), patch([0.2, -0.1, 0.2], np.array([0.0, 1.0, 0.0]), friction=0.1)
    table, too_weak, too_slippery, behind = weighed(lean(0.03), TABLE, weak, slippery, BEHIND, backend=backend)
    assert table.hindrance == ""
    assert too_weak.hindrance == "needs more than its 0.4 N"
    assert too_slippery.hindrance == "would slip: needs a friction above 0.1"
    assert np.isnan(too_weak.parts).all()
    assert not too_weak.forces.any()
    # A table behind the robot: pushing on it lifts the feet's load off the wrong end, but friction could pull.
    assert behind.hindrance == "would slip: needs a friction above 0.5"


def test_what_no_force_can_give() -> None:
    """A patch at the height of the soles, behind them: any push on it moves the feet's pressure forward."""
    (floor,) = weighed(lean(0.03), patch([-0.25, 0.0, 0.0], friction=0.5))
    assert floor.hindrance == "no force on it gives the shift"
    assert not np.isfinite(floor.cost)


def test_the_knots_asked_about_carry_their_times() -> None:
    times = 0.1 * np.arange(1, 9)
    need = lean(0.0, knots=8, growth=0.002)
    goal = lean(0.05, knots=1)
    asked = worst_knots(need, goal, times=times, threshold=0.002)
    assert_allclose(asked.after, [0.8, np.inf])
    assert_allclose(asked.need.delta_z[:, 0], [-0.014, -0.05])
    assert_allclose(asked.need.zmp[:, 0], FRONT + np.array([0.014, 0.05]))
    for nothing in (None, lean(0.001, knots=1)):
        assert_allclose(worst_knots(need, nothing, times=times, threshold=0.002).after, [0.8, 0.1])
