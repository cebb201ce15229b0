"""The posture's inverse kinematics against forward kinematics of random postures, and where nothing can be reached."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from plain_posture import plain_step
from robots import at, palms, soles, surena

from wbmpc.kinematics import Kinematics
from wbmpc.planner.posture import JOINT_MARGIN, PalmTarget, Posture
from wbmpc.planner.posture_kernel import ELBOW_CLEARANCE
from wbmpc.rotations import level_frame
from wbmpc.signals import Vector

ROBOT = surena()
HOME = ROBOT.home_q
COM_COST = 2.0
SOLES, YAWS, CENTRE = soles(HOME), np.zeros(2), np.zeros(2)
LOWER, UPPER = ROBOT.joint_lower + JOINT_MARGIN, ROBOT.joint_upper - JOINT_MARGIN


def reached(targets: list[Vector | None], iterations: int = 60, normal: Vector | None = None) -> Posture:
    posture = Posture(Kinematics(ROBOT), nominal=HOME, com_cost=COM_COST)
    wanted = [None if target is None else PalmTarget(target, normal) for target in targets]
    posture.iterate(iterations, soles=SOLES, yaws=YAWS, palms=wanted, centre=CENTRE)
    return posture


def standing_posture(seed: int) -> Vector:
    """A random posture that keeps the soles where they are: the joints above the hips move."""
    rng = np.random.default_rng(seed)
    q = HOME.copy()
    legs = np.concatenate(ROBOT.leg_joints)
    above = np.setdiff1d(np.arange(ROBOT.nj), legs)
    middle, half = 0.5 * (LOWER + UPPER), 0.5 * (UPPER - LOWER)
    # around home, within the range: arms through the body would be reachable here and nowhere else
    away = q[7:] + rng.uniform(-0.7, 0.7, ROBOT.nj)
    q[7:][above] = np.clip(away, middle - 0.9 * half, middle + 0.9 * half)[above]
    return q


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_places_of_real_postures_are_reached(seed: int) -> None:
    wanted = palms(standing_posture(seed))
    posture = reached([wanted[0], wanted[1]])
    assert posture.residual < 2e-3  # [m] what the pulls to the middle and to the nominal posture leave
    assert_allclose(palms(posture.q), wanted, atol=2e-3)
    assert_allclose(soles(posture.q), SOLES, atol=1e-3)
    kinematics = at(posture.q)
    for frame in ROBOT.sole_frames:
        assert_allclose(kinematics.rotation(frame), level_frame(0.0), atol=5e-3)


@settings(max_examples=10, deadline=None)
@given(x=st.floats(-0.6, 0.8), y=st.floats(-0.6, 0.6), z=st.floats(0.0, 0.8))
def test_joint_limits_hold_wherever_it_is_asked_to_go(x: float, y: float, z: float) -> None:
    posture = reached([np.array([x, y, z]), None], iterations=30)
    assert (posture.q[7:] >= LOWER - 1e-12).all()
    assert (posture.q[7:] <= UPPER + 1e-12).all()
    assert np.isfinite(posture.residual)
    assert np.linalg.norm(posture.q[3:7]) == pytest.approx(1.0)


def test_residual_and_com_are_those_of_a_fixed_point() -> None:
    """Converged, the numbers handed out are those of `q` itself, from Pinocchio's forward kinematics."""
    target = np.array([0.30, 0.08, 0.25])
    posture = reached([target, None], iterations=100)
    assert posture.residual == pytest.approx(np.linalg.norm(palms(posture.q)[0] - target), abs=1e-4)
    assert_allclose(posture.com, at(posture.q).com, atol=1e-4)


@settings(max_examples=8, deadline=None)
@given(distance=st.floats(0.75, 1.2), side=st.floats(-0.3, 0.3), up=st.floats(0.0, 0.6))
@example(distance=1.0989926020404202, side=-0.2919155655446582, up=0.5453568662446038)  # the soles give way
def test_a_place_beyond_all_links_is_never_called_reachable(distance: float, side: float, up: float) -> None:
    """The residual is the larger of the palm's and the sole's: half of what all links between them cannot bridge."""
    model = ROBOT.pin_model
    frames = [model.frames[frame] for frame in (ROBOT.sole_frames[0], ROBOT.palm_frames[0])]
    joints = {joint for frame in frames for joint in model.supports[frame.parentJoint] if model.parents[joint] > 0}
    links = [frame.placement for frame in frames] + [model.jointPlacements[joint] for joint in joints]
    stretched = sum(np.linalg.norm(link.translation) for link in links)
    direction = np.array([0.8, side, up]) / np.linalg.norm([0.8, side, up])
    target = SOLES[0] + distance * direction
    assert reached([target, None], iterations=80).residual > max((distance - stretched) / 2, 0.05)


def test_unreachable_places_are_told_in_the_order_of_their_distance() -> None:
    near, far, farther = (reached([np.array([x, 0.05, 0.30]), None]).residual for x in (0.40, 0.70, 0.90))
    assert near < 0.003
    assert 0.03 < far < farther


def test_a_free_hand_has_no_residual() -> None:
    assert reached([None, None]).residual < 1e-6


def test_the_posture_shifts_the_com_no_more_than_it_must() -> None:
    """A near place leaves the CoM over the middle, a far one brings it forward: d of the paper depends on it."""
    near, far = reached([np.array([0.15, 0.12, 0.25]), None]), reached([np.array([0.42, 0.05, 0.30]), None])
    assert np.linalg.norm(near.com[:2] - CENTRE) < 0.015
    assert far.com[0] > near.com[0] + 0.03


def test_mirrored_targets_give_mirrored_postures() -> None:
    left = reached([np.array([0.40, 0.06, 0.28]), None])
    right = reached([None, np.array([0.40, -0.06, 0.28])])
    assert_allclose(left.com * [1, -1, 1], right.com, atol=1e-5)
    assert left.residual == pytest.approx(right.residual, abs=1e-6)


@settings(max_examples=8, deadline=None)
@given(x=st.floats(-0.05, 0.12), y=st.floats(0.18, 0.24), z=st.floats(0.20, 0.26))
def test_an_elbow_stays_above_the_surface_its_palm_rests_on(x: float, y: float, z: float) -> None:
    """On a ledge beside the body the nearest posture has the elbow beside the palm, or under it: through the ledge."""
    target = np.array([x, y, z])
    posture = reached([target, None], iterations=100, normal=np.array([0.0, 0.0, 1.0]))
    kinematics = at(posture.q)
    elbow, palm = (kinematics.position(f) for f in (ROBOT.elbow_frames[0], ROBOT.palm_frames[0]))
    short = ELBOW_CLEARANCE - (elbow - palm)[2]
    assert posture.elbow_excess == pytest.approx(max(short, 0.0), abs=1e-4)
    assert short < 0.01
    assert_allclose(palm, target, atol=4e-3)


@settings(max_examples=10, deadline=None)
@given(x=st.floats(-5.0, 5.0), y=st.floats(-5.0, 5.0), yaw=st.floats(-3.0, 3.0))
def test_the_same_task_elsewhere_in_the_world_gets_the_same_posture(x: float, y: float, yaw: float) -> None:
    """Started at the world's origin, however far off, it ended bent double."""
    turn, shift = level_frame(yaw), np.array([x, y, 0.0])
    palm, up = np.array([0.02, -0.21, 0.25]), np.array([0.0, 0.0, 1.0])
    shared = Kinematics(ROBOT)
    here, there = (Posture(shared, nominal=HOME, com_cost=COM_COST) for _ in range(2))
    here.iterate(60, soles=SOLES, yaws=YAWS, palms=[None, PalmTarget(palm, up)], centre=CENTRE)
    there.iterate(
        60,
        soles=SOLES @ turn.T + shift,
        yaws=YAWS + yaw,
        palms=[None, PalmTarget(turn @ palm + shift, up)],
        centre=turn[:2, :2] @ CENTRE + shift[:2],
    )
    assert_allclose(there.q[7:], here.q[7:], atol=1e-4)
    assert_allclose(there.com, turn @ here.com + shift, atol=1e-4)
    assert there.residual == pytest.approx(here.residual, abs=1e-5)
    # What is read of the first one is its own still, although both compute with the same `Kinematics`.
    assert_allclose(np.array(there.forearm(1)), np.array(here.forearm(1)) @ turn.T + shift, atol=1e-4)
    assert_allclose(there.torso, turn @ here.torso, atol=1e-4)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_step_is_that_of_the_plain_form(seed: int) -> None:
    """Palms without a target, in the air or on a surface; far targets push joints to their ends."""
    rng = np.random.default_rng(seed)
    posture = Posture(Kinematics(ROBOT), nominal=HOME, com_cost=COM_COST, tilt_cost=rng.choice([0.0, 0.03]))
    normals = [None, np.array([0.0, 0.0, 1.0])]
    places = palms(HOME) + rng.uniform(-0.4, 0.4, (2, 3))
    wanted = [rng.choice([None, PalmTarget(place, normals[rng.integers(2)])]) for place in places]
    yaws, feet = rng.uniform(-0.3, 0.3, 2), SOLES + rng.uniform(-0.03, 0.03, (2, 3)) * [1.0, 1.0, 0.0]
    centre = feet[:, :2].mean(axis=0)
    told = {"soles": feet, "yaws": yaws, "palms": wanted}
    posture.iterate(1, centre=centre, **told)
    for _ in range(6):
        before = posture.q
        posture.iterate(1, centre=centre, **told)
        step = plain_step(
            before,
            nominal=HOME,
            com=np.array([*centre, at(HOME).com[2]]),
            com_cost=COM_COST,
            tilt_cost=posture.tilt_cost,
            **told,
        )
        expected = ROBOT.integrate(before, step)
        expected[7:] = np.clip(expected[7:], LOWER, UPPER)
        assert_allclose(posture.q, expected, atol=1e-8)
