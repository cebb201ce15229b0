"""Half-spaces that keep free arms off obstacles: against distances found by brute force."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wbmpc.planner.keep_out import DISTANCE, NEAR, KeepOut
from wbmpc.scenario import Obstacle

NO_LEGS = np.array([[[5.0, 0.0, 0.0], [5.0, 0.0, 1.0]]] * 4)
number = st.floats(-0.3, 0.3)
FOREARM, LEG = 0.015, 0.025  # [m] radii


def keep_out(*obstacles: Obstacle) -> KeepOut:
    return KeepOut(obstacles, forearm_radius=FOREARM, leg_radius=LEG)


def box(centre: tuple[float, float, float], half: tuple[float, float, float], yaw: float) -> Obstacle:
    return Obstacle(
        centre=np.array(centre), half=np.array(half), yaw=yaw, corners=np.zeros((4, 2)), bottom=0.0, top=1.0
    )


def surface_points(obstacle: Obstacle) -> np.ndarray:
    """A dense grid of points in and on the box, in world."""
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 25)] * 3), axis=-1).reshape(-1, 3) * obstacle.half
    c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    return obstacle.centre + grid @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


@settings(max_examples=60, deadline=None)
@given(point=st.tuples(number, number, number), yaw=st.floats(-3.0, 3.0))
def test_the_half_space_of_a_point_outside_touches_the_nearest_point_of_the_box(
    point: tuple[float, float, float], yaw: float
) -> None:
    obstacle = box((0.05, -0.02, 0.1), (0.1, 0.04, 0.06), yaw)
    x = np.array(point)
    points = surface_points(obstacle)
    distances = np.linalg.norm(points - x, axis=1)
    row = keep_out(obstacle).half_spaces(x[None])[0][0]
    if distances.min() > NEAR + 0.01:
        assert row[3] == -np.inf
    elif 0.01 < distances.min() < NEAR - 0.01:
        assert abs(np.linalg.norm(row[:3]) - 1.0) < 1e-9
        assert (points @ row[:3]).max() <= row[3] - DISTANCE + 1e-9  # the box lies behind it
        assert abs(row[:3] @ x - row[3] + DISTANCE - distances.min()) < 0.005  # by the distance of the point


def test_a_point_inside_is_shown_the_shortest_way_out() -> None:
    row = keep_out(box((0.0, 0.0, 0.0), (0.1, 0.2, 0.3), 0.0)).half_spaces(np.array([[-0.09, 0.05, 0.1]]))[0][0]
    assert np.allclose(row[:3], [-1.0, 0.0, 0.0])
    assert abs(row[3] - (0.1 + DISTANCE)) < 1e-12


def test_the_nearest_of_several_obstacles_counts_and_none_gives_none() -> None:
    near, far = box((0.1, 0.0, 0.0), (0.05, 0.05, 0.05), 0.0), box((-0.15, 0.0, 0.0), (0.05, 0.05, 0.05), 0.0)
    row = keep_out(far, near).half_spaces(np.zeros((1, 3)))[0][0]
    assert np.allclose(row, [-1.0, 0.0, 0.0, -0.05 + DISTANCE])
    assert keep_out().half_spaces(np.zeros((2, 3)))[0][:, 3].tolist() == [-np.inf, -np.inf]


@given(angle=st.floats(-np.pi, np.pi), gap=st.floats(0.005, 0.05))
def test_a_palm_beside_a_thigh_is_shown_away_from_its_axis(angle: float, gap: float) -> None:
    legs = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]] * 4)
    outward = np.array([np.cos(angle), np.sin(angle), 0.0])
    palms = np.tile((LEG + gap) * outward + [0.0, 0.0, 0.1], (2, 1))
    row = keep_out().of_arms(palms, palms + 0.3 * outward, legs, free=[True, True])[0, 0]
    assert np.allclose(row[:3], outward)
    assert abs(row[:3] @ palms[0] - row[3] - (gap - DISTANCE)) < 1e-9


@settings(max_examples=40, deadline=None)
@given(y=st.floats(-0.1, 0.1), z=st.floats(-0.1, 0.25), yaw=st.floats(-3.0, 3.0))
def test_the_gap_of_a_forearm_is_that_of_its_elbow_half(y: float, z: float, yaw: float) -> None:
    obstacle = box((0.15, -0.02, 0.1), (0.05, 0.04, 0.06), yaw)
    palm, elbow = np.array([0.0, y, z]), np.array([0.02, y - 0.1, z + 0.02])
    axis = palm + np.linspace(0.5, 1.0, 60)[:, None] * (elbow - palm)
    distances = np.linalg.norm(surface_points(obstacle)[:, None] - axis[None], axis=2)
    assert abs(keep_out(obstacle).forearm_gap(palm, elbow) + FOREARM - distances.min()) < 0.006


@given(height=st.floats(0.02, 0.08))
def test_a_thin_bar_does_not_fit_between_the_points_of_a_free_forearm(height: float) -> None:
    """Wherever a forearm of 10 cm meets the bar, one of its rows lacks what is wanting at the nearest point."""
    bar = keep_out(box((0.02, 0.0, height), (0.01, 0.3, 0.002), 0.0))
    palms, elbows = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.1], (2, 1))
    rows = bar.of_arms(palms, elbows, NO_LEGS, free=[True, False])
    points = palms[:, None] + rows[:, :, 4:] * (elbows - palms)[:, None]
    lacking = rows[:, :, 3] - np.einsum("ijk,ijk->ij", rows[:, :, :3], points)  # [m] to the clearance
    assert lacking[0].max() > DISTANCE - 0.01 - 0.003  # the bar's face is 1 cm away
    assert rows[0, :, 4].tolist()[::2] == [0.0, 1.0]


def test_a_hand_on_its_way_may_come_near_to_a_surface_but_not_to_a_leg() -> None:
    palms, elbows = np.zeros((2, 3)), np.tile([0.1, 0.0, 0.1], (2, 1))
    floor = keep_out(box((0.0, 0.0, -0.05), (0.3, 0.3, 0.04), 0.0))
    free, reaching = floor.of_arms(palms, elbows, NO_LEGS, free=[True, False])
    assert free[0, 3] > -np.inf
    assert reaching[0, 3] == -np.inf
    legs = NO_LEGS.copy()
    legs[0] = [[0.0, 0.03, -0.1], [0.0, 0.03, 0.1]]
    assert np.allclose(floor.of_arms(palms, elbows, legs, free=[True, False])[1, 0, :3], [0.0, -1.0, 0.0])
