"""What a snapshot makes of the foot sensors: against a sum of point forces."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from robots import soles, surena

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
