"""Going to a place over what stands in the way: footprints against the boxes, landings that miss a little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gait_case import HALF, SETTINGS, feet_at, sole
from hypothesis import given
from hypothesis import strategies as st

from wbmpc.planner.footholds import Footholds
from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.stepping import Stepping
from wbmpc.planner.support import foot_corners
from wbmpc.scenario import GoTask, Obstacle
from wbmpc.signals import Vector

SILL = 0.12  # [m] where it is ahead


def sill(depth: float = 0.09, height: float = 0.03) -> Obstacle:
    half = np.array([depth / 2, 0.3, height / 2])
    corners = foot_corners(position=np.array([SILL, 0.0]), yaw=0.0, half_extents=half[:2])
    return Obstacle(np.array([SILL, 0.0, half[2]]), half, 0.0, corners, 0.0, height)


def journey(obstacles: tuple[Obstacle, ...], miss: Vector, start: float = 0.0) -> list[tuple[Feet, Footstep]]:
    """Every step of a journey, and the feet before it; landings miss their places by `miss` (n, 2) [m] in turn."""
    task = GoTask(kind="go", target=(0.36, 0.0))
    stepping, feet = Stepping((task,), SETTINGS, Footholds(obstacles, HALF)), feet_at(start)
    made: list[tuple[Feet, Footstep]] = []
    while len(made) < 40 and (step := stepping.next(feet, 1.0)) is not None:
        made.append((feet, step))
        error = np.array([*miss[len(made) % len(miss)], 0.0])
        feet = feet.after(replace(step, position=step.position + error))
        stepping.landed(step)
    made.append((feet, made[-1][1]))
    return made


def under(feet: Feet, side: int) -> tuple[float, float]:
    """Least and greatest x [m] of a sole."""
    x = sole(feet, side)[:, 0]
    return float(x.min()), float(x.max())


@given(
    miss=st.lists(st.tuples(st.floats(-0.008, 0.008), st.floats(-0.008, 0.008)), min_size=3, max_size=8),
    depth=st.floats(0.06, 0.11),
)
def test_both_feet_get_over_and_arrive_whatever_landings_miss(miss: list[tuple[float, float]], depth: float) -> None:
    made = journey((sill(depth),), np.array(miss))
    front, back = SILL - depth / 2, SILL + depth / 2
    for feet, step in made[:-1]:
        after = feet.after(step)
        low, high = under(after, step.side)
        assert high <= front + 1e-9 or low >= back - 1e-9  # never planned onto the sill
        crosses = under(feet, step.side)[1] < SILL < low
        assert step.clearance > (0.03 if crosses else 0.0)
    last = made[-1][0]
    assert abs(float(last.positions[:, 0].mean()) - 0.36) < 0.03
    assert len(made) - 1 <= 8  # a foot that has landed close to the sill goes on with a full step


def test_a_foot_in_the_margin_behind_an_obstacle_is_not_in_its_way() -> None:
    """6 mm behind the sill instead of 12: the next step leads away from it, and is as long as any other."""
    footholds = Footholds((sill(),), HALF)
    start = np.array([SILL + 0.045 + 0.006 + HALF[0], 0.045])
    ahead = np.array([0.08, 0.0])
    assert footholds.crossed(start, start + ahead, 0.0) == 0.0
    assert footholds.crossed(start, start - ahead, 0.0)  # back over it one must lift the foot
    assert not footholds.free(start, 0.0)  # nobody would choose this place


def test_what_cannot_be_stepped_over_ends_the_journey_before_it() -> None:
    made = journey((sill(height=0.2),), np.zeros((1, 2)), start=-0.15)
    last = made[-1][0]
    assert under(last, 0)[1] < SILL - 0.045
    assert under(last, 1)[1] < SILL - 0.045
    assert len(made) < 10
