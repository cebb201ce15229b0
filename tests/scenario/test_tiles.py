"""Ground of random heights: what the planner is told of it, and what the robot really walks on."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from base_scenario import ROBOT, edited, load
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from wbmpc.errors import ScenarioError
from wbmpc.scenario import (
    Scenario,
    all_boxes,
    build_world,
    ground_boxes,
    resolve_ground,
    resolve_obstacles,
    robot_path,
    vary,
)

LOWEST, HIGHEST, ERROR = 0.01, 0.03, 0.004  # [m]
FIELD = {"position": [1.0, -0.1], "count": [4, 3], "size": [0.2, 0.15], "lowest": LOWEST, "highest": HIGHEST}
STEP = "step: {kind: box, size: [0.2, 0.4, 0.05], position: [-1.0, 0.0], bottom: 0.1, yaw: 0.3, walkable: true}"
TABLE = "table: {kind: box, size: [0.2, 0.6, 0.2]"

shared = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
seeds = st.integers(0, 2**63 - 1)


def scenario_of(tmp_path, **changes) -> Scenario:
    """A walkable step on the one side, the tiles on the other, a table that is no ground."""
    scenario = load(tmp_path, edited(TABLE, f"{STEP}\n    {TABLE}"))
    return vary(scenario, {"world.tiles": FIELD} | {key.replace("__", "."): value for key, value in changes.items()})


def model_of(scenario: Scenario) -> mujoco.MjModel:
    return build_world(scenario, robot_path(scenario))


def tops_of(scenario: Scenario) -> dict[str, float]:
    """Heights [m] that the planner is told, by name."""
    return {name: box.bottom + box.size[2] for name, box in ground_boxes(scenario).items()}


@shared
@given(seed=seeds, columns=st.integers(1, 7), rows=st.integers(1, 7), low=st.floats(1e-3, 0.09), more=st.floats(0, 0.1))
def test_heights_are_within_their_bounds_and_the_seeds_own(tmp_path, seed, columns, rows, low, more) -> None:
    field = FIELD | {"count": [columns, rows], "lowest": low, "highest": low + more}
    scenario = scenario_of(tmp_path, seed=seed, world__tiles=field)
    tops = tops_of(scenario)
    assert len(tops) == columns * rows + 1
    assert all(low <= top <= low + more for name, top in tops.items() if name != "step")
    assert tops == tops_of(vary(scenario, {"sensors.noise_scale": 1.0, "plant.ground_error": low / 2}))
    if more > 1e-6:
        assert tops != tops_of(vary(scenario, {"seed": seed ^ 1}))


def test_heights_are_spread_evenly_and_neighbours_look_different(tmp_path) -> None:
    boxes = all_boxes(scenario_of(tmp_path, world__tiles=FIELD | {"count": [50, 50]}))
    tiles = [box for name, box in boxes.items() if name.startswith("tile")]
    tops = np.array([box.size[2] for box in tiles])
    shares, _ = np.histogram(tops, bins=5, range=(LOWEST, HIGHEST))
    assert_allclose(shares / tops.size, 0.2, atol=0.04)
    brightness = np.array([sum(box.color[:3]) for box in tiles])
    assert np.corrcoef(tops, brightness)[0, 1] == pytest.approx(1.0)
    assert np.ptp(brightness) > 0.5


def test_the_field_is_laid_out_around_its_centre(tmp_path) -> None:
    boxes = all_boxes(scenario_of(tmp_path))
    assert_allclose(boxes["tile_0_0"].position, [0.7, -0.25])
    assert_allclose(boxes["tile_3_0"].position, [1.3, -0.25])
    assert_allclose(boxes["tile_0_2"].position, [0.7, 0.05])
    assert list(boxes)[:3] == ["step", "table", "tile_0_0"]
    assert {box.size[:2] for name, box in boxes.items() if name.startswith("tile")} == {(0.2, 0.15)}


def test_without_tiles_and_error_the_world_is_what_was_declared(tmp_path) -> None:
    """Neither key changes a run that does not use it: the very same numbers."""
    scenario = scenario_of(tmp_path, world__tiles=None)
    assert all_boxes(scenario) == scenario.world.objects
    model = model_of(scenario)
    for name, box in scenario.world.objects.items():
        assert_array_equal(model.geom(name).pos, box.centre)
        assert_array_equal(model.geom(name).size, np.array(box.size) / 2)


@shared
@given(seed=seeds, error=st.sampled_from([0.0, ERROR]))
def test_the_plant_has_the_error_and_the_planner_the_nominal_heights(tmp_path, seed, error) -> None:
    scenario = scenario_of(tmp_path, seed=seed, plant__ground_error=error)
    told, ground, model = tops_of(scenario), resolve_ground(scenario), model_of(scenario)
    assert [tread.top for tread in ground] == list(told.values())
    assert len(resolve_obstacles(scenario)) == 1  # the table
    errors = []
    for (name, box), tread in zip(ground_boxes(scenario).items(), ground, strict=True):
        geom = model.geom(name)
        assert geom.pos[2] - geom.size[2] == pytest.approx(box.bottom, abs=1e-12)
        assert_allclose(tread.corners.mean(axis=0), geom.pos[:2], atol=1e-12)
        assert_array_equal(geom.size[:2], np.array(box.size[:2]) / 2)
        errors.append(geom.pos[2] + geom.size[2] - told[name])
    assert np.abs(errors).max() <= error + 1e-12
    assert (np.abs(errors).max() > 0.5 * error) or not error
    assert_array_equal(model.geom("table").size, [0.1, 0.3, 0.1])
    again = model_of(scenario)
    assert_array_equal(again.geom_size, model.geom_size)
    assert_array_equal(again.geom_pos, model.geom_pos)


def test_errors_are_not_the_heights_over_again(tmp_path) -> None:
    scenario = scenario_of(tmp_path, world__tiles=FIELD | {"count": [30, 30]}, plant__ground_error=ERROR)
    model, told = model_of(scenario), tops_of(scenario)
    errors = np.array([2 * model.geom(name).size[2] for name in told if name != "step"]) - list(told.values())[1:]
    assert abs(errors.mean()) < 0.1 * ERROR
    assert abs(np.corrcoef(errors, list(told.values())[1:])[0, 1]) < 0.1
    assert np.abs(errors).max() > 0.98 * ERROR


def test_a_ray_from_above_meets_the_real_top(tmp_path) -> None:
    scenario = scenario_of(tmp_path, plant__ground_error=ERROR)
    model = model_of(scenario)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    differences = []
    for name, box in ground_boxes(scenario).items():
        geom = np.array([-1], dtype=np.int32)
        start = np.array([*box.position, 1.0])
        distance = mujoco.mj_ray(model, data, start, np.array([0.0, 0.0, -1.0]), None, 1, -1, geom)
        assert model.geom(int(geom[0])).name == name
        real = model.geom(name).pos[2] + model.geom(name).size[2]
        assert 1.0 - distance == pytest.approx(real, abs=1e-9)
        differences.append(1.0 - distance - (box.bottom + box.size[2]))
    assert 0.001 < np.abs(differences).max() <= ERROR + 1e-9


def test_a_robot_comes_to_rest_on_the_real_top(tmp_path) -> None:
    """The tiny robot's foot, 12 cm high and 10 cm long, is put down on one tile and stays there."""
    scenario = scenario_of(tmp_path, world__tiles=FIELD | {"position": [0.0, 0.0], "count": [1, 1]})
    scenario = vary(scenario, {"plant.ground_error": ERROR})
    model = model_of(scenario)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    top = 2 * model.geom("tile_0_0").size[2]
    data.qpos[2] += top + 0.002
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.ncon > 0
    assert {model.geom(int(geom)).name for contact in data.contact for geom in contact.geom} == {"foot", "tile_0_0"}
    assert data.geom("foot").xpos[2] - 0.06 == pytest.approx(top, abs=5e-4)


def test_an_absent_tread_leaves_the_errors_of_the_others(tmp_path) -> None:
    scenario = scenario_of(tmp_path, plant__ground_error=ERROR)
    whole, without = model_of(scenario), model_of(vary(scenario, {"world.objects.step.present": False}))
    assert without.ngeom == whole.ngeom - 1
    for name in ("tile_0_0", "tile_3_2"):
        assert_array_equal(whole.geom(name).size, without.geom(name).size)


def test_a_robot_that_has_a_geom_called_like_a_tile_is_one_line(tmp_path) -> None:
    scenario = scenario_of(tmp_path)
    (tmp_path / "tiled.xml").write_text(ROBOT.replace('name="forearm"', 'name="tile_1_2"'))
    with pytest.raises(ScenarioError) as raised:
        vary(scenario, {"robot": "tiled.xml"})
    assert str(raised.value) == "--set robot: world.tiles: the robot has a geom called 'tile_1_2'"


def test_a_scenario_is_valid_with_every_seed_or_with_none(tmp_path) -> None:
    with pytest.raises(ScenarioError, match=r"the lowest tile, 0\.01 m"):
        scenario_of(tmp_path, plant__ground_error=LOWEST)
    scenario_of(tmp_path, plant__ground_error=0.99 * LOWEST)
