"""The gait over time: what lifts and lands feet, what the gate holds up, and that its previews come true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gait_case import DT, HALF, PERIOD, SETTINGS, IdealGait, Velocity, feet_at, sole, step_task, walk
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footstep import Feet
from wbmpc.planner.gait import EARLY, SEARCH_TIME, SupportPhase
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.support_interval import Interval, Transfer
from wbmpc.scenario import GoTask, Task
from wbmpc.signals import SIDES, Vector

TIMES = 0.1 * np.arange(1, 17)  # [s] knots
NEAR = 0.025  # [s] from a lift or landing to a knot that may be taken for either side of it
FORWARD = (0.0, 0.08, 0.0, 0.0)
commands = st.tuples(st.floats(-0.15, 0.15), st.floats(-0.08, 0.08), st.floats(-0.4, 0.4))


def until(run: IdealGait, phase: SupportPhase) -> None:
    """Tick until `phase` begins."""
    for _ in range(500):
        before = run.gait.phase
        run.tick()
        if run.gait.phase == phase != before:
            return
    pytest.fail(f"{phase.name} did not come")


def swinging(*tasks: Task) -> IdealGait:
    run = IdealGait.of(*(tasks or (walk(FORWARD),)))
    until(run, SupportPhase.SINGLE)
    return run


def test_phases_have_their_durations() -> None:
    run, changes = IdealGait.of(walk(FORWARD)), []
    for _ in range(300):
        before = run.gait.phase
        run.tick()
        if run.gait.phase != before:
            changes.append((run.gait.phase, run.time))
    P = SupportPhase
    assert [phase for phase, _ in changes[:6]] == [P.DOUBLE, P.SINGLE, P.DOUBLE, P.SINGLE, P.DOUBLE, P.SINGLE]
    lengths = np.diff([time for _, time in changes])
    expected = [SETTINGS.first_double_support] + [SETTINGS.swing_time, SETTINGS.double_support] * 2
    assert_allclose(lengths[:5], expected, atol=2 * DT)
    sides = [event.split()[1].rstrip(":") for event in run.events]
    assert sides[:6] == ["left", "left", "right", "right", "left", "left"]
    assert [event.split()[2] for event in run.events[:4]] == ["lifted", "landed", "lifted", "landed"]


def test_told_to_stay_it_begins_no_step_and_ends_the_one_under_way() -> None:
    run = IdealGait.of(walk(FORWARD))
    run.stay = True
    run.run(2.0)
    assert run.gait.phase == SupportPhase.STAND
    assert not run.events
    run.stay = False
    until(run, SupportPhase.SINGLE)
    run.stay = True
    run.run(5.0)
    assert len(run.events) > 4  # a walk does not stop in the middle


def test_told_to_stay_it_makes_the_stride_under_way_and_no_other() -> None:
    run = IdealGait.of(GoTask(kind="go", target=(0.5, 0.0), start=0.0))
    until(run, SupportPhase.SINGLE)
    run.stay = True
    run.run(8.0)
    assert run.gait.phase == SupportPhase.STAND
    assert [event.split()[2] for event in run.events] == ["lifted", "landed"]
    run.stay = False
    until(run, SupportPhase.SINGLE)


def test_standing_without_a_task_goes_on() -> None:
    run = IdealGait.of()
    run.run(2.0)
    assert run.gait.phase == SupportPhase.STAND
    assert run.gait.stance == (True, True)
    assert not run.events
    preview = run.preview(TIMES)
    assert not preview.shift.any()
    assert not preview.centring.any()
    assert not preview.lower.any()
    assert not preview.upper.any()


def test_a_touch_lands_the_foot_early_where_it_is_measured() -> None:
    run = swinging()
    swing = run.gait.swing
    assert swing is not None
    run.error = np.array([0.004, -0.007])  # measured off the reference
    while swing.sigma <= EARLY:
        run.tick(touch=True)  # a foot that drags at the beginning has not landed
        assert run.gait.phase == SupportPhase.SINGLE or swing.sigma > EARLY
    if run.gait.phase == SupportPhase.SINGLE:
        run.tick(touch=True)
    assert run.gait.phase == SupportPhase.DOUBLE
    side = swing.step.side
    off = run.gait.feet.positions[side][:2] - swing.reference(0.0)[0][:2]
    assert np.linalg.norm(off - [0.004, -0.007]) < 0.01  # one tick of the swing is less
    assert run.gait.feet.last == side


def test_a_late_foot_sinks_for_the_ground_and_lands_when_it_finds_it() -> None:
    run = swinging()
    swing = run.gait.swing
    assert swing is not None
    while swing.sigma < 1.0:
        run.tick(touch=False)
    heights = []
    for _ in range(10):
        run.tick(touch=False)
        heights.append(run.gait.soles(1.0).positions[swing.step.side, 2])
    assert_allclose(np.diff(heights) / DT, -SETTINGS.search_speed, rtol=1e-9)
    run.tick(touch=True)
    assert run.gait.phase == SupportPhase.DOUBLE


def test_a_foot_that_finds_no_ground_is_taken_for_landed() -> None:
    run = swinging()
    swing, lowest = run.gait.swing, 0.0
    assert swing is not None
    while swing.sigma < 1.0:
        run.tick(touch=False)
    begin = run.time
    while run.gait.phase == SupportPhase.SINGLE:
        lowest = min(lowest, run.gait.soles(1.0).positions[swing.step.side, 2])
        run.tick(touch=False)
    assert run.time - begin == pytest.approx(SEARCH_TIME, abs=3 * DT)
    late = [text for text in run.events if "no ground" in text]
    assert late == [f"foot {SIDES[swing.step.side]}: no ground for 0.3 s where it should have landed"]
    assert lowest == pytest.approx(-SETTINGS.search_depth, abs=1e-6)


@pytest.mark.parametrize("phase", [SupportPhase.DOUBLE, SupportPhase.SINGLE])
def test_a_closed_gate_holds_the_clock(phase: SupportPhase) -> None:
    run = IdealGait.of(walk(FORWARD))
    until(run, phase)
    run.run(0.1)
    before = run.gait.soles(1.0)
    for _ in range(300):
        run.tick(rate=0.0)
    assert run.gait.phase == phase
    held = run.gait.soles(0.0)
    assert_allclose(held.positions, before.positions)
    assert not held.velocities.any()
    assert not held.accelerations.any()
    left = {SupportPhase.DOUBLE: SETTINGS.first_double_support, SupportPhase.SINGLE: SETTINGS.swing_time}[phase] - 0.1
    run.run(left - 3 * DT)
    assert run.gait.phase == phase
    run.run(6 * DT)
    assert run.gait.phase != phase


def test_a_stride_waits_until_the_other_foot_carries_and_a_walk_does_not() -> None:
    """A walk's next step is where it catches itself: it must not wait."""
    stride, walking = IdealGait.of(step_task()), IdealGait.of(walk((0.0, 0.1, 0.0, 0.0)))
    for run in (stride, walking):
        run.zmp = run.gait.feet.positions[:, :2].mean(axis=0)  # between the feet
        run.run(4.0)
    assert stride.gait.phase == SupportPhase.DOUBLE
    assert any("lifted" in event for event in walking.events)
    stride.zmp = None
    stride.tick()
    assert stride.gait.phase == SupportPhase.SINGLE


def test_half_the_rate_takes_twice_the_time() -> None:
    run = swinging()
    begin = run.time
    while run.gait.phase == SupportPhase.SINGLE:
        run.tick(rate=0.5)
    assert run.time - begin == pytest.approx(2 * SETTINGS.swing_time, abs=3 * DT)


def test_sole_references_move_as_they_say() -> None:
    """Over whole steps: velocity is the difference of positions, the standing foot does not move."""
    run = IdealGait.of(walk((0.0, 0.1, 0.03, 0.2)))
    for _ in range(400):
        before, phase = run.gait.soles(1.0), run.gait.phase
        run.tick()
        after = run.gait.soles(1.0)
        mean = 0.5 * (before.velocities + after.velocities)
        assert_allclose((after.positions - before.positions) / DT, mean, atol=0.02)
        assert_allclose((after.yaws - before.yaws) / DT, 0.5 * (before.yaw_rates + after.yaw_rates), atol=0.02)
        if phase == SupportPhase.SINGLE == run.gait.phase:
            assert run.gait.swing is not None
            stance = 1 - run.gait.swing.step.side
            assert_allclose(after.positions[stance], before.positions[stance], atol=0)


def same(one: SupportPolygon, other: SupportPolygon) -> bool:
    return one.vertices.shape == other.vertices.shape and bool(np.abs(one.vertices - other.vertices).max() < 1e-6)


def inside(inner: SupportPolygon, outer: SupportPolygon) -> bool:
    return max(outer.excess(vertex) for vertex in inner.vertices) < 1e-6


@settings(max_examples=15, deadline=None)
@given(command=commands, seconds=st.integers(2, 400).map(lambda k: k * DT))
def test_what_a_preview_says_comes_true(command: Velocity, seconds: float) -> None:
    """Every knot of a preview is what the feet carry when its time has come, footsteps included."""
    check_preview(IdealGait.of(walk((0.0, *command))), seconds)


@pytest.mark.parametrize("stop", [1.2, 1.35, 1.5, 1.6])
def test_a_preview_knows_of_a_stop(stop: float) -> None:
    """One that comes while a foot is in the air; in a double support the next step is chosen once more before it."""
    check_preview(IdealGait.of(walk(FORWARD, (stop, 0.0, 0.0, 0.0))), 1.0)


def test_a_preview_of_a_step_task_comes_true() -> None:
    run = IdealGait.of(step_task(target=(0.04, 0.12)))
    check_preview(run, 0.5)
    check_preview(run, 0.4)


def check_preview(run: IdealGait, seconds: float) -> None:
    run.run(seconds)
    preview, begin, landings = run.preview(TIMES), run.time, []
    actual = [(0.0, run.polygon(), run.gait.stance)]
    feet = run.gait.feet
    for _ in range(round(TIMES[-1] / DT) + 3):
        run.tick()
        actual.append((run.time - begin, run.polygon(), run.gait.stance))
        if run.gait.feet is not feet:
            feet = run.gait.feet
            landings.append(feet.positions[feet.last, :2])
    for k, t in enumerate(TIMES):
        about = [(polygon, stance) for time, polygon, stance in actual if abs(time - t) < NEAR]
        singles = [polygon for polygon, stance in about if not all(stance)]
        doubles = [polygon for polygon, stance in about if all(stance)]
        assert any(same(preview.polygons[k], p) for p in singles) or any(
            inside(preview.polygons[k], p) for p in doubles
        )
        if not doubles:
            assert preview.centring[k] == 1.0
        assert_allclose(preview.normals[k] @ preview.polygons[k].centre <= preview.offsets[k], True)
    for place, landing in zip(preview.footsteps, landings, strict=False):
        assert_allclose(place, landing, atol=1e-6)


def test_margins_of_a_preview_grow() -> None:
    run = swinging()
    plain, inset = run.preview(TIMES), run.preview(TIMES, margin=0.01, growth=0.005)
    real = np.isfinite(plain.offsets)
    assert_allclose(plain.offsets[real] - inset.offsets[real], (0.01 + 0.005 * np.tile(TIMES[:, None], 8))[real])
    ends = np.isfinite(plain.rest_offsets)
    assert_allclose(plain.rest_offsets[ends] - inset.rest_offsets[ends], 0.01 + 0.005 * TIMES[-1])


@settings(max_examples=20, deadline=None)
@given(command=commands, ticks=st.integers(60, 400), x=st.floats(-0.02, 0.02), y=st.floats(-0.02, 0.02))
@example(command=(0.125, 0.0, 1e-8), ticks=71, x=0.0, y=0.0)  # sides of the hull that are straight but for rounding
@example(command=(0.087890625, 0.0, 1e-9), ticks=62, x=0.0164, y=0.0)  # corners on either side of a rounding's step
def test_rows_move_with_the_footsteps(command: Velocity, ticks: int, x: float, y: float) -> None:
    """If the present swing lands (x, y) off and the later steps follow, the moved rows are the feet's own.

    Exact on one foot; on two the load has gone on a little between the two previews.
    """
    run, moved = (IdealGait.of(walk((0.0, *command))) for _ in range(2))
    for _ in range(ticks):
        run.tick()
        moved.tick()
    if run.gait.swing is None:
        return
    off = np.array([x, y])
    shifted = run.preview(TIMES).shift @ np.tile(off, (4, 1))  # (N, 2)
    before, moved.error = run.preview(TIMES), off
    while moved.gait.phase == SupportPhase.SINGLE:
        moved.tick()
    later = moved.preview(np.maximum(TIMES - (moved.time - run.time), 0.0))
    for k, t in enumerate(TIMES):
        if t < moved.time - run.time + NEAR:
            continue
        for normal in 2 * np.pi * np.arange(8) / 8:
            u = np.array([np.cos(normal), np.sin(normal)])
            promised = reach(before.polygons[k], u) + float(u @ shifted[k])
            found = reach(later.polygons[k], u)
            single = len(before.polygons[k].vertices) == len(later.polygons[k].vertices) == 4
            on_two = 0.5 * float(np.linalg.norm(off)) + 0.012
            assert abs(promised - found) <= (1e-6 if single and max(before.shift[k]) == 1.0 else on_two)


@example(seed=0, share=0.5, yaw=2.220446049250313e-16)  # corners whose x differ by rounding only
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0), yaw=st.floats(-0.5, 0.5))
def test_a_transfer_moves_exactly_with_its_footsteps(seed: int, share: float, yaw: float) -> None:
    """The sole that slides from foot to foot, both displaced, is where the shares say; at its ends it is a foot."""
    rng = np.random.default_rng(seed)
    feet = Feet(np.array([[0.0, 0.05, 0.0], [0.04, -0.05, 0.0]]), np.array([yaw, 0.0]), 0)
    displaced = rng.uniform(-0.05, 0.05, (2, 2))
    moved = replace(feet, positions=feet.positions + np.pad(displaced, ((0, 0), (0, 1))))
    transfer = Transfer(0.2, (1.0, 0.0), (0.0, 1.0))
    t = 0.2 + 0.15 * share
    here, there = (
        Interval(0.35, f, -1, (1, 0), transfer).polygon(t, half_extents=HALF, margin=0.0) for f in (feet, moved)
    )
    shares = Interval(0.35, feet, -1, (1, 0), transfer).shares(t, 4)
    by = shares[:2] @ displaced[::-1]  # footstep 0 is the right foot's, 1 the left foot's
    for angle in 2 * np.pi * np.arange(16) / 16:
        u = np.array([np.cos(angle), np.sin(angle)])
        assert reach(here, u) + by @ u == pytest.approx(reach(there, u), abs=1e-6)  # the hull drops corners so flat
    for time, side in ((0.2, 0), (0.35, 1)):
        end = Interval(0.35, feet, -1, (1, 0), transfer).polygon(time, half_extents=HALF, margin=0.0)
        foot = SupportPolygon.of_corners(sole(feet, side), margin=0.0, plane_height=0.0)
        assert inside(end, foot)
        assert inside(foot, end)


def reach(polygon: SupportPolygon, direction: Vector) -> float:
    return float((polygon.vertices @ direction).max())


def test_coming_footsteps_stay_within_what_the_swing_foot_can_do() -> None:
    """The landing place of the foot in the air may move only as fast as the foot; later ones freely; fixed ones not."""
    run = swinging()
    run.run(0.3)
    preview = run.preview(TIMES)
    left = SETTINGS.swing_time - 0.3
    assert_allclose(preview.upper[0], SETTINGS.foot_speed * left, atol=SETTINGS.foot_speed * 2 * DT)
    assert_allclose(preview.lower[0], -preview.upper[0], atol=1e-9)
    assert (preview.upper[1] > preview.upper[0]).all()
    fixed = SETTINGS.model_copy(update={"adapt_footsteps": False})
    still = IdealGait.of(walk(FORWARD), settings=fixed)
    still.run(0.9)
    assert still.gait.swing is not None
    preview = still.preview(TIMES)
    assert not preview.lower.any()
    assert not preview.upper.any()


@settings(max_examples=30, deadline=None)
@given(command=commands, seconds=st.integers(60, 400).map(lambda k: k * DT), seed=st.integers(0, 2**32 - 1))
def test_placement_rows_are_widths_and_lengths(command: Velocity, seconds: float, seed: int) -> None:
    """Rows of random footsteps against the distances between the displaced feet themselves."""
    run = IdealGait.of(walk((0.0, *command)))
    run.run(seconds)
    preview = run.preview(TIMES)
    count = int(np.any(preview.footsteps != 0.0, axis=1).sum())
    shifts = np.random.default_rng(seed).uniform(-0.03, 0.03, (4, 2))
    feet, side = run.gait.feet, None
    step = run.gait.swing.step if run.gait.swing else run.gait.step
    if step is None or command == (0.0, 0.0, 0.0):
        return
    side, standing, before = step.side, feet.positions[1 - step.side, :2], np.zeros(2)
    for j in range(count):
        forward, left = preview.placement_axes[j]
        assert forward[0] * left[1] - forward[1] * left[0] == pytest.approx(1.0)
        place = preview.footsteps[j] + shifts[j]
        across = float(left @ (place - standing)) * (1.0 if side == 0 else -1.0)
        along = float(forward @ (place - standing))
        apart = preview.placement_axes[j] @ (shifts[j] - before)
        kept = ((apart >= preview.placement_lower[j]) & (apart <= preview.placement_upper[j])).all()
        if kept and j == 0:
            assert across <= SETTINGS.widest + 0.15  # what the command asks for is always allowed
        if SETTINGS.narrowest + 0.08 <= across <= SETTINGS.widest and abs(along) <= SETTINGS.longest:
            assert kept
        if kept and abs(command[2]) < 1e-9 and abs(command[0]) * PERIOD < SETTINGS.longest:
            assert across >= SETTINGS.narrowest - 1e-9
            assert abs(along) <= SETTINGS.longest + 1e-9
        standing, before, side = place, shifts[j], 1 - side


def test_stance_polygon_is_of_the_soles() -> None:
    run = IdealGait.of(feet=feet_at(0.1, 0.2))
    box = run.preview(TIMES).polygons[0].vertices
    assert_allclose(box.max(axis=0), [0.1 + HALF[0], 0.2 + SETTINGS.step_width / 2 + HALF[1]])


def test_a_full_turn_keeps_its_heading() -> None:
    """Measured yaws jump by 2π at half a turn; the feet's headings, and with them the swing's, do not."""
    run = IdealGait.of(walk((0.0, 0.0, 0.0, 0.4)))
    gait = run.gait
    for _ in range(1500):
        run.time += DT
        now = gait.soles(1.0)
        measured = np.arctan2(np.sin(now.yaws), np.cos(now.yaws))
        loads, swing = np.full(2, 30.0), gait.swing
        if swing is not None and swing.sigma < 0.98:
            loads[swing.step.side] = 0.0
        gait.advance(
            *(run.time, DT),
            rate=1.0,
            soles=now.positions,
            yaws=measured,
            loads=loads,
            zmp=now.positions[0, :2],
            events=run.events,
        )
        assert abs(gait.feet.yaws[0] - gait.feet.yaws[1]) < 1.0
    assert gait.feet.yaws.mean() > np.pi + 1.0
