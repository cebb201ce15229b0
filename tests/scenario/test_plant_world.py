"""The MuJoCo model of a scenario: what the YAML says is what the physics does."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from base_scenario import edited, load, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wbmpc.errors import RobotError
from wbmpc.scenario import (
    build_world,
    load_scenario,
    resolve_loads,
    resolve_obstacles,
    resolve_patches,
    robot_path,
    vary,
)


def model_of(scenario):
    return build_world(scenario, robot_path(scenario))


def friction_of_contacts(model):
    """Sliding friction of the real contacts between the robot's foot and the floor."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2] -= 0.001
    mujoco.mj_forward(model, data)
    assert data.ncon >= 4
    return {float(friction) for contact in data.contact for friction in contact.friction[:2]}


def test_contact_friction_is_the_floors_whatever_the_robot_declares(tmp_path):
    scenario = load(tmp_path)  # the robot's own geom has friction 3
    assert friction_of_contacts(model_of(scenario)) == {0.7}
    assert friction_of_contacts(model_of(vary(scenario, {"plant.friction": 0.4}))) == {0.4}


@pytest.mark.parametrize(("friction", "slides"), [(0.3, True), (0.7, False)])
def test_friction_holds_a_body_as_coulomb_says(tmp_path, friction, slides):
    """Pushed with 0.5 of its weight, a body slides exactly when μ < 0.5."""
    scenario = vary(load(tmp_path), {"plant.friction": friction})
    model = model_of(scenario)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    torso = model.body("torso").id
    data.xfrc_applied[torso, 0] = 0.5 * model.body_subtreemass[torso] * 9.81
    data.xfrc_applied[torso, 4] = -data.xfrc_applied[torso, 0] * 0.06  # acts at the sole: no tipping
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert (abs(data.qpos[0]) > 0.1) == slides


def test_masses_are_scaled_with_their_inertias(tmp_path):
    scenario = load(tmp_path)
    plain = model_of(scenario)
    scaled = model_of(vary(scenario, {"plant.mass_scale": 1.1, "plant.body_mass_scale.arm": 2.0}))
    torso, arm = plain.body("torso").id, plain.body("arm").id
    factors = np.array([1.0, 1.1, 2.2])
    assert [torso, arm] == [1, 2]
    np.testing.assert_allclose(scaled.body_mass, plain.body_mass * factors, rtol=1e-14)
    np.testing.assert_allclose(scaled.body_inertia, plain.body_inertia * factors[:, None], rtol=1e-14)
    assert scaled.body_subtreemass[0] == pytest.approx(2 * 1.1 + 0.5 * 2.2)
    data = mujoco.MjData(scaled)
    mujoco.mj_resetDataKeyframe(scaled, data, 0)
    for _ in range(2000):
        mujoco.mj_step(scaled, data)
    weight = sum(_normal_force(scaled, data, index) for index in range(data.ncon))
    assert weight == pytest.approx((2 * 1.1 + 0.5 * 2.2) * 9.81, rel=1e-3)


def _normal_force(model, data, index):
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, index, force)
    return force[0]


def test_geoms_options_and_absent_objects(tmp_path):
    scenario = vary(load(tmp_path), {"world.objects.table.yaw": 0.5, "loop.physics_rate": 500})
    model = model_of(scenario)
    assert model.opt.timestep == 1 / 500
    assert model.geom("floor").type == mujoco.mjtGeom.mjGEOM_PLANE
    table = model.geom("table")
    np.testing.assert_allclose(table.size, [0.1, 0.3, 0.1])
    np.testing.assert_allclose(table.pos, [0.3, 0.0, 0.1])
    np.testing.assert_allclose(table.quat, [math.cos(0.25), 0, 0, math.sin(0.25)])
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (1280, 960)
    absent = vary(scenario, {"world.objects.table.present": False})
    assert "table" not in [model_of(absent).geom(i).name for i in range(model_of(absent).ngeom)]
    assert [patch.object for patch in resolve_patches(absent)] == ["table"]


def test_an_object_with_a_mass_is_free_and_the_robot_is_placed_as_before(tmp_path):
    """It falls, comes to rest and weighs what is said, times what the plant makes of it; the robot's mass does not."""
    crate = "crate: {kind: box, size: [0.1, 0.1, 0.2], position: [0.5, 0.4], bottom: 0.02, mass: 0.3}"
    scenario = load(tmp_path, edited("    table: {", f"    {crate}\n    table: {{"))
    scenario = vary(scenario, {"plant.mass_scale": 1.1, "plant.body_mass_scale": {"crate": 1.5}})
    model = model_of(scenario)
    assert model.body("crate").mass == pytest.approx(0.45)
    inertia = 0.45 / 12 * np.array([0.1**2 + 0.2**2, 0.1**2 + 0.2**2, 2 * 0.1**2])
    np.testing.assert_allclose(np.sort(model.body("crate").inertia), np.sort(inertia), rtol=1e-9)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    np.testing.assert_allclose(data.qpos[:8], [0, 0, 0.06, 1, 0, 0, 0, 0])
    np.testing.assert_allclose(data.qpos[8:], [0.5, 0.4, 0.12, 1, 0, 0, 0])
    for _ in range(2000):
        mujoco.mj_step(model, data)
    crate = model.geom("crate").id
    weight = sum(_normal_force(model, data, i) for i in range(data.ncon) if crate in data.contact[i].geom)
    assert weight == pytest.approx(0.45 * 9.81, rel=1e-3)
    assert data.body("crate").xpos[2] == pytest.approx(0.1, abs=1e-3)


def test_what_is_to_be_lifted_is_no_obstacle_and_an_absent_load_is_believed_in(tmp_path):
    crate = "crate: {kind: box, size: [0.1, 0.2, 0.3], position: [0.2, 0.1], yaw: 0.2, mass: 0.4, present: false}"
    lift = "{kind: lift, object: crate, height: 0.1, start: 8.5, reach_time: 1.0, raise_time: 1.0}"
    text = edited("disturbances:", f"  - {lift}\ndisturbances:").replace("    table: {", f"    {crate}\n    table: {{")
    scenario = load(tmp_path, text)
    assert len(resolve_obstacles(scenario)) == 1
    (load_,) = resolve_loads(scenario)
    np.testing.assert_allclose(load_.centre, [0.2, 0.1, 0.15])
    np.testing.assert_allclose(load_.half, [0.05, 0.1, 0.15])
    assert (load_.yaw, load_.mass) == (0.2, 0.4)
    assert model_of(scenario).nq == 8


def test_robot_touches_objects(tmp_path):
    model = model_of(vary(load(tmp_path), {"world.objects.table.position": [0.1, 0.0]}))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    pairs = {frozenset(model.geom(int(geom)).name for geom in contact.geom) for contact in data.contact}
    assert frozenset({"foot", "table"}) in pairs


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    face=st.sampled_from(["top", "bottom", "front", "back", "left", "right"]),
    yaw=st.floats(-3, 3),
    bottom=st.floats(0.0, 0.4),
    size=st.tuples(*[st.floats(0.05, 0.5)] * 3),
    where=st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
)
def test_patches_lie_on_the_surface_that_mujoco_has(tmp_path, face, yaw, bottom, size, where):
    """A ray shot against the normal from outside meets the object's geom at the patch, and its normal."""
    axes = {"top": (0, 1), "bottom": (0, 1), "front": (1, 2), "back": (1, 2), "left": (0, 2), "right": (0, 2)}[face]
    table = {"yaw": yaw, "bottom": bottom, "size": list(size), "position": [0.7, -0.2]}
    offset = [where[i] * size[axis] / 2 for i, axis in enumerate(axes)]
    scenario = vary(
        load(tmp_path),
        {f"world.objects.table.{key}": value for key, value in table.items()}
        | {"patches.right.face": face, "patches.right.offset": offset},
    )
    (patch,) = resolve_patches(scenario)
    model = model_of(scenario)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom = np.array([-1], dtype=np.int32)
    normal = np.zeros(3)
    flags = None if face != "bottom" else _hide_floor(model)
    distance = mujoco.mj_ray(
        model, data, patch.position + 0.02 * patch.normal, -patch.normal, flags, 1, -1, geom, normal
    )
    assert model.geom(int(geom[0])).name == patch.object
    assert distance == pytest.approx(0.02, abs=1e-6)  # [m] MuJoCo takes a geom turned by < 1e-6 rad for not turned
    np.testing.assert_allclose(normal, patch.normal, atol=2e-6)
    local = data.geom("table").xmat.reshape(3, 3).T @ (patch.position - data.geom("table").xpos)
    np.testing.assert_allclose(local[list(axes)], offset, atol=1e-6)


def _hide_floor(model):
    """Ray groups without the floor's, which may lie between the bottom face and the ray's start."""
    model.geom("floor").group = 5
    return np.array([1, 1, 1, 1, 1, 0], dtype=np.uint8)


def test_a_higher_table_takes_its_patches_with_it(tmp_path):
    scenario = load(tmp_path)
    (before,) = resolve_patches(scenario)
    (after,) = resolve_patches(vary(scenario, {"world.objects.table.size.2": 0.24}))
    np.testing.assert_allclose(before.position, [0.34, -0.1, 0.2])
    np.testing.assert_allclose(after.position, [0.34, -0.1, 0.24])
    assert (after.name, after.object, after.friction, after.force_cap) == ("right", "table", 0.4, 12.0)
    with pytest.raises(ValueError, match="read-only"):
        after.position[0] = 0.0


def test_a_model_that_mujoco_refuses_is_one_line(tmp_path):
    scenario = load_scenario(write(tmp_path))
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody><body><geom type='box' size='-1 0 0'/>\n</body></worldbody></mujoco>")
    with pytest.raises(RobotError) as raised:
        build_world(scenario, broken)
    assert str(raised.value).startswith("broken.xml: MuJoCo refuses the model: ")
    assert "\n" not in str(raised.value)
