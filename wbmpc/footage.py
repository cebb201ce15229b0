"""What a picture of a run is made of: the compiled model and, for each sample, pose, contacts and support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.errors import WbmpcError
from wbmpc.recorder import Recorder

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Footage:
    """Samples of one run, n of them, in order of time."""

    model: Any  # compiled MjModel of robot and world
    time: FloatArray  # (n,) [s]
    qpos: FloatArray  # (n, nq)
    com: FloatArray  # (n, 3) [m]
    contact_position: Sequence[FloatArray]  # n times (c, 3) [m] in world
    contact_force: Sequence[FloatArray]  # n times (c, 3) [N] in world, on the robot
    support_polygon: Sequence[FloatArray]  # n times (k, 3) [m], as the planner saw it; (0, 3) before the first plan

    def index(self, time: float) -> int:
        """Sample nearest to `time` [s].

        Raises:
            WbmpcError: there is no sample, or `time` is outside the run.
        """
        if not len(self.time):
            raise WbmpcError("the run has no samples to draw")
        first, last = float(self.time[0]), float(self.time[-1])
        spacing = (last - first) / max(1, len(self.time) - 1)
        if not first - spacing <= time <= last + spacing:
            raise WbmpcError(f"no sample at {time:g} s: the run goes from {first:g} to {last:g} s")
        return int(np.abs(self.time - time).argmin())

    @classmethod
    def from_recorder(cls, model: Any, recorder: Recorder, *, stride: int = 1) -> Footage:
        """Every `stride`-th tick of a run that is still in memory."""
        ticks = np.arange(0, recorder.ticks, stride)
        contacts = recorder.contacts_of(ticks)
        split = np.cumsum(recorder.contact_count[ticks])[:-1]
        time, plans = recorder.time[ticks], recorder.plans
        ground = recorder.sole_position[ticks, :, 2].min(axis=1)
        latest = np.searchsorted([plan.time for plan in plans], time, side="right") - 1
        return cls(
            model=model,
            time=time,
            qpos=recorder.qpos[ticks],
            com=recorder.com[ticks],
            contact_position=np.split(contacts.position, split),
            contact_force=np.split(contacts.force, split),
            support_polygon=[
                on_ground(plans[k].support_polygon, height) if k >= 0 else np.zeros((0, 3))
                for k, height in zip(latest, ground, strict=True)
            ],
        )


def on_ground(points: FloatArray, height: float | FloatArray) -> FloatArray:
    """(k, 2) -> (k, 3) [m] at `height`, one or (k,): just above the floor, or floor and drawing flicker."""
    return np.column_stack([points, np.full(len(points), height) + 1e-3])


def site_poses(model: Any, qpos: FloatArray, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Positions (n, s, 3) [m] and rotations (n, s, 3, 3) of named sites in world, in the postures `qpos` (n, nq)."""
    import mujoco  # not with this file: render.py, which reads it, must choose an OpenGL before

    data = mujoco.MjData(model)
    sites = [model.site(name).id for name in names]
    position, rotation = np.empty((len(qpos), len(sites), 3)), np.empty((len(qpos), len(sites), 3, 3))
    for row, posture in enumerate(qpos):
        data.qpos[: posture.size] = posture
        mujoco.mj_kinematics(model, data)
        position[row], rotation[row] = data.site_xpos[sites], data.site_xmat[sites].reshape(-1, 3, 3)
    return position, rotation
