"""The postures of a lift: palms at the box, and beside the CoM while the feet go on."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from robots import palms, soles, surena

from wbmpc.kinematics import Kinematics
from wbmpc.planner.bands import UNBOUNDED
from wbmpc.planner.carry import Carry
from wbmpc.planner.footstep import Feet
from wbmpc.planner.lift import Lift, LiftPhase
from wbmpc.planner.lift_postures import SLACK, LiftPostures
from wbmpc.scenario import LiftTask, Load
from wbmpc.signals import Vector

ROBOT = surena()
HOME = ROBOT.home_q
BEFORE = Feet(soles(HOME), np.zeros(2), -1)
STEP_UP = np.array([[0.12, 0.0, 0.03], [0.0, 0.0, 0.0]])
AFTER = Feet(BEFORE.positions + STEP_UP, np.zeros(2), 0)


def lift() -> Lift:
    task = LiftTask(kind="lift", object="thing", height=0.12)
    load = Load(task=task, centre=np.array([0.16, 0.0, 0.06]), half=np.array([0.04, 0.08, 0.06]), yaw=0.0, mass=0.2)
    return Lift(load, palms=palms(HOME), heading=0.0, palm_radius=ROBOT.palm_radius)


def settled(it: Lift, *, after: Feet = BEFORE, centre: Vector | None = None) -> LiftPostures:
    postures = LiftPostures(Kinematics(ROBOT), nominal=HOME)
    for _ in range(60):
        middle = BEFORE.positions[:, :2].mean(axis=0) if centre is None else centre
        postures.iterate(2, it, before=BEFORE, after=after, centre=middle)
    return postures


def test_low_has_the_palms_on_the_box_and_high_above_it() -> None:
    it = lift()
    postures = settled(it)
    assert_allclose(palms(postures.low.q), it.grasp, atol=5e-3)
    assert_allclose(palms(postures.high.q), it.grasp + np.array([0.0, 0.0, 0.12]), atol=5e-3)
    assert postures.low.com[2] < postures.high.com[2] - 0.03
    furthest = np.maximum(np.abs(it.grasp - postures.low.com), np.abs(it.top - postures.high.com))
    assert_allclose(postures.distance(it), furthest + SLACK)


def test_on_the_way_the_palms_are_beside_the_com_before_a_stride_and_after_it() -> None:
    it = lift()
    it.phase = LiftPhase.CARRY
    com = np.array([0.01, 0.0, 0.25])
    places = np.array([[0.14, 0.095, -0.02], [0.14, -0.095, -0.02]])  # [m] from the CoM
    it.carry = Carry(com + places, com=com, heading=0.0)
    stance = BEFORE.positions[1, :2]
    postures = settled(it, after=AFTER, centre=stance)
    for posture, feet in ((postures.low, BEFORE), (postures.high, AFTER)):
        assert_allclose(soles(posture.q), feet.positions, atol=2e-3)
        beside = palms(posture.q) - [*stance, posture.com[2]]
        assert_allclose(beside, places, atol=5e-3)
        assert posture.settled
    assert_allclose(postures.distance(it), UNBOUNDED)


def test_what_is_lost_leaves_one_posture_on_the_feet_after_the_stride() -> None:
    it = lift()
    it.phase, it.grasp = LiftPhase.GIVE_UP, it.grasp + np.array([0.06, 0.0, 0.12])  # held on the way
    postures = settled(it, after=AFTER, centre=AFTER.positions[0, :2])
    assert soles(postures.low.q) == pytest.approx(AFTER.positions, abs=2e-3)
    assert_allclose(postures.high.q, HOME)
