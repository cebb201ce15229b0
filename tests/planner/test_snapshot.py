"""What a snapshot makes of the foot sensors: against a sum of point forces."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from robots import soles, surena

from wbmpc.kinematics import Kinematics
from wbmpc.planner.snapshot import Snapshot
from wbmpc.signals import RobotState

ROBOT = surena()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_feets_pressure_is_the_centre_of_their_point_forces(seed: int) -> None:
    """Vertical forces at random points of both soles; each sole reports their sum and their moment about its centre."""
    rng = np.random.default_rng(seed)
    centres, half = soles(ROBOT.home_q), ROBOT.sole_half_extents
    points = centres[:, None] + np.concatenate([rng.uniform(-half, half, (2, 4, 2)), np.zeros((2, 4, 1))], axis=2)
    forces = np.concatenate([np.zeros((2, 4, 2)), rng.uniform(0.5, 5.0, (2, 4, 1))], axis=2)
    moments = np.cross(points - centres[:, None], forces).sum(axis=1)
    snapshot = Snapshot(ROBOT, ROBOT.home_q)
    snapshot.update(
        RobotState(
            time=0.0,
            q=ROBOT.home_q,
            v=np.zeros(ROBOT.nv),
            sole_wrench_in_world=np.concatenate([forces.sum(axis=1), moments], axis=1),
            palm_force_in_world=np.zeros((2, 3)),
            mass_scale=1.0,
        )
    )
    loads = forces[:, :, 2].ravel()
    assert_allclose(snapshot.feet_zmp, loads @ points.reshape(-1, 3)[:, :2] / loads.sum(), atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_places_and_velocities_are_those_of_the_kinematics(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, v = ROBOT.integrate(ROBOT.home_q, 0.3 * rng.normal(size=ROBOT.nv)), rng.normal(size=ROBOT.nv)
    kinematics, snapshot = Kinematics(ROBOT), Snapshot(ROBOT, ROBOT.home_q)
    kinematics.update(q, v)
    snapshot.update(
        RobotState(
            time=0.0,
            q=q,
            v=v,
            sole_wrench_in_world=np.zeros((2, 6)),
            palm_force_in_world=np.zeros((2, 3)),
            mass_scale=1.0,
        )
    )
    for places, frames in (
        (snapshot.palms, ROBOT.palm_frames),
        (snapshot.elbows, ROBOT.elbow_frames),
        (snapshot.soles, ROBOT.sole_frames),
        (snapshot.leg_links[::2, 0], [leg[0] for leg in ROBOT.leg_frames]),
        (snapshot.leg_links[::2, 1], [leg[1] for leg in ROBOT.leg_frames]),
        (snapshot.leg_links[1::2, 0], [leg[1] for leg in ROBOT.leg_frames]),
        (snapshot.leg_links[1::2, 1], [leg[2] for leg in ROBOT.leg_frames]),
    ):
        assert_allclose(places, [kinematics.position(frame) for frame in frames], atol=1e-12)
    assert_allclose(snapshot.com, kinematics.com, atol=1e-12)
    assert_allclose(snapshot.com_velocity, kinematics.com_velocity, atol=1e-9)
    assert_allclose(snapshot.palm_velocities, [kinematics.velocity(f)[:3] for f in ROBOT.palm_frames], atol=1e-9)
    start = Kinematics(ROBOT)
    start.update_kinematics(ROBOT.home_q)
    seen, first = (k.rotation(ROBOT.torso_frame).T for k in (kinematics, start))
    torso, home = (k.position(ROBOT.torso_frame) for k in (kinematics, start))
    palms = np.array([start.position(frame) for frame in ROBOT.palm_frames])
    assert_allclose((snapshot.palm_homes - torso) @ seen.T, (palms - home) @ first.T, atol=1e-12)
