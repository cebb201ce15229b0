"""A robot at home on a floor, its joints held stiffly until it rests: plain PD servos, nothing of the controller."""

from __future__ import annotations

from pathlib import Path

import mujoco


def settled(path: Path, *, ticks: int, stiffness: float, damping: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """After `ticks` of the model's timestep; gains in N·m/rad and N·m·s/rad, of every joint."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    target = data.qpos[7:].copy()
    for _ in range(ticks):
        data.ctrl[:] = stiffness * (target - data.qpos[7:]) - damping * data.qvel[6:]
        mujoco.mj_step(model, data)
    return model, data
