"""The moments of a strip: ends, every posture that the robot holds, and no moment twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from traces import footage_of, still

from wbmpc.figures.moments import key_moments


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 8), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_moments_are_samples_in_order_with_both_ends(count: int, samples: int, seed: int) -> None:
    trace = still(samples)
    walk = np.cumsum(np.random.default_rng(seed).normal(size=(samples, 3)), axis=0)
    moments = key_moments(footage_of(trace, walk), trace, count)
    assert set(moments) <= set(trace.time)
    assert moments == sorted(set(moments))
    assert 1 <= len(moments) <= count
    assert moments[0] == trace.time[0]
    if count > 1:
        assert moments[-1] == trace.time[-1]


def test_every_posture_that_is_held_is_shown_while_it_is_held() -> None:
    """Four postures with quick ways in between: each hold gets its picture, not the ways."""
    trace = still(401)
    corner = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]])
    progress = np.interp(trace.time, [0.0, 0.5, 0.7, 1.5, 1.7, 2.5, 2.7, 3.5, 3.7, 4.0], [0, 0, 1, 1, 2, 2, 3, 3, 4, 4])
    joints = np.column_stack([np.interp(progress, range(5), corner[:, k]) for k in (0, 1)])
    moments = key_moments(footage_of(trace, joints), trace, 5)
    held = [(0.0, 0.5), (0.7, 1.5), (1.7, 2.5), (2.7, 3.5), (3.7, 4.0)]
    assert [low <= time <= high for time, (low, high) in zip(moments, held, strict=True)] == [True] * 5


def test_a_hand_that_pushes_is_shown_even_when_nothing_moves() -> None:
    trace = still()
    trace.hand_force[60:80, 1] = 5.0
    moments = key_moments(footage_of(trace, np.zeros((101, 2))), trace, 3)
    assert 0.6 <= moments[1] < 0.8


def test_one_sample_is_one_moment() -> None:
    trace = still(1)
    assert key_moments(footage_of(trace, np.zeros((1, 2))), trace, 6) == pytest.approx([0.0])
