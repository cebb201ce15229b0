"""A hurried palm is held from the tick of its touch on; nothing else is changed, and no other hand's mode."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from tests.tracker.tracker_case import make_tracker, standing, state
from wbmpc.signals import HandMode, Setpoint, Vector
from wbmpc.tracker.reflex import TouchReflex

OUT = np.array([0.0, -1.0, 0.0])  # of a wall on the left


def hurrying(*, mode: HandMode = HandMode.MOVE, urgency: float = 1.0) -> Setpoint:
    """The left hand on its way to a wall on the left."""
    return standing(
        hand_mode=np.array([mode, HandMode.FREE]),
        hand_urgency=np.array([urgency, 0.0]),
        hand_normal=np.array([OUT, OUT]),
        hand_force_cap=np.array([20.0, 0.0]),
    )


def pushed(newtons: float) -> Vector:
    """Sensed forces when the wall pushes both palms outwards with so much."""
    return np.array([newtons * OUT, newtons * OUT])


@given(forces=st.lists(st.floats(-1.0, 1.0), max_size=5), impact=st.floats(3.0, 60.0), after=st.floats(-1.0, 60.0))
def test_a_touch_holds_the_palm_until_the_plan_takes_over(forces: list[float], impact: float, after: float) -> None:
    reflex, setpoint = TouchReflex(), hurrying()
    for force in forces:  # noise
        assert reflex.apply(setpoint, pushed(force)) is setpoint
    for force in (impact, after):  # a bounce does not undo it
        held = reflex.apply(setpoint, pushed(force))
        assert held.hand_mode.tolist() == [HandMode.CONTACT, HandMode.FREE]
        for field in fields(Setpoint):
            if field.name != "hand_mode":
                assert getattr(held, field.name) is getattr(setpoint, field.name)
    planned = hurrying(mode=HandMode.CONTACT)
    assert reflex.apply(planned, pushed(impact)) is planned
    assert reflex.apply(setpoint, pushed(0.0)) is setpoint  # the next approach begins anew


@pytest.mark.parametrize("setpoint", [hurrying(urgency=0.0), hurrying(mode=HandMode.FREE)])
def test_a_careful_or_free_hand_has_no_reflex(setpoint: Setpoint) -> None:
    assert TouchReflex().apply(setpoint, pushed(30.0)) is setpoint


def test_the_tracker_pushes_from_the_tick_of_the_touch() -> None:
    """As if the plan had known of the touch; without one the palm of the same plan carries nothing."""
    surface = {"hand_normal": np.array([OUT, OUT]), "hand_force_cap": np.array([20.0, 0.0])}
    task = {"hand_acceleration": np.array([30.0 * OUT, np.zeros(3)]), "com_acceleration": 5.0 * OUT}
    moving = standing(
        hand_mode=np.array([HandMode.MOVE, HandMode.FREE]), hand_urgency=np.array([1.0, 0.0]), **surface, **task
    )
    known = standing(hand_mode=np.array([HandMode.CONTACT, HandMode.FREE]), **surface, **task)
    flying, touched, planned = (
        make_tracker().solve(state(palm_force_in_world=pushed(force)), setpoint)
        for setpoint, force in ((moving, 0.0), (moving, 40.0), (known, 40.0))
    )
    assert not flying.palm_force_in_world.any()
    assert float(touched.palm_force_in_world[0] @ OUT) > 1.0
    assert_array_equal(touched.torque, planned.torque)
    assert np.abs(touched.torque - flying.torque).max() > 0.1
