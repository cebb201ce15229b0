"""What the tasks ask of the feet: no overlapping soles, the right velocity, one step per step task, aligned stops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gait_case import PERIOD, SETTINGS, Velocity, feet_at, sole, step_task, stepping, walk
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.stepping import Stepping
from wbmpc.signals import Vector

commands = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.1, 0.1), st.floats(-0.6, 0.6))
headings = st.floats(-3.0, 3.0)


def walked(walker: Stepping, feet: Feet, count: int, time: float = 1.0) -> tuple[list[Footstep], list[Feet]]:
    """`count` steps at most, and the feet before and after each."""
    steps, stances = [], [feet]
    while len(steps) < count and (step := walker.next(stances[-1], time)) is not None:
        steps.append(step)
        stances.append(stances[-1].after(step))
        walker.landed(step)
    return steps, stances


def gap(a: Vector, b: Vector) -> float:
    """Distance of two convex polygons (n, 2) along their best separating edge; ≤ 0: they overlap."""
    best = -np.inf
    for one, other in ((a, b), (b, a)):
        for start, end in zip(one, np.roll(one, -1, axis=0), strict=True):
            dx, dy = end - start
            outward = np.array([dy, -dx]) / np.hypot(dx, dy)
            best = max(best, float(((other - start) @ outward).min()))
    return best


@given(command=commands, yaw=headings)
@example(command=(-0.19921875, 0.0, 0.59375), yaw=0.0)
def test_legs_never_cross(command: Velocity, yaw: float) -> None:
    """Feet alternate, each lands on its own side of the other, and soles do not overlap."""
    steps, stances = walked(stepping(walk((0.0, *command))), feet_at(0.3, -0.2, yaw), 6)
    for step, feet, after in zip(steps, stances, stances[1:], strict=False):
        assert step.side != feet.last
        stance = 1 - step.side
        left = np.array([-np.sin(feet.yaws[stance]), np.cos(feet.yaws[stance])])
        out = float(left @ (step.position - feet.positions[stance])[:2]) * (1.0 if step.side == 0 else -1.0)
        assert out >= SETTINGS.narrowest - 1e-9
        assert gap(sole(after, 0), sole(after, 1)) > 0.0


@given(vx=st.floats(-0.2, 0.2), vy=st.floats(-0.1, 0.1), yaw=headings)
def test_mean_velocity_over_a_cycle_is_the_command(vx: float, vy: float, yaw: float) -> None:
    if max(abs(vx), abs(vy)) < 1e-3:
        return
    _, stances = walked(stepping(walk((0.0, vx, vy, 0.0))), feet_at(yaw=yaw), 8)
    middles = np.array([feet.positions.mean(axis=0)[:2] for feet in stances])
    moved = middles[8] - middles[4]  # two cycles, from the fifth step on
    forward, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    assert moved @ forward / (4 * PERIOD) == pytest.approx(vx, abs=1e-9)
    assert moved @ left / (4 * PERIOD) == pytest.approx(vy, abs=1e-9)
    assert_allclose(stances[-1].yaws, yaw, atol=1e-12)


@given(omega=st.floats(0.05, 0.6), sign=st.sampled_from([-1.0, 1.0]), vx=st.floats(-0.1, 0.1))
def test_turning_meets_its_rate_and_speed(omega: float, sign: float, vx: float) -> None:
    """Over four cycles: the angle is exact, the way the arc's but for the room that turned soles need."""
    _, stances = walked(stepping(walk((0.0, vx, 0.0, sign * omega))), feet_at(), 10)
    a, b = stances[2], stances[10]
    angle = float(b.yaws.mean() - a.yaws.mean())
    assert angle == pytest.approx(8 * PERIOD * sign * omega)
    heading = float(a.yaws.mean())
    arc = vx / (sign * omega) * np.array(
        [np.sin(heading + angle) - np.sin(heading), np.cos(heading) - np.cos(heading + angle)]
    )  # fmt: skip
    moved = (b.positions.mean(axis=0) - a.positions.mean(axis=0))[:2]
    assert np.linalg.norm(moved - arc) < 2 * 0.08


def test_the_foot_on_the_side_of_the_motion_goes_first() -> None:
    for command, side in (((0.0, 0.05, 0.0), 0), ((0.0, -0.05, 0.0), 1), ((0.0, 0.0, 0.3), 0), ((0.0, 0.0, -0.3), 1)):
        step = stepping(walk((0.0, *command))).next(feet_at(), 0.0)
        assert step is not None
        assert step.side == side


@given(command=commands, count=st.integers(1, 7))
def test_a_stop_ends_with_the_feet_side_by_side(command: Velocity, count: int) -> None:
    walker = stepping(walk((0.0, *command), (10.0, 0.0, 0.0, 0.0)))
    _, stances = walked(walker, feet_at(), count)
    steps, stances = walked(walker, stances[-1], 5, time=10.0)
    assert len(steps) <= 2
    feet = stances[-1]
    assert feet.yaws[0] == pytest.approx(feet.yaws[1], abs=0.06)
    heading = float(feet.yaws.mean())
    ahead = (feet.positions[0] - feet.positions[1])[:2] @ [np.cos(heading), np.sin(heading)]
    assert abs(ahead) < 0.02
    assert gap(sole(feet, 0), sole(feet, 1)) > 0.0


def test_nothing_is_asked_before_the_first_command() -> None:
    walker = stepping(walk((0.5, 0.1, 0.0, 0.0)))
    assert walker.next(feet_at(), 0.49) is None
    assert walker.command(0.49) is None
    assert not walker.velocities(np.zeros(1), np.array([0.49])).any()
    assert walker.next(feet_at(), 0.5) is not None


def test_a_command_of_zero_from_standing_asks_for_no_step() -> None:
    assert stepping(walk((0.0, 0.0, 0.0, 0.0))).next(feet_at(width=0.12), 1.0) is None


@given(yaw=headings)
def test_velocity_is_the_command_in_the_heading(yaw: float) -> None:
    walker = stepping(walk((0.0, 0.1, 0.05, 0.0), (1.0, 0.0, 0.02, 0.0)))
    velocities = walker.velocities(np.array([yaw, 2.0 * yaw]), np.array([0.9, 1.0]))
    assert complex(*velocities[0]) == pytest.approx(complex(0.1, 0.05) * np.exp(1j * yaw))
    assert complex(*velocities[1]) == pytest.approx(0.02j * np.exp(2j * yaw))


def test_a_step_task_is_one_step() -> None:
    task = step_task("right", target=(0.03, -0.15))
    walker, feet = stepping(task), feet_at()
    assert walker.next(feet, 0.1) is None
    step = walker.next(feet, 0.2)
    assert step is not None
    assert step.side == 1
    assert_allclose(step.position[:2], [0.03, -0.15])
    assert step.swing_time == task.duration
    assert not step.adaptable
    assert walker.next(feet, 0.2, made=(step.task,)) is None  # in a preview it is made once
    walker.landed(step)
    assert walker.next(feet.after(step), 0.3) is None


def test_step_tasks_come_one_after_the_other() -> None:
    steps, stances = walked(stepping(step_task("left"), step_task("right", (0.05, -0.05))), feet_at(), 5)
    assert [step.side for step in steps] == [0, 1]
    assert_allclose(stances[-1].positions[:, :2], [[0.05, 0.1], [0.05, -0.05]])


def test_a_full_turn_is_not_unwound() -> None:
    """The heading goes on past half a turn, and a step to yaw 0 after a whole turn is a small one."""
    _, stances = walked(stepping(walk((0.0, 0.0, 0.0, 0.5))), feet_at(), 20)
    assert stances[-1].yaws.mean() == pytest.approx(20 * PERIOD * 0.5)
    around = replace(feet_at(), yaws=np.array([6.2, 6.2]))
    step = stepping(step_task()).next(around, 1.0)
    assert step is not None
    assert step.yaw == pytest.approx(2 * np.pi)
