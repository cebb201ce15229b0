"""What the robot's body does not allow: torque, the joints' ranges, and what is out of reach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wbmpc.checks.context import CheckContext
from wbmpc.checks.stretches import joined
from wbmpc.signals import SIDES, HandMode, Vector
from wbmpc.triage.causes import Cause, Finding

OFF_PLAN = 0.015  # [m] of the CoM or a palm from its reference: in runs that pass a CoM is within 7 mm
AT_STOP = 0.005  # [rad] from the end of a joint's range
SHORTEST = 0.1  # [s] that a servo or a joint is at its limit
GAP = 0.03  # [s]
STRAIGHT = 0.97  # share of an arm's length from which on it is straight


def saturations(context: CheckContext, share: float) -> Iterator[Finding]:
    """Servos at their limit while the robot does not follow its plan.

    Args:
        share: of the limit that the tracker may ask for.
    """
    recorder = context.recorder
    limit = np.maximum(recorder.torque_limit, 1e-6 * context.facts.stall_torque)
    saturated = np.abs(recorder.torque) >= 0.98 * share * limit  # (n, nj)
    yield from _held_up(context, saturated, Cause.TORQUE_SATURATION, "gives all its torque")


def joint_limits(context: CheckContext, model: Any) -> Iterator[Finding]:
    """Joints at the end of their range while the robot does not follow its plan."""
    joints = len(context.facts.joint_name)
    angle, (low, high) = context.recorder.qpos[:, 7 : 7 + joints], model.jnt_range[1 : 1 + joints].T
    at_stop = (angle < low + AT_STOP) | (angle > high - AT_STOP)
    yield from _held_up(context, at_stop, Cause.JOINT_LIMIT, "is at the end of its range")


def off_plan(context: CheckContext) -> Vector:
    """(n,) [m] the larger distance of the CoM and the guided palms from their references; held between samples."""
    recorder = context.recorder
    samples, guided = recorder.sample_ticks, recorder.setpoint_hand_mode != HandMode.FREE
    com = np.linalg.norm(recorder.com[samples] - recorder.setpoint_com_position, axis=1)
    palms = np.linalg.norm(recorder.palm_position[samples] - recorder.setpoint_hand_position, axis=2)
    error = np.maximum(com, np.where(guided, palms, 0.0).max(axis=1))
    return np.repeat(error, recorder.stride)[: recorder.ticks]


def _held_up(context: CheckContext, held: NDArray[np.bool_], cause: Cause, words: str) -> Iterator[Finding]:
    """A finding for each stretch in which `held` (n, nj), by joint, and a robot off its plan come together."""
    error = off_plan(context)
    for joint, name in enumerate(context.facts.joint_name):
        for first, stop in joined(held[:, joint] & (error >= OFF_PLAN), context.ticks(GAP)):
            start, end = float(context.time[first]), float(context.time[stop - 1])
            if end - start >= SHORTEST:
                what = f"{name} {words}, the robot up to {1e2 * error[first:stop].max():.1f} cm off its plan"
                yield Finding(cause, start, end, what)


def out_of_reach(context: CheckContext, model: Any) -> tuple[Finding, bool] | None:
    """Where a palm comes nearest to the target of a reach, if not near enough; whether its arm is straight there."""
    recorder = context.recorder
    best: tuple[float, int, int] | None = None
    for target in context.facts.reach_targets:
        distance = np.linalg.norm(recorder.palm_position - target, axis=2)  # (n, 2)
        tick, side = (int(index) for index in np.unravel_index(np.nanargmin(distance), distance.shape))
        if best is None or distance[tick, side] > best[0]:
            best = (float(distance[tick, side]), tick, side)
    if best is None or best[0] < OFF_PLAN:
        return None
    away, tick, side = best
    straight, time = _extension(context, model, tick, side) >= STRAIGHT, float(context.time[tick])
    what = f"the {SIDES[side]} palm comes no nearer to its target than {1e2 * away:.1f} cm"
    return Finding(Cause.UNREACHABLE, time, np.inf, what + ", the arm straight" * straight), straight


def _extension(context: CheckContext, model: Any, tick: int, side: int) -> float:
    """Distance from shoulder to palm over the length of the links between them."""
    site = model.site(f"{SIDES[side]}_palm")
    data = mujoco.MjData(model)
    qpos = context.recorder.qpos[tick]
    data.qpos[: qpos.size] = qpos
    mujoco.mj_kinematics(model, data)
    body, trunk = int(site.bodyid[0]), model.body("torso").id
    length = float(np.linalg.norm(site.pos))
    while model.body_parentid[body] not in (trunk, 0):
        length += float(np.linalg.norm(model.body_pos[body]))
        body = int(model.body_parentid[body])
    return float(np.linalg.norm(data.site_xpos[site.id] - data.xpos[body])) / max(length, 1e-9)
