"""Momentum as drawn against the forces that made it change; planned values at the time that they speak of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import short_run
import small_run
from numpy.testing import assert_allclose
from test_rerun_sink import open_sink

from wbmpc.rerun_sink.momentum import MomentumRate
from wbmpc.rerun_sink.reading import Recording
from wbmpc.signals import GRAVITY, Truth

TICKS, WINDOW = 240, 40
MOMENTUM = ("com_velocity", "angular_momentum")  # of `Truth`


def fall(velocity: float) -> tuple[MomentumRate, list[Truth], float]:
    """A robot without torque that is dropped from 1 cm with a twist: it lands, tips and collapses."""
    scenario = short_run.stand()
    rates = np.zeros(short_run.ROBOT.nv)
    rates[:6] = [0.3, -0.2, 0.0, velocity, 2.0 * velocity, 0.5]
    plant = short_run.new_plant(scenario, height=0.01, velocity=rates)
    truths = [plant.step(np.zeros(short_run.ROBOT.nj)) for _ in range(TICKS)]
    return MomentumRate(plant.model), truths, float(plant.model.body_subtreemass[plant.model.jnt_bodyid[0]])


@pytest.mark.parametrize("velocity", [0.0, 0.6])
def test_momentum_changes_by_the_contacts_and_gravity(velocity: float) -> None:
    """Newton and Euler over windows of 40 ms: the forces of a tick act until the next."""
    momentum, truths, mass = fall(velocity)
    robot = short_run.new_plant(short_run.stand())._is_robot
    time = np.array([t.time for t in truths])
    middle, rate = momentum.between(time, *(np.array([getattr(t, name) for t in truths]) for name in MOMENTUM))
    assert_allclose(middle, time[:-1] + 0.5e-3)
    wrench = np.zeros((TICKS, 6))
    for row, truth in zip(wrench, truths, strict=True):
        contacts = truth.contacts[~robot[truth.contacts["geoms"]].all(axis=1)]  # the robot's own sum to nothing
        force, arm = contacts["force"], contacts["position"] - truth.com
        row[:3], row[3:] = force.sum(axis=0), np.cross(arm, force).sum(axis=0)
        row[2] -= mass * GRAVITY
    assert np.abs(wrench[:, 3:]).max() > 0.5  # [N m] there is something to compare
    means = [np.array([values[k : k + WINDOW].mean(axis=0) for k in range(0, TICKS - 2 * WINDOW, 7)])
             for values in (rate, wrench)]  # fmt: skip
    assert_allclose(means[0][:, :3], means[1][:, :3], atol=0.02 * mass * GRAVITY)
    assert_allclose(means[0][:, 3:], means[1][:, 3:], atol=0.02 * mass * GRAVITY * 0.1)


def test_blocks_join_without_a_gap() -> None:
    momentum, truths, _ = fall(0.6)
    again, _, _ = fall(0.6)
    samples = [np.array([getattr(t, name) for t in truths]) for name in ("time", *MOMENTUM)]
    whole = momentum.between(*samples)
    parts = [again.between(*(values[a:b] for values in samples)) for a, b in ((0, 1), (1, 1), (1, 30), (30, TICKS))]
    for i in range(2):
        assert_allclose(np.concatenate([part[i] for part in parts]), whole[i])


def test_plans_speak_of_their_first_knot(tmp_path: Path) -> None:
    recorder = small_run.new_recorder()
    with open_sink(tmp_path / "a.rrd", recorder, block=0.0, knot_period=0.25) as sink:
        for count in (1, 40, 59):
            small_run.append_ticks(recorder, count)
            sink.flush(recorder.time[-1])
    recording = Recording(tmp_path / "a.rrd")
    due = [plan.time + 0.25 for plan in recorder.plans]

    def planned(name: str) -> np.ndarray:
        time, values = recording.column(f"/mismatch/{name}/planned", "scalars")
        assert_allclose(time, due)
        return np.array(values)

    assert_allclose(planned("left_hand"), np.tile([0.2, 0.0, 3.0], (10, 1)))
    assert_allclose(planned("right_hand"), 0.0)
    assert_allclose(planned("momentum_rate"), np.tile([1.2, 0.0, -2.4], (10, 1)))  # 2.4 kg at (0.5, 0, -1) m/s²
    assert_allclose(planned("feet"), 2.4 * (9.81 - 1.0) - 3.0)
    assert_allclose(planned("angular_momentum_rate"), 0.0)
    time, feet = recording.column("/mismatch/feet/measured", "scalars")
    assert_allclose(time, recorder.time[::10])
    assert_allclose(np.ravel(feet), recorder.state_sole_wrench_in_world[::10, :, 2].sum(axis=1))
    time, right = recording.column("/mismatch/right_hand/measured", "scalars")
    assert_allclose(right, recorder.state_palm_force_in_world[::10, 1])
    time, _ = recording.column("/mismatch/momentum_rate/measured", "scalars")
    assert_allclose(time, recorder.time[:-10:10] + 0.005)
