"""The steps called under the interpreter's lock are MuJoCo's own, bit for bit."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from short_run import ROBOT, stand

from wbmpc.physics import Physics
from wbmpc.scenario import build_world, robot_path


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    scenario = stand()
    return build_world(scenario, robot_path(scenario))


def fallen_in(model: mujoco.MjModel) -> mujoco.MjData:
    """A robot that meets the floor, moving and turning."""
    data = mujoco.MjData(model)
    data.qpos[:] = ROBOT.qpos_from_q(ROBOT.home_q)
    data.qvel[:] = np.random.default_rng(3).normal(size=model.nv)
    return data


def test_steps_are_mujocos_bit_for_bit(model: mujoco.MjModel) -> None:
    ours, plain = fallen_in(model), fallen_in(model)
    physics, torque = Physics(model, ours), np.random.default_rng(5)
    contacts = 0
    for _ in range(200):
        physics.step1()
        physics.subtree_velocity()
        mujoco.mj_step1(model, plain)
        mujoco.mj_subtreeVel(model, plain)
        ours.ctrl[:] = plain.ctrl[:] = torque.normal(size=model.nu)
        physics.step2()
        mujoco.mj_step2(model, plain)
        for name in ("qpos", "qvel", "qacc", "qfrc_constraint", "sensordata", "subtree_linvel", "subtree_angmom"):
            assert np.array_equal(getattr(ours, name), getattr(plain, name)), name
        assert ours.ncon == plain.ncon
        contacts += ours.ncon
    assert contacts > 0  # contacts were among what was compared


def test_model_and_data_live_as_long_as_their_steps() -> None:
    scenario = stand()

    def steps() -> Physics:
        model = build_world(scenario, robot_path(scenario))
        return Physics(model, mujoco.MjData(model))

    physics = steps()
    for _ in range(50):  # freed memory would have been handed out again
        mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))
    physics.step1()
    physics.step2()
    assert physics._objects[1].time == pytest.approx(physics._objects[0].opt.timestep)
