"""Every task's rows against finite differences of Pinocchio's positions along a velocity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from tracker_case import ROBOT, STEP, com, near_home, placement, standing

from wbmpc.kinematics import Kinematics
from wbmpc.signals import HandMode, Setpoint, Vector
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tasks import COM, FEET, HANDS, MOMENTUM, TORSO, TaskStack

GAINS = [name for name in TrackerSettings.model_fields if name.endswith(("stiffness", "damping", "integral"))]
WITHOUT_GAINS = TrackerSettings(**dict.fromkeys(GAINS, 0.0))
H = 1e-4  # [s] of the finite differences


def linear(frame: int) -> Callable[[Vector, Vector], Vector]:
    """Velocity (3,) of a frame's origin at q along v, by central differences."""

    def velocity(q: Vector, v: Vector) -> Vector:
        ahead, behind = (placement(ROBOT.integrate(q, h * v), frame).translation for h in (H, -H))
        return (ahead - behind) / (2 * H)

    return velocity


def angular(frame: int) -> Callable[[Vector, Vector], Vector]:
    """Angular velocity (3,) of a frame in world at q along v, from the rotation between two moments."""

    def velocity(q: Vector, v: Vector) -> Vector:
        ahead, behind = (placement(ROBOT.integrate(q, h * v), frame).rotation for h in (H, -H))
        return np.asarray(pin.log3(ahead @ behind.T)) / (2 * H)

    return velocity


def com_velocity(q: Vector, v: Vector) -> Vector:
    return (com(ROBOT.integrate(q, H * v)) - com(ROBOT.integrate(q, -H * v))) / (2 * H)


def angular_momentum(q: Vector, v: Vector) -> Vector:
    """Σ over bodies of (p − c) × m ṗ + I ω, summed here by hand."""
    model, data = ROBOT.pin_model, ROBOT.pin_model.createData()
    pin.forwardKinematics(model, data, q, v)
    centre = com(q)
    total = np.zeros(3)
    for joint in range(1, model.njoints):
        inertia, pose, twist = model.inertias[joint], data.oMi[joint], data.v[joint]
        lever = pose.act(inertia.lever) - centre
        speed = pose.rotation @ (twist.linear + np.cross(twist.angular, inertia.lever))
        total += np.cross(lever, inertia.mass * speed) + pose.rotation @ inertia.inertia @ twist.angular
    return total


TASKS = {
    "com": (COM, com_velocity),
    "momentum": (MOMENTUM, angular_momentum),
    "torso": (TORSO, angular(ROBOT.torso_frame)),
    **{
        f"{name} {side}": (slice(first + width * i + offset, first + width * i + offset + 3), of(frames[i]))
        for i, side in enumerate(("left", "right"))
        for name, first, width, offset, frames, of in (
            ("sole", FEET.start, 6, 0, ROBOT.sole_frames, linear),
            ("sole turn", FEET.start, 6, 3, ROBOT.sole_frames, angular),
            ("palm", HANDS.start, 3, 0, ROBOT.palm_frames, linear),
        )
    },
}


def moving(q: Vector, rng: np.random.Generator) -> Setpoint:
    """Feet swing and hands move: all rows are in use."""
    return replace(
        standing(q),
        foot_stance=np.zeros(2, bool),
        hand_mode=np.array([HandMode.MOVE, HandMode.MOVE]),
        com_acceleration=rng.normal(size=3),
        foot_acceleration=rng.normal(size=(2, 3)),
        hand_acceleration=rng.normal(size=(2, 3)),
    )


def rows(q: Vector, v: Vector, setpoint: Setpoint, settings: TrackerSettings) -> TaskStack:
    kinematics, stack = Kinematics(ROBOT), TaskStack(ROBOT, settings, step=STEP)
    kinematics.update(q, v)
    stack.build(kinematics, v, setpoint)
    return stack


def test_every_row_has_a_task() -> None:
    covered = np.zeros(27, int)
    for where, _ in TASKS.values():
        covered[where] += 1
    assert (covered == 1).all()


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("seed", range(3))
def test_matrix_is_the_jacobian(task: str, seed: int) -> None:
    where, velocity = TASKS[task]
    q, v = near_home(seed, spread=0.4, speed=1.0)
    stack = rows(q, v, moving(q, np.random.default_rng(seed)), WITHOUT_GAINS)
    assert_allclose(stack.matrix[where] @ v, velocity(q, v), atol=1e-6)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("seed", range(3))
def test_target_takes_the_drift_off(task: str, seed: int) -> None:
    """Without gains the target is the wanted acceleration less J̇v; J̇v is the task's acceleration at constant v."""
    where, velocity = TASKS[task]
    q, v = near_home(seed, spread=0.4, speed=1.0)
    setpoint = moving(q, np.random.default_rng(seed))
    wanted = np.zeros(27)
    wanted[COM] = setpoint.com_acceleration
    for side in range(2):
        wanted[FEET.start + 6 * side : FEET.start + 6 * side + 3] = setpoint.foot_acceleration[side]
        wanted[HANDS.start + 3 * side : HANDS.start + 3 * side + 3] = setpoint.hand_acceleration[side]
    step = 1e-3
    drift = (velocity(ROBOT.integrate(q, step * v), v) - velocity(ROBOT.integrate(q, -step * v), v)) / (2 * step)
    stack = rows(q, v, setpoint, WITHOUT_GAINS)
    assert_allclose(stack.target[where], wanted[where] - drift, atol=1e-4)


@pytest.mark.parametrize("task", [name for name in TASKS if name != "momentum"])
def test_feedback_reduces_the_error(task: str) -> None:
    """From a displaced posture at rest, the target points back: a small motion along it lowers the distance to home."""
    where, _ = TASKS[task]
    settings = TrackerSettings(com_integral=0.0, hand_integral=0.0)
    q = ROBOT.integrate(ROBOT.home_q, 0.05 * np.random.default_rng(7).uniform(-1, 1, ROBOT.nv))
    setpoint = replace(
        standing(ROBOT.home_q), foot_stance=np.zeros(2, bool), hand_mode=np.array([HandMode.MOVE, HandMode.MOVE])
    )
    stack = rows(q, np.zeros(ROBOT.nv), setpoint, settings)
    matrix, target = stack.matrix[where], stack.target[where]
    moved = ROBOT.integrate(q, 1e-3 * np.linalg.pinv(matrix) @ target)

    def distance(configuration: Vector) -> float:
        if task == "com":
            return float(np.linalg.norm(com(configuration) - com(ROBOT.home_q)))
        frame = {
            "torso": ROBOT.torso_frame,
            **{f"{n} {s}": f[i] for i, s in enumerate(("left", "right")) for n, f in (
                ("sole", ROBOT.sole_frames), ("sole turn", ROBOT.sole_frames), ("palm", ROBOT.palm_frames))},
        }[task]  # fmt: skip
        here, there = placement(configuration, frame), placement(ROBOT.home_q, frame)
        if "turn" in task or task == "torso":
            return float(np.linalg.norm(pin.log3(there.rotation @ here.rotation.T)))
        return float(np.linalg.norm(there.translation - here.translation))

    assert distance(q) > 1e-3
    assert distance(moved) < 0.999 * distance(q)


def test_stance_and_contact_damp_the_velocity_and_free_hands_have_no_weight() -> None:
    q, v = near_home(3, speed=1.0)
    modes = np.array([HandMode.CONTACT, HandMode.FREE])
    settings = TrackerSettings()
    drift = rows(q, v, replace(standing(q), hand_mode=modes), WITHOUT_GAINS)
    stack = rows(q, v, replace(standing(q), hand_mode=modes), settings)
    assert_allclose(
        stack.target[FEET] - drift.target[FEET], -settings.stance_damping * stack.matrix[FEET] @ v, atol=1e-9
    )
    left = slice(HANDS.start, HANDS.start + 3)
    assert_allclose(
        stack.target[left] - drift.target[left], -settings.stance_damping * stack.matrix[left] @ v, atol=1e-9
    )
    assert (stack.weight[FEET] == settings.stance_weight).all()
    assert (stack.weight[left] == settings.braced_weight).all()
    assert (stack.weight[HANDS.start + 3 :] == 0.0).all()


def test_a_far_hand_is_asked_for_a_bounded_acceleration() -> None:
    settings = TrackerSettings()
    setpoint = replace(
        standing(), hand_mode=np.array([HandMode.MOVE, HandMode.FREE]), hand_position=np.full((2, 3), 2.0)
    )
    stack = rows(ROBOT.home_q, np.zeros(ROBOT.nv), setpoint, settings)
    assert np.linalg.norm(stack.target[HANDS][:3]) == pytest.approx(settings.hand_acceleration_limit)
