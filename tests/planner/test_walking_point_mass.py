"""Stage 2 and the gait in a loop with an ideal point mass at constant height: it walks as commanded, and is pushed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
from gait_case import DT, PERIOD, SETTINGS, IdealGait, feet_at, walk
from numpy.testing import assert_allclose

from wbmpc.planner.horizontal_motion import ZmpModel
from wbmpc.planner.joint_velocities import FOOT_ROWS, JointVelocities, VelocityTasks
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import GaitSettings, WholeBodySettings
from wbmpc.planner.support_preview import MAX_FOOTSTEPS
from wbmpc.planner.whole_body import WholeBodyStage
from wbmpc.signals import GRAVITY, Vector

PREVIEW = Preview(steps=16, step=0.1)
STAGE_2 = WholeBodySettings()
HEIGHT = 0.26  # [m]
B = HEIGHT / GRAVITY
OMEGA = 1.0 / np.sqrt(B)  # [1/s]
ZMP = ZmpModel(np.ones(16), np.full(16, B), np.zeros((16, 2)))
FALLEN = 0.5  # [m] between CoM and feet
NO_BODY = VelocityTasks(
    com_jacobian=np.zeros((3, 1)), com_correction=np.zeros(3), com_vertical_velocity=0.0,
    foot_jacobian=np.zeros((FOOT_ROWS, 1)), foot_velocity=np.zeros(FOOT_ROWS),
    hand_jacobian=np.zeros((6, 1)), hand_velocity=np.zeros(6), hand_active=np.zeros(2),
    torso_jacobian=np.zeros((3, 1)), torso_velocity=np.zeros(3),
    posture_velocity=np.zeros(1), posture_weight=np.ones(1), lower=-np.ones(1), upper=np.ones(1),
)  # fmt: skip


@dataclass
class Walk:
    """What happened, tick by tick."""

    com: list[Vector] = field(default_factory=list)  # (2,) [m]
    excess: list[float] = field(default_factory=list)  # [m] of the exact ZMP beyond the soles that stand
    middle: list[Vector] = field(default_factory=list)  # (2,) [m] between the feet
    landings: list[Vector] = field(default_factory=list)
    fallen: bool = False


def go(
    *commands: tuple[float, float, float, float],
    seconds: float,
    push: tuple[float, float, float] | None = None,
    adapt: bool = True,
    gait: GaitSettings = SETTINGS,
) -> Walk:
    """Plan, execute the first jerk for one tick, plan again; `push`: time [s] and jump of the CoM velocity [m/s]."""
    gait_settings = gait.model_copy(update={"adapt_footsteps": adapt})
    run, out = IdealGait.of(walk(*commands), settings=gait_settings, feet=feet_at()), Walk()
    joints = JointVelocities(1, STAGE_2, backend="daqp")
    stage = WholeBodyStage(PREVIEW, STAGE_2, joints, backend="daqp", ask_shift=False)
    state, shift = np.zeros((2, 3)), np.zeros((MAX_FOOTSTEPS, 2))
    band = np.tile([-np.inf, np.inf], (2, 16, 1))
    feet = run.gait.feet
    for k in range(round(seconds / DT)):
        run.gait.aim(shift[0], DT)
        run.tick()
        if run.gait.feet is not feet:
            feet = run.gait.feet
            out.landings.append(feet.positions[feet.last, :2])
        if push and k == round(push[0] / DT):
            state[:, 1] += push[1:]
        support = run.preview(PREVIEW.times, margin=STAGE_2.zmp_margin, growth=STAGE_2.zmp_margin_growth)
        plan, solution = stage.solve(
            state, zmp=ZMP, support=support, com_band=band, tasks=NO_BODY, velocity_time=DT, urgency=1.0
        )
        assert plan is not None, solution.status.name
        shift = plan.footstep_shift
        jerk = plan.jerk[0]
        position = state[:, 0] + DT * state[:, 1] + DT**2 / 2 * state[:, 2] + DT**3 / 6 * jerk
        velocity = state[:, 1] + DT * state[:, 2] + DT**2 / 2 * jerk
        acceleration, ground = state[:, 2] + DT * jerk, run.polygon()
        zmp = position - B * acceleration
        out.com.append(position)
        out.excess.append(ground.excess(zmp))
        if out.excess[-1] > 0.0:  # no foot can push there
            acceleration = (position - ground.nearest(zmp)) / B
        state = np.column_stack([position, velocity, acceleration])
        out.middle.append(feet.positions[:, :2].mean(axis=0))
        if np.abs(position - out.middle[-1]).max() > FALLEN:
            out.fallen = True
            break
    return out


FORWARD = (0.3, 0.1, 0.0, 0.0)
PUSH = (3.05, 0.0, 0.3)  # [s], [m/s] forward and left, early in a swing of the left foot


@cache
def forward() -> Walk:
    return go(FORWARD, seconds=5.5)


@pytest.mark.parametrize("velocity", [(-0.08, 0.0), (0.0, 0.05), (0.06, -0.04)])
def test_walks_with_the_commanded_mean_velocity(velocity: tuple[float, float]) -> None:
    result = go((0.3, *velocity, 0.0), seconds=0.8 + 8 * PERIOD)
    cycle = round(2 * PERIOD / DT)
    mean = (result.com[-1] - result.com[-1 - 2 * cycle]) / (2 * 2 * PERIOD)
    assert_allclose(mean, velocity, atol=0.008)
    assert len(result.landings) >= 7


def test_walks_as_commanded_at_the_default_timing() -> None:
    """Its transfer is shorter than a knot: between two knots the ZMP gets 5 mm ahead of the sole that has landed."""
    timing = GaitSettings()
    period = timing.swing_time + timing.double_support
    result = go((0.3, 0.12, 0.0, 0.0), seconds=0.8 + 8 * period, gait=timing)
    cycle = round(2 * period / DT)
    assert_allclose((result.com[-1] - result.com[-1 - 2 * cycle]) / (4 * period), (0.12, 0.0), atol=0.012)
    assert len(result.landings) >= 7
    assert max(result.excess) < 0.006


def test_the_zmp_stays_under_the_feet_between_knots_too() -> None:
    """The plan bounds it at knots 0.1 s apart, with an inset; executed ticks in between use some of that inset."""
    assert max(forward().excess) < 0.002
    assert np.mean(np.array(forward().excess) > -0.005) < 0.1


def test_the_com_sways_between_the_feet_and_does_not_drift() -> None:
    com = np.array(forward().com[300:])
    assert np.abs(com[:, 1]).max() < SETTINGS.step_width / 2
    assert com[:, 1].max() > 0.005
    assert com[:, 1].min() < -0.005


def test_undisturbed_footsteps_are_the_commanded_ones() -> None:
    places = np.array(forward().landings[3:])
    assert_allclose(np.diff(places[:, 0]), 0.1 * PERIOD, atol=0.006)
    assert_allclose(np.abs(np.diff(places[:, 1])), SETTINGS.step_width, atol=0.012)


def test_a_stop_comes_to_rest_between_the_feet() -> None:
    result = go(FORWARD, (3.0, 0.0, 0.0, 0.0), seconds=7.0)
    assert np.linalg.norm(result.com[-1] - result.com[-50]) < 2e-3
    assert_allclose(result.com[-1], result.middle[-1], atol=0.03)


def test_turning_goes_round() -> None:
    result = go((0.3, 0.06, 0.0, 0.25), seconds=6.5)
    assert not result.fallen
    moved = np.diff(np.array(result.middle)[::130], axis=0)[1:]  # one cycle each
    angles = np.unwrap(np.arctan2(moved[:, 1], moved[:, 0]))
    assert_allclose(np.diff(angles).mean(), 0.25 * 2 * PERIOD, rtol=0.2)
    assert max(result.excess) < 0.004


def test_a_push_that_fells_fixed_footsteps_is_survived_with_adaptation() -> None:
    """Herdt's point; both walk the same until then, and the adapted step goes to the side of the push."""
    adapted, fixed = (go(FORWARD, seconds=5.5, push=PUSH, adapt=adapt) for adapt in (True, False))
    assert fixed.fallen
    assert not adapted.fallen
    assert np.abs(np.array(adapted.com[-1]) - adapted.middle[-1]).max() < 0.06
    undisturbed = np.array(forward().landings)
    aside = np.array(adapted.landings)[: len(undisturbed)] - undisturbed[: len(adapted.landings)]
    assert aside[:, 1].max() > 0.03
    mean = (adapted.com[-1] - adapted.com[-1 - round(2 * PERIOD / DT)]) / (2 * PERIOD)
    assert_allclose(mean, [0.1, 0.0], atol=0.02)  # and walks on


def test_a_small_push_needs_no_adaptation() -> None:
    """The counterfactual's other side: fixed footsteps walk, and take what the soles can take."""
    assert not go(FORWARD, seconds=5.0, push=(3.05, 0.0, 0.03), adapt=False).fallen
