"""The swing foot's way against finite differences, and what it promises at its ends."""

from __future__ import annotations

import numpy as np
import pytest
from gait_case import SETTINGS
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footstep import Footstep
from wbmpc.planner.swing import Swing
from wbmpc.signals import Vector

SPEED = 0.8  # [m/s] of the landing place
leads = st.sampled_from([0.0, 0.06, 0.2, 0.3])
places = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.1, 0.1), st.floats(-0.05, 0.05)).map(np.array)


def footstep(*, lead: float = 0.06, end: Vector | None = None, swing_time: float = 0.5) -> Footstep:
    return Footstep(
        side=0,
        position=np.array([0.1, 0.05, 0.0]) if end is None else end,
        yaw=0.4,
        swing_time=swing_time,
        double_support=0.1,
        clearance=SETTINGS.step_height,
        lead=lead,
        adaptable=True,
        task=0,
    )


def swing(*, lead: float = 0.06, end: Vector | None = None) -> Swing:
    return Swing(footstep(lead=lead, end=end), start=np.array([-0.02, 0.04, 0.01]), yaw=-0.1, speed=SPEED)


def at(foot: Swing, sigma: float, rate: float = 2.0) -> tuple[Vector, Vector, Vector]:
    foot.sigma = sigma
    return foot.reference(rate)


@given(lead=leads, end=places, sigma=st.floats(0.01, 0.99), rate=st.floats(0.2, 3.0))
def test_velocity_and_acceleration_are_the_positions_derivatives(
    lead: float, end: Vector, sigma: float, rate: float
) -> None:
    h = 1e-4  # [s]
    corners = np.array([lead, 1.0 - lead, 0.5 - 0.5 * lead, 0.5 + 0.5 * lead])  # the third derivative jumps there
    assume(np.abs(sigma - corners).min() > 2 * h * rate)
    foot = swing(lead=lead, end=end)
    (before, _, _), (_, velocity, acceleration), (after, _, _) = (
        at(foot, sigma + k * h * rate, rate) for k in (-1.0, 0.0, 1.0)
    )
    now = at(foot, sigma, rate)[0]
    assert_allclose(velocity, (after - before) / (2 * h), atol=1e-5)
    assert_allclose(acceleration, (after - 2 * now + before) / h**2, atol=2e-3)


@given(lead=leads, sigma=st.floats(0.05, 0.95), heading=st.floats(-np.pi, np.pi))
def test_velocity_takes_in_the_moving_target(lead: float, sigma: float, heading: float) -> None:
    """While the landing place moves, the foot's velocity is still the derivative of its position."""
    rate, h = 2.0, 1e-5
    foot = swing(lead=lead)
    far = 10.0 * np.array([np.cos(heading), np.sin(heading)])
    foot.move_target(far, h)
    before, velocity, _ = at(foot, sigma, rate)
    foot.move_target(far, h)
    after, _, _ = at(foot, sigma + h * rate, rate)
    assert_allclose((after - before) / h, velocity, atol=1e-3)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), dt=st.floats(0.001, 0.1))
def test_target_moves_at_a_bounded_speed_and_arrives(x: float, y: float, dt: float) -> None:
    foot, target = swing(), np.array([x, y])
    distance = np.linalg.norm(target - foot.target[:2])
    for _ in range(int(distance / (SPEED * dt)) + 2):
        before, place = foot.target[:2].copy(), at(foot, 0.6)[0]
        foot.move_target(target, dt)
        assert np.linalg.norm(foot.target[:2] - before) <= SPEED * dt + 1e-12
        assert np.linalg.norm(at(foot, 0.6)[0] - place) <= SPEED * dt + 1e-12  # the foot does not jump
    assert_allclose(foot.target[:2], target, atol=1e-12)
    foot.move_target(target, dt)
    assert not at(foot, 1.0)[1][:2].any()  # arrived: the foot stands still over it


@given(lead=leads, end=places)
def test_ends_at_rest(lead: float, end: Vector) -> None:
    foot = swing(lead=lead, end=end)
    for sigma, place in ((0.0, foot.start), (1.0, end)):
        position, velocity, acceleration = at(foot, sigma)
        assert_allclose(position, place, atol=1e-12)
        assert not velocity.any()
        assert not acceleration.any()


@pytest.mark.parametrize("lead", [0.0, 0.06, 0.3])
def test_rises_to_its_clearance_and_sinks(lead: float) -> None:
    """On level ground: up, over at full height, down; the part before and after the way over is vertical."""
    foot = swing(lead=lead, end=np.array([0.1, 0.05, 0.01]))
    sigmas = np.linspace(0.0, 1.0, 401)
    path = np.array([at(foot, sigma)[0] for sigma in sigmas])
    height, top = path[:, 2] - 0.01, int(np.argmax(path[:, 2]))
    assert height.max() == pytest.approx(SETTINGS.step_height, abs=1e-6)
    assert (np.diff(height[: top + 1]) >= -1e-12).all()
    assert (np.diff(height[top:]) <= 1e-12).all()
    moving = np.abs(path[:, :2] - foot.start[:2]).max(axis=1) > 1e-9
    moving &= np.abs(path[:, :2] - foot.target[:2]).max(axis=1) > 1e-9
    assert sigmas[moving].min() > lead
    assert sigmas[moving].max() < 1.0 - lead
    assert height[moving].min() > (0.3 if lead > 0.2 else 0.0) * SETTINGS.step_height


@given(lead=leads)
def test_share_is_the_horizontal_way(lead: float) -> None:
    foot = swing(lead=lead)
    sigmas = np.linspace(-0.2, 1.2, 57)
    share = foot.step.share(sigmas)
    path = np.array([at(foot, sigma)[0][:2] for sigma in sigmas])
    assert_allclose(path, foot.start[:2] + share[:, None] * (foot.target - foot.start)[:2], atol=1e-12)


def test_a_late_foot_sinks() -> None:
    foot = swing()
    still = at(foot, 1.0, rate=0.0)[0]
    foot.lower(0.004, 0.06)
    position, velocity, _ = at(foot, 1.0, rate=0.0)
    assert_allclose(position - still, [0.0, 0.0, -0.004])
    assert_allclose(velocity, [0.0, 0.0, -0.06])


@given(lead=leads, sigma=st.floats(0.01, 0.99), rate=st.floats(0.2, 3.0))
def test_heading_goes_from_start_to_step_at_its_rate(lead: float, sigma: float, rate: float) -> None:
    h, foot = 1e-5, swing(lead=lead)

    def heading(sigma: float) -> tuple[float, float]:
        foot.sigma = sigma
        return foot.heading(rate)

    assert heading(0.0) == pytest.approx((-0.1, 0.0))
    assert heading(1.0) == pytest.approx((0.4, 0.0))
    difference = heading(sigma + h * rate)[0] - heading(sigma - h * rate)[0]
    assert heading(sigma)[1] == pytest.approx(difference / (2 * h), abs=1e-4)
