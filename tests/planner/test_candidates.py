"""Candidates whose feet have moved: when they know again what is in reach."""

from __future__ import annotations

import numpy as np
from robots import palms, soles, standing_polygon, surena

from wbmpc.planner.candidates import Candidate, Candidates
from wbmpc.planner.keep_out import KeepOut
from wbmpc.planner.settings import ContactSettings
from wbmpc.scenario import Obstacle, PatchPose
from wbmpc.signals import Vector

ROBOT = surena()
HOME = ROBOT.home_q
SOLES, YAWS = soles(HOME), np.zeros(2)
MOVED = SOLES + np.array([[0.05, 0.0, 0.0], [0.0, 0.0, 0.0]])
UP = np.array([0.0, 0.0, 1.0])


def candidates(*places: Vector, obstacles: tuple[Obstacle, ...] = ()) -> Candidates:
    patches = tuple(PatchPose(f"patch_{i}", "ledge", place, UP, 0.5, 20.0) for i, place in enumerate(places))
    keep_out = KeepOut(obstacles, forearm_radius=ROBOT.forearm_radius, leg_radius=ROBOT.leg_radius)
    return Candidates(ROBOT, patches, ContactSettings(), keep_out=keep_out, nominal=HOME, backend="daqp")


def refresh(them: Candidates, feet: Vector, *, plans: int, used: list[Candidate] | None = None) -> None:
    for _ in range(plans):
        them.refresh(soles=feet, yaws=YAWS, centre=feet[:, :2].mean(axis=0), iterations=2, used=used or [])


def test_moved_feet_unsettle_all_and_a_bounded_number_of_plans_settles_them() -> None:
    them = candidates(*(np.array([0.02 * i, 0.2, 0.24]) for i in range(3)))
    refresh(them, SOLES, plans=60)
    assert them.settled
    refresh(them, MOVED, plans=1)
    assert not them.settled
    refresh(them, MOVED, plans=60)
    assert them.settled


def test_what_a_hand_holds_is_kept_current_whoever_has_the_turn() -> None:
    them = candidates(*(np.array([0.02 * i, 0.2, 0.24]) for i in range(3)))
    held = them.all[4]
    refresh(them, MOVED, plans=3, used=[held])
    assert held.settled
    assert not them.settled


def test_a_forearm_inside_an_obstacle_is_out_of_reach() -> None:
    place = np.array([0.05, 0.2, 0.24])
    free = candidates(place)
    refresh(free, SOLES, plans=60)
    left = next(c for c in free.all if c.hand == 0)
    polygon = standing_polygon(0.01)
    assert free.reach(left, polygon).slack > 0.0
    _, elbow = left.posture.forearm(0)
    assert not np.allclose(elbow, palms(HOME)[0])
    post = Obstacle(centre=elbow, half=np.full(3, 0.01), yaw=0.0, corners=np.zeros((4, 2)), bottom=0.0, top=1.0)
    blocked = candidates(place, obstacles=(post,))
    refresh(blocked, SOLES, plans=60)
    reach = blocked.reach(next(c for c in blocked.all if c.hand == 0), polygon)
    assert reach.slack < 0.0
    assert reach.limit == "obstacle"


def test_where_nothing_is_nobody_looks_twice_where_a_palm_fell_short_it_may_once_more() -> None:
    nothing_there, short = candidates(np.array([0.02, 0.2, 0.24])).all
    nothing_there.gave_up("missing")
    assert nothing_there.excluded
    short.gave_up("unreached")
    assert not short.excluded
    short.gave_up("unreached")
    assert short.excluded
