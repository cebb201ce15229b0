"""Two contacts at once, in a kinematic closed loop: chosen together, one after the other, or one alone."""

from __future__ import annotations

from functools import cache

import numpy as np
from closed_loop import PERIOD, Run, run, scenario
from newton_euler import centre_of_pressure
from numpy.testing import assert_allclose
from robots import soles, surena

from wbmpc.scenario import resolve_patches
from wbmpc.signals import ContactPhase

ROBOT = surena()
QUICK = {
    "tasks": [{"kind": "lean", "target": [0.12, 0.0], "arrive_by": 2.5, "hold": 0.5, "withdraw": 2.0, "patience": 0.5}]
}
LEAN = scenario("two_hands", **QUICK)
TOES = float(soles(ROBOT.home_q)[:, 0].max() + ROBOT.sole_half_extents[0])
CAP = {patch.name: patch.force_cap for patch in resolve_patches(LEAN)}
P = ContactPhase
LIFE = [P.CHOSEN, P.APPROACHING, P.SENSED, P.LOADED, P.QUIET, P.UNLOADED, P.RELEASED]


@cache
def leaning() -> Run:
    return run(LEAN, 9.0)


def test_two_contacts_are_chosen_at_once_loaded_and_released() -> None:
    result = leaning()
    chosen = {(c.hand, c.patch) for c in result.fired[0].candidates if c.chosen}
    assert {hand for hand, _ in chosen} == {0, 1}
    assert len({name for _, name in chosen}) == 2
    assert len(result.fired) == 1  # nothing is wanting after that
    for side in (0, 1):
        assert [phase for phase in result.phases(side) if phase != P.NONE] == LIFE
        assert result.phases(side)[-1] == P.NONE


def test_the_hands_are_released_one_after_the_other() -> None:
    released = [
        next(k for k, report in enumerate(leaning().reports) if report.contact_phase[side] == P.RELEASED)
        for side in (0, 1)
    ]
    assert abs(released[0] - released[1]) * PERIOD > 0.2


def test_each_force_stays_under_its_cap_where_one_alone_would_not() -> None:
    held = [report for report in leaning().reports if (report.contact_phase == P.LOADED).all()]
    forces = np.array([report.contact_force[:, 0, 2] for report in held])
    assert forces.max() < min(CAP.values()) + 1e-6
    assert forces.sum(axis=1).max() > 1.2 * max(CAP.values())


def test_plans_on_two_hands_balance_under_newton_euler() -> None:
    """The forces act where the palms are."""
    result, below = leaning(), np.array([0.0, 0.0, ROBOT.palm_radius])
    held = [k for k, report in enumerate(result.reports) if (report.contact_phase == P.LOADED).all()]
    assert len(held) > 200
    for k in held[::50]:
        states, report = result.plans[k].com_states, result.reports[k]
        points = result.palms[k - 1] - below
        for knot in range(len(report.com)):
            zmp = centre_of_pressure(
                mass=ROBOT.mass,
                com=states[knot + 1, :, 0],
                acceleration=states[knot + 1, :, 2],
                plane_height=0.0,
                point=points,
                force=report.contact_force[:, knot],
            )
            assert_allclose(zmp, report.zmp[knot], atol=1e-6)
            assert abs(zmp[0]) < ROBOT.sole_half_extents[0]


def test_the_lean_waits_for_both_hands() -> None:
    """No step out before the later of the two bears load."""
    reports = leaning().reports
    loaded = next(k for k, report in enumerate(reports) if (report.contact_phase >= P.LOADED).all())
    assert max(report.com[0, 0] for report in reports[:loaded]) < TOES
    assert max(report.com[0, 0] for report in reports[loaded:]) > TOES + 0.045


def test_with_one_contact_allowed_none_helps_and_the_com_stays_over_the_feet() -> None:
    result = run(scenario("two_hands", **QUICK, planner__contact__most_contacts=1), 3.5)
    assert not any(c.chosen for report in result.fired for c in report.candidates)
    assert max(report.com[0, 0] for report in result.reports) < TOES


def test_a_second_contact_joins_a_first_that_turns_out_too_weak() -> None:
    """One patch is not there: the other hand's contact is kept, and a third patch takes the missing one's place."""
    patches = {
        "left": {"on": "shelf", "offset": [-0.04, 0.12], "force_cap": 7.0},
        "ghost": {"on": "ghost", "offset": [-0.04, 0.0], "force_cap": 7.0},
        "right": {"on": "shelf", "offset": [0.0, -0.14], "force_cap": 7.0},
    }
    shelf = LEAN.world.objects["shelf"].model_dump()
    ghost = {**shelf, "size": [0.2, 0.1, 0.02], "position": [0.28, -0.1], "bottom": 0.23, "present": False}
    given = scenario(
        "two_hands", patches=patches, world__objects={"shelf": shelf, "ghost": ghost}, checks=[{"kind": "withdrawn"}]
    )
    result = run(given, 8.0)
    joined = result.fired[-1]
    assert [c.patch for c in result.fired[0].candidates if c.chosen] == ["left", "ghost"]
    assert [c.patch for c in joined.candidates if c.chosen] == ["right"]
    assert {c.reason for c in joined.candidates if c.patch == "left" and c.hand == 0} == {"held already"}
    assert any((report.contact_phase == P.LOADED).all() for report in result.reports)
