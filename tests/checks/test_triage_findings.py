"""Triage on made-up runs: what each detector finds and leaves alone, and which finding is the first cause."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import FLOOR, LEFT_FOOT, LEFT_PALM, MASS, RIGHT_FOOT, STEP, TABLE, TORSO, SyntheticRun

from wbmpc.checks.settings import DeclaredContacts, NoFall
from wbmpc.checks.support import distance_outside
from wbmpc.rerun_sink.blueprint import _LANES, _PLOTS, _TEXTS
from wbmpc.signals import ContactPhase, HandMode, SolveStatus
from wbmpc.triage.balance import capture_point, margin, point_of_no_return, time_down
from wbmpc.triage.causes import LOOK_AT, Cause, Finding
from wbmpc.triage.controller import late_plans, non_finite, stage_infeasible
from wbmpc.triage.first import Fall, first_of
from wbmpc.triage.limits import joint_limits, off_plan, saturations
from wbmpc.triage.pushes import pushes
from wbmpc.triage.touch import collisions, contacts_not_made, slips

PATCH = SimpleNamespace(name="table_1", position=np.array([0.3, 0.1, 0.2]), normal=np.array([0.0, 0.0, 1.0]))
MODEL = SimpleNamespace(geom_friction=np.full((8, 3), 0.5), jnt_range=np.array([[0, 0], [-1.0, 1.0], [-1.0, 1.0]]))


def causes(found: Any) -> list[tuple[str, float]]:
    return [(str(finding.cause), pytest.approx(finding.start)) for finding in found]


def context_of(run: SyntheticRun) -> Any:
    """A context with references: the robot follows them, unless `run.reference` says otherwise."""
    context = run.context()
    columns = context.recorder._sampled.rows  # the recorder's own: setpoints are not among the synthetic ones
    columns["setpoint_hand_mode"] = HandMode.MOVE
    columns["setpoint_com_position"][: run.ticks] = getattr(run, "reference", run.com)
    columns["setpoint_hand_position"][: run.ticks] = run.palm_position
    return context


def test_a_calm_run_has_no_finding() -> None:
    run = SyntheticRun(100)
    for k in range(100):
        run.plan(k * STEP)
    context = context_of(run)
    found = [
        *non_finite(context),
        *stage_infeasible(context),
        *late_plans(context, period=0.01, knot=0.1),
        *contacts_not_made(context, [PATCH], 0.015),
        *collisions(context, DeclaredContacts()),
        *slips(context, MODEL),
        *saturations(context, 0.95),
        *joint_limits(context, MODEL),
        *pushes(context),
    ]
    assert found == []


def test_every_cause_says_what_to_look_at() -> None:
    assert set(LOOK_AT) == set(Cause)
    for words in LOOK_AT.values():
        for tab, rest in re.findall(r"tab (Stage 3|\w+)([^;]*)", words):
            assert tab in {**_PLOTS, **_TEXTS}, tab
            for plot in re.findall(r"[A-Z][\w ]*", rest) if tab in _PLOTS else []:
                titles = " ".join([*_PLOTS[tab], *([_LANES[tab].title] if tab in _LANES else [])])
                assert plot.split()[0].lower() in titles.lower(), (tab, plot)


def test_every_cause_is_documented() -> None:
    text = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    assert [cause for cause in Cause if f"| `{cause}` |" not in text] == []


# ---------------------------------------------------------------- the controller's own words


def test_stages_that_fail_for_long_and_only_those() -> None:
    run = SyntheticRun(200)
    for k in range(200):
        bad = 50 <= k < 60 or k == 100  # one failed plan is bridged by the one before
        status = SolveStatus.INFEASIBLE if bad else SolveStatus.SOLVED
        run.plan(k * STEP, statuses=(SolveStatus.SOLVED, status, SolveStatus.NOT_RUN))
    run.fallback[120:130] = True
    assert causes(stage_infeasible(run.context())) == [("stage infeasible", 0.5), ("stage infeasible", 1.2)]


@pytest.mark.parametrize(("chosen", "found"), [(None, 1), (0.9, 0), (2.5, 1)])
def test_stage_3_without_an_answer_unless_one_comes_soon(chosen: float | None, found: int) -> None:
    run = SyntheticRun(400)
    for k in range(400):
        fires = k % 10 == 0 and k <= 100
        phase = ContactPhase.CHOSEN if chosen is not None and k * STEP >= chosen and k > 100 else ContactPhase.NONE
        phase = ContactPhase.CHOSEN if chosen is not None and abs(k * STEP - chosen) < 0.05 else phase
        stage3 = SolveStatus.INFEASIBLE if fires else SolveStatus.NOT_RUN
        run.plan(k * STEP, left=("table_1", phase), statuses=(SolveStatus.SOLVED, SolveStatus.SOLVED, stage3))
    if chosen == 0.9:
        assert [f for f in stage_infeasible(run.context()) if f.start == 0.0] == []
    else:
        assert len(list(stage_infeasible(run.context()))) == found


@pytest.mark.parametrize(("delay", "firm"), [(10, None), (20, None), (60, False), (150, True)])
def test_how_late_a_plan_must_be(delay: int, firm: bool | None) -> None:
    context = SyntheticRun(100).context()
    timing = context.recorder.timing
    timing.begin(timestep=1e-3, realtime=False)
    for tick in range(10, 1000, 10):
        timing.plan(snapshot=tick, effect=tick + delay)
    found = list(late_plans(context, period=0.01, knot=0.1))
    assert [f.firm for f in found] == ([] if firm is None else [firm])
    if found:
        assert found[0].start == pytest.approx(0.01 + 1e-3 * delay)


def test_one_late_plan_is_found_where_it_was_late() -> None:
    context = SyntheticRun(100).context()
    context.recorder.timing.begin(timestep=1e-3, realtime=True)
    for tick in range(10, 1000, 10):
        if not 400 <= tick < 600:  # the planner was away for 0.2 s
            context.recorder.timing.plan(snapshot=tick, effect=tick + 10)
    (found,) = late_plans(context, period=0.01, knot=0.1)
    assert (found.start, found.firm) == (pytest.approx(0.4), True)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e5])
def test_a_state_that_is_none(value: float) -> None:
    run = SyntheticRun(100)
    run.qvel[60, 3] = value
    context = run.context()
    if value == 1e5:
        assert list(non_finite(context)) == []  # fast, but the run went on
        context.recorder.event(0.62, "state is not finite, run ended")
    assert causes(non_finite(context)) == [("non-finite", 0.6)]


# ---------------------------------------------------------------- contacts


def test_a_palm_that_goes_through_the_patch() -> None:
    run = SyntheticRun(100)
    for k in range(100):
        run.plan(k * STEP, left=("table_1", ContactPhase.APPROACHING))
    run.palm_position[:, 0] = [0.3, 0.1, 0.3]
    run.palm_position[50:, 0, 2] = 0.19
    assert causes(contacts_not_made(run.context(), [PATCH], 0.015)) == [("contact not made", 0.5)]
    run.palm_position[50:, 0, 0] = 0.1  # below the surface's plane, but beside the patch
    assert list(contacts_not_made(run.context(), [PATCH], 0.015)) == []
    run.palm_position[50:, 0, 0] = 0.3
    run.touch(range(50, 100), TABLE, LEFT_PALM, [0.0, 0.0, 5.0])
    assert list(contacts_not_made(run.context(), [PATCH], 0.015)) == []


def test_a_contact_that_is_given_up_is_over_when_another_carries() -> None:
    run = SyntheticRun(300)
    for k in range(300):
        phase = ContactPhase.LOADED if k >= 200 else ContactPhase.NONE
        run.plan(k * STEP, left=("table_1", phase))
    run.touch(range(200, 300), TABLE, LEFT_PALM, [0.0, 0.0, 5.0])
    context = run.context()
    context.recorder.event(1.0, "contact right table_2: missing, excluded")
    context.recorder.event(1.0, "contact right table_2: approaching -> released")
    (found,) = contacts_not_made(context, [PATCH], 0.015)
    assert (found.start, found.end) == (1.0, 2.0)
    assert "right palm found nothing where patch table_2" in found.what


def test_a_contact_that_no_longer_pushes() -> None:
    run = SyntheticRun(100)
    for k in range(100):
        run.plan(k * STEP, left=("table_1", ContactPhase.LOADED))
    run.touch(range(60), TABLE, LEFT_PALM, [0.0, 0.0, 5.0])
    run.touch(range(65, 70), TABLE, LEFT_PALM, [0.0, 0.0, 5.0])  # the gap before is too short to count
    assert causes(contacts_not_made(run.context(), [PATCH], 0.015)) == [("contact not made", 0.7)]


def test_collisions_with_itself_and_with_the_world_once_a_pair() -> None:
    run = SyntheticRun(100)
    run.touch(range(30, 40), LEFT_FOOT, RIGHT_FOOT, [1.0, 0.0, 0.0])
    run.touch(range(50, 60), TABLE, TORSO, [1.0, 0.0, 0.0])
    assert causes(collisions(run.context(), DeclaredContacts())) == [("self-collision", 0.3), ("collision", 0.5)]


@pytest.mark.parametrize(("pull", "distance", "found"), [(0.49, 0.03, 1), (0.49, 0.005, 0), (0.4, 0.03, 0)])
def test_a_slip_is_on_the_edge_of_the_cone_and_goes_far(pull: float, distance: float, found: int) -> None:
    run = SyntheticRun(100)
    run.lift(range(40, 60), LEFT_FOOT)
    run.touch(range(40, 60), FLOOR, LEFT_FOOT, [10.0 * pull, 0.0, 10.0])
    run.sole_position[:, 0, 0] += np.interp(np.arange(100), [40, 59], [0.0, distance])
    slipped = list(slips(run.context(), MODEL))
    assert causes(slipped) == [("slip", 0.4)][:found]


# ---------------------------------------------------------------- the body's limits


@pytest.mark.parametrize("detector", [lambda c: saturations(c, 0.95), lambda c: joint_limits(c, MODEL)])
def test_a_limit_is_a_finding_only_where_the_robot_leaves_its_plan(detector: Any) -> None:
    run = SyntheticRun(100)
    run.torque[30:90, 1] = -1.9  # of 2.0 N·m, the tracker's share being 0.95
    run.qpos[30:90, 8] = 0.999
    assert list(detector(context_of(run))) == []
    run.reference = run.com.copy()
    run.reference[50:, 2] += 0.02
    (found,) = detector(context_of(run))
    assert (found.start, found.end) == (pytest.approx(0.5), pytest.approx(0.89))
    assert found.what.startswith("knee")


def test_a_palm_off_its_reference_counts_only_while_it_is_guided() -> None:
    run = SyntheticRun(100)
    context = context_of(run)
    columns = context.recorder._sampled.rows
    columns["setpoint_hand_position"][40:, 1, 0] += 0.03
    columns["setpoint_hand_mode"][:60, 1] = HandMode.FREE
    np.testing.assert_allclose(off_plan(context), np.where(np.arange(100) >= 60, 0.03, 0.0), atol=1e-12)


def test_references_are_held_between_two_samples() -> None:
    recorder = SimpleNamespace(
        **{"stride": 10, "ticks": 25, "sample_ticks": np.array([0, 10, 20])},
        com=np.zeros((25, 3)),
        setpoint_com_position=np.array([[0.0, 0, 0], [0.02, 0, 0], [0.0, 0, 0.05]]),
        palm_position=np.zeros((25, 2, 3)),
        setpoint_hand_position=np.zeros((3, 2, 3)),
        setpoint_hand_mode=np.zeros((3, 2), int),
    )
    expected = np.repeat([0.0, 0.02, 0.05], [10, 10, 5])
    np.testing.assert_allclose(off_plan(SimpleNamespace(recorder=recorder)), expected)  # type: ignore[arg-type]


def test_a_push_is_firm_when_it_takes_the_capture_point_out_of_the_contacts() -> None:
    run = SyntheticRun(200)
    run.external_force[100:110] = [2.0, 0.0, 0.0]
    context = run.context()
    (found,) = pushes(context)  # all contacts are in one point: any push is too much
    assert (found.start, found.firm) == (1.0, True)
    rate = np.sqrt(9.81 / 0.26)
    assert f"{1e2 * 0.2 / (MASS * rate):.3g} cm" in found.what
    run.lift(range(80, 90), LEFT_FOOT)  # on one foot just before: the next step might have caught it
    assert [f.firm for f in pushes(run.context())] == [False]
    context.recorder._contacts.position[:, 0] = 0.06  # the contacts reach out to where the push goes
    wide = SyntheticRun(200)
    wide.external_force[100:110] = [2.0, 0.0, 0.0]
    wide_context = wide.context()
    wide_context.recorder._contacts.position[:, 0] = 0.06
    assert [f.firm for f in pushes(wide_context)] == [False]


# ---------------------------------------------------------------- balance


@given(
    st.lists(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)), min_size=3, max_size=12),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
)
def test_the_margin_is_the_distance_from_the_hull(points: list[Any], where: tuple[float, float]) -> None:
    vertices = np.round(np.array(points), 3)
    if np.linalg.matrix_rank(vertices - vertices.mean(axis=0), tol=2e-2) < 2:
        return  # nearly a line: the reference wants a polygon
    exact = -distance_outside(np.array(where), vertices)
    found = margin(vertices, np.array(where))
    assert exact - 1e-9 <= found <= exact + 0.025  # of 72 directions one is at most 2.5 degrees off: sin 2.5° · 0.57 m


def test_the_point_of_no_return_is_when_the_capture_point_leaves_for_good() -> None:
    run = SyntheticRun(300)
    run.com_velocity[100:110, 0] = 0.2  # out, and back
    run.com_velocity[200:, 0] = 0.2
    run.torso_up[250:] = 0.0
    context = run.context()
    assert capture_point(context)[200, 0] == pytest.approx(0.2 / np.sqrt(9.81 / 0.26))
    down = time_down(context, NoFall())
    assert down == pytest.approx(2.5)
    assert point_of_no_return(context, down) == pytest.approx(1.99)


# ---------------------------------------------------------------- which one was first

FALL = Fall(lost=5.0, down=5.5, awaited=False)
kinds = st.sampled_from([cause for cause in Cause if cause is not Cause.NON_FINITE])


def finding(cause: Cause, start: float, end: float = np.inf, firm: bool = True) -> Finding:
    return Finding(cause, start, end, "", firm)


@given(kinds, st.lists(st.tuples(kinds, st.floats(5.1, 9.0)), max_size=8))
def test_what_follows_a_fall_is_no_cause(cause: Cause, later: list[Any]) -> None:
    first = finding(cause, 4.5)
    found = [first, *sorted((finding(c, t) for c, t in later), key=lambda f: f.start)]
    assert first_of(found, FALL, np.inf) is first
    assert first_of(found[1:], FALL, np.inf) is None


@given(st.lists(st.tuples(kinds, st.floats(0.0, 5.0), st.booleans()), min_size=1, max_size=8))
def test_the_earliest_firm_finding_wins(rows: list[Any]) -> None:
    found = sorted((finding(c, t, firm=f) for c, t, f in rows), key=lambda f: f.start)
    answer = first_of(found, FALL, np.inf)
    assert answer is not None
    if any(f.firm for f in found):
        assert answer.firm
    sooner = [f for f in found if f.start < answer.start and f.firm]
    # Only a contact that was to catch a push comes before it.
    assert not sooner or (sooner[0].cause is Cause.PUSH and answer.cause is Cause.CONTACT_NOT_MADE)


def test_what_was_over_long_before_is_no_cause_of_a_fall() -> None:
    slip, push = finding(Cause.SLIP, 1.0, 1.2), finding(Cause.PUSH, 4.8, 4.9)
    assert first_of([slip, push], FALL, np.inf) is push
    assert first_of([slip, push], None, np.inf) is slip  # a foot that slid stays where it slid to


def test_the_hand_that_was_to_catch_the_push_may_miss_after_the_feet_are_past_saving() -> None:
    push, missed = finding(Cause.PUSH, 4.8, 4.9), finding(Cause.CONTACT_NOT_MADE, 5.2)
    assert first_of([push, missed], FALL, np.inf) is push
    assert first_of([push, missed], Fall(5.0, 5.5, awaited=True), np.inf) is missed


def test_an_always_on_check_says_when_a_run_without_a_fall_failed() -> None:
    touch, slip = finding(Cause.SELF_COLLISION, 2.0), finding(Cause.SLIP, 3.0)
    assert first_of([slip], None, 2.0) is None
    assert first_of([touch, slip], None, 2.0) is touch


def test_no_number_comes_before_everything() -> None:
    push, nan = finding(Cause.PUSH, 0.5), finding(Cause.NON_FINITE, 0.51)
    assert first_of([push, nan], FALL, 0.5) is nan
