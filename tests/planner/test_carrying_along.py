"""What is held goes along with the CoM."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.carry import Carry
from wbmpc.rotations import level_frame

PALMS = np.array([[0.15, 0.08, 0.2], [0.16, -0.09, 0.21]])
COM = np.array([0.01, 0.002, 0.25])


def state(time: float) -> tuple[np.ndarray, float]:
    """A CoM (3, 3) on some way, and the feet's heading."""
    position = COM + np.array([0.1 * time, 0.04 * np.sin(2.0 * time), 0.01 * np.sin(time)])
    velocity = np.array([0.1, 0.08 * np.cos(2.0 * time), 0.01 * np.cos(time)])
    return np.column_stack([position, velocity, np.zeros(3)]), 0.3 + 0.2 * time


def carry_at(time: float) -> Carry:
    carry = Carry(PALMS, com=COM, heading=0.3)
    com, heading = state(time)
    carry.follow(com, np.tile(com[:, 0], (4, 1)), heading=heading, yaw_rate=0.2)
    return carry


def test_the_palms_begin_where_they_are() -> None:
    carry = carry_at(0.0)
    assert_allclose([carry.reference(side)[0] for side in range(2)], PALMS)
    assert_allclose(carry.preview()[:, 2], PALMS)


@given(time=st.floats(0.0, 5.0))
def test_velocities_are_the_positions_derivatives(time: float) -> None:
    step = 1e-5
    for side in range(2):
        before, after = (carry_at(time + sign * step).reference(side)[0] for sign in (-1, 1))
        assert_allclose(carry_at(time).reference(side)[1], (after - before) / (2 * step), atol=1e-6)


@given(time=st.floats(0.0, 5.0))
def test_seen_from_the_robot_the_palms_stay_where_they_are(time: float) -> None:
    com, heading = state(time)
    carry = carry_at(time)
    for side in range(2):
        seen = level_frame(heading).T @ (carry.reference(side)[0] - com[:, 0])
        assert_allclose(seen, level_frame(0.3).T @ (PALMS[side] - COM), atol=1e-12)
        assert_allclose(carry.beside(com[:, 0], heading)[side], carry.reference(side)[0], atol=1e-12)
