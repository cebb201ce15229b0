"""Ground of different heights: what carries a sole, what must be cleared, and the ZMP's bounds on one plane."""

from __future__ import annotations

import numpy as np
import pytest
from gait_case import HALF, SETTINGS, feet_at
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footholds import CLEARANCE, EDGE_MARGIN, Footholds
from wbmpc.planner.footstep import Feet
from wbmpc.planner.gait import Gait, SupportPhase
from wbmpc.planner.journey import SEARCH_STEP, WORTH_A_STEP
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support import convex_hull, foot_corners
from wbmpc.planner.support_interval import Interval
from wbmpc.scenario import GoTask, Obstacle, Tread
from wbmpc.signals import GRAVITY, Vector


def tread(x: float, y: float, height: float, *, length: float = 0.15, width: float = 0.4, yaw: float = 0.0) -> Tread:
    half = 0.5 * np.array([length, width])
    return Tread(foot_corners(position=np.array([x, y]), yaw=yaw, half_extents=half), height)


def stairs(rise: float = 0.02, depth: float = 0.15, count: int = 4) -> tuple[Tread, ...]:
    """Up and down again from x = 0.1 on; the highest tread is 0.3 m long."""
    heights = [rise * (k + 1) for k in range(count)] + [rise * k for k in range(count - 1, 0, -1)]
    treads, edge = [], 0.1
    for height in heights:
        length = 0.3 if height == max(heights) else depth
        treads.append(tread(edge + length / 2, 0.0, height, length=length))
        edge += length
    return tuple(treads)


@given(x=st.floats(-0.3, 0.3), y=st.floats(-0.3, 0.3), yaw=st.floats(-3.0, 3.0), turned=st.floats(-1.0, 1.0))
def test_a_sole_is_carried_by_one_tread_or_by_the_floor_or_stands_on_an_edge(
    x: float, y: float, yaw: float, turned: float
) -> None:
    board = tread(0.0, 0.0, 0.03, length=0.3, width=0.25, yaw=turned)
    footholds = Footholds((), HALF, ground=(board,))
    place = np.array([x, y])
    rows, columns = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    grid = np.column_stack([rows.ravel(), columns.ravel()]) * HALF
    c, s = np.cos(yaw), np.sin(yaw)
    points = place + grid @ np.array([[c, s], [-s, c]])
    c, s = np.cos(turned), np.sin(turned)
    on = (np.abs(points @ np.array([[c, -s], [s, c]])) <= [0.15, 0.125]).all(axis=1)  # in the board's own axes
    height = footholds.height(place, yaw)
    if on.all():
        assert height == 0.03
    elif not on.any():
        assert height in (0.0, None)  # a corner of the board may be under the sole between the grid's points
    else:
        assert height is None
        assert not footholds.free(place, yaw)


def test_of_two_treads_the_higher_one_carries() -> None:
    footholds = Footholds((), HALF, ground=(tread(0.0, 0.0, 0.02, length=1.0), tread(0.3, 0.0, 0.04, length=0.4)))
    assert footholds.height(np.array([0.3, 0.0]), 0.0) == 0.04
    assert footholds.height(np.array([-0.2, 0.0]), 0.0) == 0.02
    assert footholds.height(np.array([0.1, 0.0]), 0.0) is None
    assert footholds.height(np.array([2.0, 0.0]), 0.0) == 0.0


@pytest.mark.parametrize(("start", "end", "lowest"), [(0.025, 0.175, 0.0), (0.175, 0.025, 0.0), (0.325, 0.175, 0.02)])
def test_a_step_up_or_down_clears_the_edge_between(start: float, end: float, lowest: float) -> None:
    footholds = Footholds((), HALF, ground=stairs())
    lift = footholds.crossed(np.array([start, 0.05]), np.array([end, 0.05]), 0.0, lowest=lowest)
    assert lift == pytest.approx(0.02 + CLEARANCE)
    level = footholds.crossed(np.array([start, 0.05]), np.array([start, 0.09]), 0.0, lowest=lowest + 0.02)
    assert level == 0.0


@settings(max_examples=12, deadline=None)
@given(rise=st.floats(0.01, 0.03), depth=st.floats(0.15, 0.2))
def test_a_journey_over_stairs_puts_every_sole_on_one_tread(rise: float, depth: float) -> None:
    treads = stairs(rise, depth)
    end = float(treads[-1].corners[:, 0].max()) + 0.15
    task = GoTask(kind="go", target=(end, 0.0))
    stepping, feet = Stepping((task,), SETTINGS, Footholds((), HALF, ground=treads)), feet_at()
    highest, steps = 0.0, 0
    while (step := stepping.next(feet, 1.0)) is not None and steps < 60:
        steps += 1
        sole = foot_corners(position=step.position, yaw=step.yaw, half_extents=HALF)
        carrying = [
            t for t in treads if t.corners[:, 0].min() < sole[:, 0].max() and t.corners[:, 0].max() > sole[:, 0].min()
        ]
        expected = {t.top for t in carrying} or {0.0}
        assert expected == {float(step.position[2])}
        rises = abs(step.position[2] - feet.positions[step.side][2])
        assert step.clearance >= rises + 0.02
        if rises > 0.0:  # up or down: from as near to the edge as a foot gets, to as near behind it
            apart = abs(step.position[0] - feet.positions[1 - step.side][0])
            assert apart < 2.0 * (HALF[0] + EDGE_MARGIN) + WORTH_A_STEP + 2 * SEARCH_STEP
        feet = feet.after(step)
        highest = max(highest, float(step.position[2]))
    assert highest == pytest.approx(4 * rise)
    assert feet.positions[:, 0].mean() == pytest.approx(end, abs=0.02)
    assert_allclose(feet.positions[:, 2], 0.0)
    assert steps < 45  # of 3.5 cm on average, each foot


@given(seed=st.integers(0, 2**32 - 1))
def test_bounds_on_one_plane_are_where_forces_through_the_com_meet_it(seed: int) -> None:
    """A robot whose whole force acts at one corner of a sole, towards the CoM: its ZMP is that corner's projection."""
    rng = np.random.default_rng(seed)
    positions = np.array([[0.0, 0.05, 0.0], [rng.uniform(0.1, 0.2), -0.05, rng.uniform(-0.05, 0.05)]])
    yaws = rng.uniform(-0.3, 0.3, 2)
    com, plane = np.array([*rng.uniform(-0.05, 0.15, 2), rng.uniform(0.2, 0.3)]), rng.uniform(-0.05, 0.05)
    interval = Interval(1.0, Feet(positions, yaws, -1), -1, (-1, -1))
    polygon = interval.polygon(0.0, half_extents=HALF, margin=0.0, onto=(plane, com))
    assert polygon.plane_height == plane
    zmps = []
    for position, yaw in zip(positions, yaws, strict=True):
        for corner in foot_corners(position=position, yaw=float(yaw), half_extents=HALF):
            towards = com - np.array([*corner, position[2]])
            force = rng.uniform(20.0, 50.0) * towards / towards[2]  # [N] per kg of mass 1: Newton gives c̈
            acceleration = force - np.array([0.0, 0.0, GRAVITY])
            zmps.append(com[:2] - (com[2] - plane) * acceleration[:2] / (GRAVITY + acceleration[2]))
    hull: Vector = convex_hull(np.array(zmps))
    assert_allclose(sorted(map(tuple, polygon.vertices)), sorted(map(tuple, hull)), atol=1e-9)


def test_on_one_level_the_projection_changes_nothing() -> None:
    interval = Interval(1.0, feet_at(0.2, 0.1, 0.3), -1, (-1, -1))
    plain = interval.polygon(0.0, half_extents=HALF, margin=0.01)
    onto = interval.polygon(0.0, half_extents=HALF, margin=0.01, onto=(0.0, np.array([0.1, 0.0, 0.25])))
    assert_allclose(onto.offsets, plain.offsets, atol=1e-12)
    assert_allclose(onto.vertices, plain.vertices, atol=1e-12)


def test_a_foot_finds_a_place_a_little_wider_beside_an_edge_that_runs_along_the_way() -> None:
    board = tread(
        0.6, 0.52, 0.01, length=1.0, width=1.0
    )  # its right edge is at y = 0.02, under the left foot's inner side
    stepping, feet = (
        Stepping((GoTask(kind="go", target=(0.5, 0.0)),), SETTINGS, Footholds((), HALF, ground=(board,))),
        feet_at(),
    )
    carried = set()
    while (step := stepping.next(feet, 1.0)) is not None and len(carried) < 40:
        carried.add((step.side, round(float(step.position[0]), 3), float(step.position[2])))
        low, high = step.position[1] - HALF[1], step.position[1] + HALF[1]
        if step.position[0] > 0.1 + HALF[0]:
            assert high <= 0.02 or low >= 0.02
        feet = feet.after(step)
    assert feet.positions[:, 0].mean() == pytest.approx(0.5, abs=0.02)
    assert {height for side, _, height in carried if side == 0} == {0.0, 0.01}
    assert {height for side, _, height in carried if side == 1} == {0.0}


def test_on_the_level_that_carries_the_other_foot_a_sole_is_as_high_as_that_one() -> None:
    """What is known of the ground is in steps from one level to the other: an estimate that drifts must not matter."""
    footholds = Footholds((), HALF, ground=stairs())
    own = footholds.height(np.array([0.175, -0.05]), 0.0)
    assert own == 0.02
    same = footholds.on_ground(np.array([0.175, 0.05]), 0.0, stance=0.0213, own=own)
    assert same[2] == 0.0213
    higher = footholds.on_ground(np.array([0.325, 0.05]), 0.0, stance=0.0213, own=own)
    assert higher[2] == 0.04
    edge = footholds.on_ground(np.array([0.25, 0.05]), 0.0, stance=0.0213, own=own)
    assert edge[2] == 0.0213


def journey(task: GoTask, footholds: Footholds, feet: Feet, *, misses: Vector | None = None) -> list[Feet]:
    """The feet after every step of a journey; each landing misses its place by (x, y, yaw) [m, rad] in turn."""
    stepping, made = Stepping((task,), SETTINGS, footholds), [feet]
    while (step := stepping.next(made[-1], 1.0)) is not None and len(made) < 60:
        made.append(made[-1].after(step))
        if misses is not None:
            miss = misses[len(made) % len(misses)]
            made[-1].positions[step.side, :2] += miss[:2]
            made[-1].yaws[step.side] += miss[2]
    return made


@settings(max_examples=40, deadline=None)
@given(target=st.floats(-0.15, 0.4), height=st.floats(0.01, 0.05))
def test_a_goal_near_an_edge_ends_the_journey_on_one_side_of_it(target: float, height: float) -> None:
    board = tread(0.6, 0.0, height, length=1.0)  # from x = 0.1 on
    made = journey(GoTask(kind="go", target=(target, 0.0)), Footholds((), HALF, ground=(board,)), feet_at())
    assert len(made) < 20
    last = made[-1]
    assert last.aligned
    for x in last.positions[:, 0]:
        assert x + HALF[0] <= 0.1 or x - HALF[0] >= 0.1
    assert abs(last.positions[:, 0].mean() - target) < HALF[0] + EDGE_MARGIN + 0.02


@settings(max_examples=20, deadline=None)
@given(turn=st.floats(-0.04, 0.04), seed=st.integers(0, 1000))
def test_over_tiles_with_a_heading_that_is_a_little_off(turn: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    tiles = tuple(
        tread(0.19 + 0.18 * column, -0.18 + 0.12 * row, float(rng.uniform(0.01, 0.03)), length=0.18, width=0.12)
        for column in range(5)
        for row in range(4)
    )
    feet = feet_at(0.0, 0.0, turn)
    misses = np.column_stack([rng.normal(0.0, 0.001, (7, 2)), rng.normal(0.0, 0.003, 7)])
    made = journey(GoTask(kind="go", target=(1.1, 0.0)), Footholds((), HALF, ground=tiles), feet, misses=misses)
    assert made[-1].positions[:, 0].mean() == pytest.approx(1.1, abs=0.03)
    assert len(made) < 45


def test_what_is_too_high_to_step_onto_ends_the_journey_whatever_the_steps_length() -> None:
    for length in (0.05, 0.08, 0.15, 0.2):
        footholds = Footholds((), HALF, ground=(tread(0.6, 0.0, 0.2, length=1.0),))
        made = journey(GoTask(kind="go", target=(0.8, 0.0), step_length=length), footholds, feet_at())
        assert made[-1].positions[:, 2].max() == 0.0
        assert made[-1].positions[:, 0].max() + HALF[0] < 0.1
        assert len(made) < 10


def wall(x: float, *, bottom: float, height: float) -> Obstacle:
    half = np.array([0.01, 0.3, height / 2])
    corners = foot_corners(position=np.array([x, 0.0]), yaw=0.0, half_extents=half[:2])
    return Obstacle(np.array([x, 0.0, bottom + half[2]]), half, 0.0, corners, bottom, bottom + height)


@pytest.mark.parametrize("bottom", [0.0, 0.06])
def test_a_wall_on_a_tread_stops_the_journey_as_one_on_the_floor_does(bottom: float) -> None:
    footholds = Footholds((wall(0.45, bottom=bottom, height=0.4),), HALF, ground=(tread(0.6, 0.0, 0.06, length=1.0),))
    made = journey(GoTask(kind="go", target=(0.8, 0.0)), footholds, feet_at())
    assert made[-1].positions[:, 0].max() + HALF[0] < 0.44
    assert made[-1].positions[:, 2] == pytest.approx(0.06)


def test_before_a_wall_below_an_edge_no_foot_stands_on_the_edge() -> None:
    board = tread(0.2, 0.0, 0.03, length=0.2)  # until x = 0.3
    footholds = Footholds((wall(0.38, bottom=0.0, height=0.4),), HALF, ground=(board,))
    for feet in journey(GoTask(kind="go", target=(0.8, 0.0)), footholds, feet_at()):
        for place in feet.positions:
            assert footholds.height(place[:2], 0.0) is not None


def test_stairs_are_climbed_backward_and_in_any_direction() -> None:
    for yaw in (0.0, 1.0, np.pi):
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, -s], [s, c]])
        ground = tuple(Tread(t.corners @ turn.T, t.top) for t in stairs(count=2))
        for facing, sign in ((yaw, 1.0), (yaw + np.pi, -1.0)):
            c, s = np.cos(facing), np.sin(facing)
            feet = Feet(np.array([[-s * 0.045, c * 0.045, 0.0], [s * 0.045, -c * 0.045, 0.0]]), np.full(2, facing), -1)
            target = turn @ np.array([0.9, 0.0])
            made = journey(
                GoTask(kind="go", target=(float(target[0]), float(target[1]))), Footholds((), HALF, ground=ground), feet
            )
            assert made[-1].positions[:, :2].mean(axis=0) == pytest.approx(target, abs=0.02), (yaw, sign)
            assert max(f.positions[:, 2].min() for f in made) == pytest.approx(0.04)


def test_the_preview_of_a_step_up_is_seen_on_the_plane_of_the_feet_that_stand() -> None:
    """Every polygon is the soles' outline, seen from the CoM at that knot."""
    treads = stairs(rise=0.03)
    stepping = Stepping((GoTask(kind="go", target=(1.0, 0.0)),), SETTINGS, Footholds((), HALF, ground=treads))
    feet = Feet(np.array([[0.03, 0.045, 0.0], [0.03, -0.045, 0.0]]), np.zeros(2), 1)
    gait = Gait(SETTINGS, stepping, feet=feet, half_extents=HALF)
    events: list[str] = []
    args = dict(rate=1.0, soles=feet.positions, yaws=feet.yaws, loads=np.full(2, 17.0), zmp=np.array([0.03, -0.045]))
    gait.advance(1.0, 0.01, **args, events=events)
    assert gait.phase == SupportPhase.DOUBLE
    step = gait.step
    assert step is not None
    assert step.position[2] == pytest.approx(0.03)
    landed = SETTINGS.stride_double_support + step.swing_time  # [s] the first support is as long as any other
    times = np.linspace(0.1, landed + 0.05, 30)
    com = np.column_stack([np.linspace(0.03, 0.15, 30), np.zeros(30), np.linspace(0.25, 0.28, 30)])
    preview = gait.preview(1.0, times, rate=1.0, margin=0.0, growth=0.0, com=com)
    assert {polygon.plane_height for polygon in preview.polygons} == {0.0}
    after = feet.after(step)
    last = preview.polygons[-1]
    places = []
    for position in after.positions:
        for corner in foot_corners(position=position[:2], yaw=0.0, half_extents=HALF):
            ray = np.array([*corner, position[2]]) - com[-1]  # from the CoM through the corner down to the floor
            places.append((com[-1] - ray * com[-1][2] / ray[2])[:2])
    hull = convex_hull(np.array(places))
    raised = foot_corners(position=after.positions[step.side][:2], yaw=0.0, half_extents=HALF)
    assert last.vertices[:, 0].max() > raised[:, 0].max() + 0.005  # not merely seen from above
    assert_allclose(sorted(map(tuple, last.vertices)), sorted(map(tuple, hull)), atol=1e-9)
