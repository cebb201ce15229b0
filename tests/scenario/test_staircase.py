"""Steps up to a landing and down again."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from base_scenario import BASE, load
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.scenario import Scenario, build_world, ground_boxes, resolve_ground, robot_path, vary

STAIRS = {"position": [3.0, 1.0], "steps": 3, "rise": 0.03, "depth": 0.2, "landing": 0.5, "width": 0.6}


def scenario_of(tmp_path, **changes) -> Scenario:
    return vary(load(tmp_path, BASE), {"world.staircase": STAIRS | changes})


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(yaw=st.floats(-3.0, 3.0), steps=st.integers(1, 5), down=st.booleans())
def test_a_ray_from_above_meets_one_step_after_the_other(tmp_path, yaw: float, steps: int, down: bool) -> None:
    scenario = scenario_of(tmp_path, yaw=yaw, steps=steps, down=down)
    model = build_world(scenario, robot_path(scenario))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    length = 0.2 * (steps - 1) * (2 if down else 1) + 0.5
    along = np.array([np.cos(yaw), np.sin(yaw)])
    for way in np.arange(-0.05, length + 0.1, 0.1):  # [m] from the first edge
        above = np.array([*(np.array(STAIRS["position"]) + way * along), 1.0])
        geom = np.array([-1], dtype=np.int32)
        height = 1.0 - mujoco.mj_ray(model, data, above, np.array([0.0, 0.0, -1.0]), None, 1, -1, geom)
        up = int(np.floor(way / 0.2)) + 1
        from_end = int(np.floor((length - way) / 0.2)) + 1 if down else steps
        level = 0 if not 0.0 < way < length else min(up, steps, from_end)
        assert height == pytest.approx(0.03 * level, abs=1e-9)


def test_the_planner_knows_the_treads(tmp_path) -> None:
    scenario = scenario_of(tmp_path)
    treads = resolve_ground(scenario)
    assert [tread.top for tread in treads] == pytest.approx([0.03, 0.06, 0.09, 0.06, 0.03])
    assert list(ground_boxes(scenario)) == [f"tread_{k}" for k in range(5)]
    starts = [tread.corners[:, 0].min() for tread in treads]
    assert_allclose(starts, [3.0, 3.2, 3.4, 3.9, 4.1])
