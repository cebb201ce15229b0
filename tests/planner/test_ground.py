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
from wbmpc.planner.journey import SEARCH_STEP, WORTH_A_STEP
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support import convex_hull, foot_corners
from wbmpc.planner.support_interval import Interval
from wbmpc.scenario import GoTask, Tread
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
        assert height in (0.03, None)  # a point of the outline may be outside where the grid has none
    elif not on.any():
        assert height in (0.0, None)
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
    on_first = np.array([0.175, -0.05, 0.0213])  # 1.3 mm higher than the tread is said to be
    same = footholds.on_ground(np.array([0.175, 0.05]), 0.0, stance=on_first, stance_yaw=0.0)
    assert same[2] == 0.0213
    higher = footholds.on_ground(np.array([0.325, 0.05]), 0.0, stance=on_first, stance_yaw=0.0)
    assert higher[2] == 0.04
    edge = footholds.on_ground(np.array([0.25, 0.05]), 0.0, stance=on_first, stance_yaw=0.0)
    assert edge[2] == 0.0213
