"""Facts of the plant against MuJoCo's own geometry."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from wbmpc.facts import facts_of
from wbmpc.robot import Robot
from wbmpc.scenario import build_world, load_scenario, resolve_patches, robot_path

SCENARIO = """
name: facts
duration: 3.0
world:
  objects:
    table: {kind: box, size: [0.2, 0.6, 0.2], position: [0.3, 0.0]}
    stair: {kind: box, size: [0.2, 0.6, 0.02], position: [-0.5, 0.0], walkable: true}
    ghost: {kind: box, size: [0.2, 0.6, 0.2], position: [0.3, 1.0], present: false}
  tiles: {position: [-2.0, 0.0], count: [2, 1], size: [0.2, 0.2], lowest: 0.01, highest: 0.02}
patches:
  on_table: {on: table}
  on_ghost: {on: ghost, face: left, force_cap: 7.0}
tasks:
  - {kind: reach, target: [0.4, 0.0, 0.3], arrive_by: 1.0, hold: 0.1, withdraw: 0.2}
  - {kind: step, foot: right, target: [0.1, -0.05], start: 1.0, duration: 0.5}
  - {kind: step, foot: left, target: [0.1, 0.05], start: 0.2, duration: 0.5}
  - {kind: go, target: [0.5, 0.1], start: 1.5}
plant: {mass_scale: 1.1}
checks: [{kind: withdrawn}]
"""


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    path: Path = tmp_path_factory.mktemp("facts") / "facts.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    scenario = load_scenario(path)
    robot, model = Robot.load(robot_path(scenario)), build_world(scenario, robot_path(scenario))
    return robot, model, facts_of(model, robot, scenario, resolve_patches(scenario))


def test_every_geom_has_one_role(plant) -> None:  # type: ignore[no-untyped-def]
    _, model, facts = plant
    names = np.array(facts.geom_name)
    assert set(names[~facts.geom_is_robot]) == {"floor", "table", "stair", "tile_0_0", "tile_1_0"}
    assert names[facts.geom_palm == 0].tolist() == ["left_palm_geom"]
    assert names[facts.geom_palm == 1].tolist() == ["right_palm_geom"]
    assert "left_foot" in names[facts.geom_foot == 0]
    assert "right_foot" in names[facts.geom_foot == 1]
    assert not ((facts.geom_foot >= 0) & (facts.geom_palm >= 0)).any()
    assert facts.geom_is_robot[(facts.geom_foot >= 0) | (facts.geom_palm >= 0)].all()
    assert facts.patch_geoms == {"on_table": frozenset({model.geom("table").id}), "on_ghost": frozenset()}
    np.testing.assert_allclose(facts.patch_normal["on_ghost"], [0, 1, 0])
    assert facts.patch_force_cap == {"on_table": 15.0, "on_ghost": 7.0}
    assert set(names[facts.geom_walkable]) == {"floor", "stair", "tile_0_0", "tile_1_0"}


def test_mass_limits_and_targets(plant) -> None:  # type: ignore[no-untyped-def]
    robot, _, facts = plant
    assert facts.mass == pytest.approx(1.1 * robot.mass)  # the true one, which the controller does not know
    assert (facts.duration, facts.timestep) == (3.0, 0.001)
    np.testing.assert_array_equal(facts.reach_targets, [[0.4, 0.0, 0.3]])
    assert [side for side, _ in facts.step_targets] == [0, 1]  # in the order of time, not of the file
    np.testing.assert_array_equal([target for _, target in facts.step_targets], [[0.1, 0.05], [0.1, -0.05]])
    np.testing.assert_array_equal(facts.go_targets, [[0.5, 0.1]])
    assert facts.stall_torque.shape == facts.no_load_speed.shape == (len(facts.joint_name),)


def test_sole_corners_are_the_lower_corners_of_the_foot_boxes(plant) -> None:  # type: ignore[no-untyped-def]
    robot, model, facts = plant
    rng = np.random.default_rng(0)
    data = mujoco.MjData(model)
    for _ in range(5):
        data.qpos[:] = model.qpos0
        data.qpos[:3] = rng.normal(size=3)
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        data.qpos[7 : robot.nq] = rng.uniform(robot.joint_lower, robot.joint_upper)
        mujoco.mj_forward(model, data)
        corners = facts.sole_vertices(data.qpos)
        for side, name in enumerate(("left_foot", "right_foot")):
            box, size = data.geom(name), model.geom(name).size
            forward = box.xmat.reshape(3, 3)[:, 0]
            assert (corners[side, :2] @ forward).min() > (corners[side, 2:] @ forward).max()  # front ones first
            signs = np.array([[x, y, -1] for x in (-1, 1) for y in (-1, 1)])
            expected = box.xpos + (signs * size) @ box.xmat.reshape(3, 3).T
            np.testing.assert_allclose(
                sorted(map(tuple, corners[side].round(9))), sorted(map(tuple, expected.round(9))), atol=1e-8
            )
