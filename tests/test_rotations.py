"""Rotations against Pinocchio's exponential and logarithm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from wbmpc.rotations import contact_frame, length, level_frame, rotation_error
from wbmpc.signals import Vector

NEARLY_HALF_TURN = np.pi - 1e-3  # [rad]; at a half turn the axis has two signs

vectors = arrays(np.float64, 3, elements=st.floats(-3, 3))


@st.composite
def rotation_vectors(draw: st.DrawFn) -> Vector:
    axis = draw(vectors.filter(lambda a: np.linalg.norm(a) > 0.1))
    return draw(st.floats(0, NEARLY_HALF_TURN)) * axis / np.linalg.norm(axis)


@given(start=rotation_vectors(), turn=rotation_vectors())
def test_error_is_the_turn_from_measured_to_desired(start: Vector, turn: Vector) -> None:
    measured = pin.exp3(start)
    assert_allclose(rotation_error(desired=pin.exp3(turn) @ measured, measured=measured), turn, atol=1e-8)


@given(start=rotation_vectors())
def test_no_error_without_a_turn(start: Vector) -> None:
    assert_allclose(rotation_error(desired=pin.exp3(start), measured=pin.exp3(start)), 0.0, atol=1e-15)


@given(start=rotation_vectors(), axis=st.sampled_from(np.eye(3).tolist()), angle=st.floats(1e-12, 1e-6))
def test_small_turns_keep_their_size(start: Vector, axis: list[float], angle: float) -> None:
    turn = angle * np.array(axis)
    measured = pin.exp3(start)
    assert_allclose(rotation_error(desired=pin.exp3(turn) @ measured, measured=measured), turn, atol=1e-15)


@given(normal=vectors.filter(lambda n: np.linalg.norm(n) > 0.1))
def test_contact_frame_is_a_rotation_whose_third_axis_is_the_normal(normal: Vector) -> None:
    normal = normal / np.linalg.norm(normal)
    frame = contact_frame(normal)
    assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert_allclose(np.linalg.det(frame), 1.0, atol=1e-12)
    assert_allclose(frame[:, 2], normal, atol=1e-12)


@given(yaw=st.floats(-10, 10))
def test_level_frame_turns_about_the_vertical(yaw: float) -> None:
    assert_allclose(level_frame(yaw), pin.exp3(np.array([0.0, 0.0, yaw])), atol=1e-12)


@given(vector=vectors)
def test_length_is_the_norm(vector: Vector) -> None:
    assert length(vector) == np.linalg.norm(vector)
