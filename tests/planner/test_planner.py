"""The three stages together, in a kinematic closed loop: when a contact is asked for, which one, and what follows."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from closed_loop import PERIOD, Run, com_of, make_planner, run, scenario, state_at
from newton_euler import centre_of_pressure
from numpy.testing import assert_allclose
from robots import soles, surena

from wbmpc.scenario import resolve_patches
from wbmpc.signals import GRAVITY, ContactPhase, SolveStatus

ROBOT = surena()
REACH = scenario("reach")
TARGET = np.array(REACH.tasks[0].target)
TOES = float(soles(ROBOT.home_q)[:, 0].max() + ROBOT.sole_half_extents[0])
NEAR = {"tasks.0.target": [0.24, 0.10, 0.32]}


@cache
def far_reach() -> Run:
    return run(REACH, 15.0)


@cache
def without_contact_stage() -> Run:
    return run(scenario("reach", planner__contact_stage=False), 6.0)


def test_a_far_reach_fires_stage_3_by_itself_and_goes_through_the_contacts_life() -> None:
    result = far_reach()
    first = result.fired[0]
    assert [c.patch for c in first.candidates if c.chosen] == ["table_right_1"]
    assert 0.5 < first.time < 5.0  # after the hand has started, before it arrives
    P = ContactPhase
    life = [P.NONE, P.CHOSEN, P.APPROACHING, P.SENSED, P.LOADED, P.QUIET, P.UNLOADED, P.RELEASED, P.NONE]
    assert result.phases(1) == life
    assert result.phases(0) == [P.NONE]  # the reaching hand takes no contact


def test_the_far_target_is_reached_with_the_com_past_the_toes() -> None:
    result = far_reach()
    errors = np.array([np.linalg.norm(palms[0] - TARGET) for palms in result.palms])
    assert (errors < 0.01).sum() * PERIOD > 2.0
    held = [plan for plan, error in zip(result.plans, errors, strict=True) if error < 0.01]
    assert min(plan.com_states[0, 0, 0] for plan in held[50:-50]) > TOES + 0.03
    assert_allclose(result.palms[-1], result.palms[0], atol=8e-3)  # and back again
    assert_allclose(result.plans[-1].torso_rotation, result.plans[0].torso_rotation, atol=0.1)  # upright, not twisted


def test_the_task_waits_for_an_expected_contact() -> None:
    reports = far_reach().reports
    chosen = next(k for k, r in enumerate(reports) if r.contact_phase[1] == ContactPhase.CHOSEN)
    loaded = next(k for k, r in enumerate(reports) if r.contact_phase[1] == ContactPhase.LOADED)
    # gated while the contact is expected: the clock of the reach slows down, and goes on once loaded
    assert min(r.progress for r in reports[chosen:loaded]) < 0.5
    assert reports[loaded + 60].progress == pytest.approx(1.0)


def test_a_firing_says_what_it_was_asked() -> None:
    """The reach ends 5 cm beyond the toes, later than the horizon: its knot has no time, and the larger ΔZ."""
    report = far_reach().fired[0]
    firing = report.firing
    assert firing is not None
    assert report.time < firing.knot_times[0] <= report.time + 1.6
    assert firing.knot_times[1] == np.inf
    assert np.abs(firing.delta_z[0]).max() == pytest.approx(np.abs(report.delta_z).max())
    assert np.abs(firing.delta_z[0]).max() > 0.002
    assert np.abs(firing.delta_z[1]).max() > np.abs(firing.delta_z[0]).max()
    fits = report.support_polygon[:, 0].max()
    assert firing.zmp[1, 0] + firing.delta_z[1, 0] < fits < firing.zmp[1, 0]
    assert firing.held == ()
    assert any("mm at the task's end, chose table_right_1" in event for event in report.events)


def test_every_report_of_a_candidate_says_why_it_lost() -> None:
    by_name = {(c.patch, c.hand): c for c in far_reach().fired[0].candidates}
    assert len(by_name) == 2 * len(resolve_patches(REACH))
    assert by_name["table_far", 1].reason.startswith("unreachable by")
    assert by_name["wall_1", 1].reason == "would slip: needs a friction above 0.4"  # it pushes to the left
    assert all(c.reason == "hand is the task's" for (_, hand), c in by_name.items() if hand == 0)
    winner = by_name["table_right_1", 1]
    assert winner.cost == min(c.cost for c in by_name.values())
    for candidate in by_name.values():
        assert np.isfinite(candidate.cost) == (candidate.reason in ("chosen",) or "above the best" in candidate.reason)
        if not np.isfinite(candidate.cost):
            assert not candidate.forces.any()


def test_plans_with_a_contact_balance_under_newton_euler() -> None:
    """At every knot, the feet's pressure for the planned motion and the planned hand force lies on the soles.

    The force acts where the palm is, which is not the patch's centre.
    """
    centre = {p.name: p.position for p in resolve_patches(REACH)}["table_right_1"]
    result, below = far_reach(), np.array([0.0, 0.0, ROBOT.palm_radius])
    loaded = [k for k, report in enumerate(result.reports) if report.contact_phase[1] == ContactPhase.LOADED]
    assert len(loaded) > 200
    for k in loaded[::40]:
        plan, position = result.plans[k], result.palms[k - 1][1] - below
        assert np.linalg.norm((position - centre)[:2]) > 5e-3
        states, report = plan.com_states, plan.report
        for knot in range(len(report.com)):
            zmp = centre_of_pressure(
                mass=ROBOT.mass,
                com=states[knot + 1, :, 0],
                acceleration=states[knot + 1, :, 2],
                plane_height=0.0,
                point=position,
                force=report.contact_force[1, knot],
            )
            assert_allclose(zmp, report.zmp[knot], atol=1e-6)
        # the first second is what will be executed: well inside the soles
        inside = np.array([-ROBOT.sole_half_extents[0], ROBOT.sole_half_extents[0]])
        assert (report.zmp[:10, 0] > inside[0]).all()
        assert (report.zmp[:10, 0] < inside[1]).all()


def test_the_robot_follows_its_com_plan() -> None:
    """Jerks and q̇ agree: the CoM of the integrated joint reference is the planned one, feet and all."""
    for plan in far_reach().plans[::50]:
        assert_allclose(com_of(plan), plan.com_states[0, :, 0], atol=4e-3)
        assert_allclose(soles(plan.q), soles(ROBOT.home_q), atol=1e-3)


def test_all_stages_solve() -> None:
    for report in far_reach().reports:
        assert report.stage1.status == SolveStatus.SOLVED
        assert report.stage2.status == SolveStatus.SOLVED
        assert report.stage3.status in (SolveStatus.SOLVED, SolveStatus.NOT_RUN)


def test_the_need_comes_within_the_horizon_before_it_is_due() -> None:
    """Stage 3 fires on a knot of the future: the hand has time to get there."""
    first = far_reach().fired[0]
    shift = np.abs(first.delta_z).max(axis=1)
    assert shift[:8].max() < REACH.planner.contact.need_threshold < shift.max()


def test_without_the_contact_stage_nothing_is_asked_and_the_hand_stays_short() -> None:
    result = without_contact_stage()
    assert not result.fired
    assert result.phases(0) == result.phases(1) == [ContactPhase.NONE]
    for report in result.reports:
        assert not report.delta_z.any()
        assert not report.contact_force.any()
    assert min(np.linalg.norm(palms[0] - TARGET) for palms in result.palms) > 0.03
    assert max(plan.com_states[0, 0, 0] for plan in result.plans) < TOES


def test_a_near_target_never_fires() -> None:
    result = run(scenario("reach", **{"tasks.0.target": NEAR["tasks.0.target"], "tasks.0.arrive_by": 3.0}), 4.5)
    assert not result.fired
    assert max(np.abs(r.delta_z).max() for r in result.reports) < REACH.planner.contact.need_threshold
    assert min(np.linalg.norm(palms[0] - NEAR["tasks.0.target"]) for palms in result.palms) < 0.01


def test_a_mirrored_target_gives_the_mirrored_choice() -> None:
    """Left and right swap by themselves: hand, patch, time and motion."""
    mirrored_target = [float(TARGET[0]), -float(TARGET[1]), float(TARGET[2])]
    mirrored = run(scenario("reach", **{"tasks.0.target": mirrored_target}), 5.0)
    original = far_reach()
    first, other = original.fired[0], mirrored.fired[0]
    assert other.time == pytest.approx(first.time, abs=0.05)
    assert [(c.patch, c.hand) for c in other.candidates if c.chosen] == [("table_left_1", 0)]
    com, swapped = original.plans[400].com_states[0, :, 0], mirrored.plans[400].com_states[0, :, 0]
    assert_allclose(swapped * [1, -1, 1], com, atol=2e-3)


def test_a_table_that_is_not_there_is_given_up_and_another_patch_tried() -> None:
    result = run(REACH, 7.0, table=False)
    assert any("missing, excluded" in event for event in result.events)
    assert ContactPhase.SENSED not in result.phases(1)
    tried = [c.patch for report in result.fired for c in report.candidates if c.chosen]
    assert len(tried) == len(set(tried))
    assert max(plan.com_states[0, 0, 0] for plan in result.plans) < TOES + 0.01  # no lean on nothing


def test_two_planners_give_the_same_bits() -> None:
    one, other = (run(REACH, 1.2) for _ in range(2))
    for a, b in zip(one.plans, other.plans, strict=True):
        assert a.com_states.tobytes() == b.com_states.tobytes()
        assert a.com_jerk.tobytes() == b.com_jerk.tobytes()
        assert a.q.tobytes() == b.q.tobytes()
        assert a.velocity.tobytes() == b.velocity.tobytes()
        assert a.report.delta_z.tobytes() == b.report.delta_z.tobytes()


def test_standing_still_is_planned_as_standing_still() -> None:
    result = run(scenario("stand"), 1.0)
    start = com_of(result.plans[0])
    assert_allclose(com_of(result.plans[-1]), start, atol=5e-3)
    assert np.abs(result.plans[-1].velocity).max() < 0.05
    assert not result.fired


def test_squat_follows_its_waypoints() -> None:
    """Stage 1 through the whole planner: the CoM of the joint reference goes through the heights."""
    result = run(scenario("squat"), 5.0)
    heights = np.array([com_of(plan)[2] for plan in result.plans[::10]])
    assert heights[30] == pytest.approx(0.200, abs=0.008)
    assert heights[-1] == pytest.approx(0.264, abs=0.008)
    assert not result.fired


def pushed_while_squatting(formulation: str) -> Run:
    """A fast squat, and a CoM velocity sideways and forward on top: c̈_z and c̈_xy at once, no contact in the world."""
    waypoints = [{"time": t, "height": h} for t, h in ((0.2, 0.264), (0.6, 0.20), (1.0, 0.264))]
    changes = {"planner.formulation": formulation, "tasks.0.waypoints": waypoints}
    planner, out, q, v = make_planner(scenario("squat", **changes)), Run(), ROBOT.home_q, np.zeros(ROBOT.nv)
    for k in range(60):
        push = np.zeros(ROBOT.nv)
        push[:2] = (0.25, 0.15) if k > 30 else (0.0, 0.0)
        plan = planner.solve(state_at(k * PERIOD, q, v + push))
        out.plans.append(plan)
        q, v = ROBOT.integrate(q, PERIOD * plan.velocity), plan.velocity
    return out


def test_formulation_selects_the_paper_or_the_exact_zmp() -> None:
    """The plan's ZMP is c − c_z c̈/(g + c̈_z), or the paper's LIPM one; the phantom lies between them."""
    largest = 0.0
    for formulation in ("exact", "paper"):
        for plan in pushed_while_squatting(formulation).plans[::3]:
            c, acc = plan.com_states[1:, :, 0], plan.com_states[1:, :, 2]
            lipm = c[:, :2] - c[:, 2:] * acc[:, :2] / GRAVITY
            phantom = c[:, 2:] * acc[:, :2] * acc[:, 2:] / (GRAVITY * (GRAVITY + acc[:, 2:]))
            pressure = [
                centre_of_pressure(mass=ROBOT.mass, com=p, acceleration=a, plane_height=0.0)
                for p, a in zip(c, acc, strict=True)
            ]
            assert_allclose(lipm + phantom, pressure, atol=1e-9)
            assert_allclose(plan.report.zmp, pressure if formulation == "exact" else lipm, atol=1e-6)
            largest = max(largest, float(np.abs(phantom).max()))
    assert largest > 5e-4  # [m] the two would not be told apart otherwise


def test_a_state_that_is_no_number_never_enters_a_plan() -> None:
    planner = make_planner(scenario("stand"))
    still = state_at(0.0, ROBOT.home_q, np.zeros(ROBOT.nv))
    planner.solve(still)
    broken = planner.solve(state_at(PERIOD, ROBOT.home_q, np.full(ROBOT.nv, np.nan)))
    assert np.isfinite(broken.com_jerk).all()
    assert np.isfinite(broken.sample(0.02).com_position).all()


def test_a_failed_stage_recovers_once_the_state_is_sound() -> None:
    planner = make_planner(scenario("stand"))
    for k in range(3):
        planner.solve(state_at(k * PERIOD, ROBOT.home_q, np.zeros(ROBOT.nv)))
    planner.solve(state_at(0.03, ROBOT.home_q, np.full(ROBOT.nv, np.nan)))
    after = planner.solve(state_at(0.04, ROBOT.home_q, np.zeros(ROBOT.nv)))
    assert after.report.stage2.status == SolveStatus.SOLVED
