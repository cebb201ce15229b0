"""Sampled reach sets of hands and legs: joints drawn evenly from their ranges, the rest of the body at home."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import mujoco
import numpy as np

from wbmpc.doctor.check import Answer
from wbmpc.doctor.robot.subject import SEED, RobotFile
from wbmpc.signals import SIDES, Vector

SAMPLES = 3000  # postures of an arm
LEG_SAMPLES = 4000  # most of them no stance
CELLS = 8  # of an arm's reach, a side of the cells in which both hands' points are counted
LEAST_SHARED = 0.02  # of the cells that a hand reaches
ABOVE = 0.35  # of its height, at most, that the hip is beside a flat sole: farther away nobody stands
FEWEST = 10  # samples that tell of a band
LEAST_BAND = 0.15  # of the leg's greatest height


def palm_reach(robot: RobotFile) -> Answer:
    """Both palms get ahead of the toes, without the body leaning."""
    toes = float(robot.sole_corners[:, :, 0].max())
    ahead = [float(points[:, 0].max()) - toes for points in _palms(robot)]
    short = [
        f"{side} palm ends {-1e3 * x:.0f} mm behind the toes" for side, x in zip(SIDES, ahead, strict=True) if x < 0
    ]
    return Answer(f"{1e3 * ahead[0]:.0f} and {1e3 * ahead[1]:.0f} mm ahead of the toes, standing upright", (), short)


def hands_meet(robot: RobotFile) -> Answer:
    """The space that both hands reach, ahead of the torso: what two hands can do together."""
    left, right = _palms(robot)
    cell = float(np.ptp(left, axis=0).max()) / CELLS
    trunk = robot.home.xpos[robot.id("body", "torso"), 0]
    cells = [{tuple(index) for index in np.floor(p[p[:, 0] > trunk] / cell).astype(int)} for p in (left, right)]
    shared = len(cells[0] & cells[1]) / max(len(cells[0] | cells[1]), 1)
    words = f"share {shared:.0%} of the space ahead that one or the other reaches"
    return Answer(words, (), [] if shared >= LEAST_SHARED else [f"the hands {words}"])


def leg_reach(robot: RobotFile) -> Answer:
    """The band of heights of the hip over a flat sole, home in it with a bent knee: stage 1 needs room both ways."""
    failures, warnings, found = [], [], []
    for side, site in zip(SIDES, robot.pair("site", "sole"), strict=True):
        joints = robot.joints_of(robot.chain(site, above=robot.base))
        heights = np.array([_height(data, joints[0], site) for data in _sampled(robot, joints, LEG_SAMPLES)])
        heights = heights[np.isfinite(heights)]
        if heights.size < FEWEST:
            failures.append(
                f"{side} leg: {heights.size} of {LEG_SAMPLES} random postures bring the hip over a flat sole"
            )
            continue
        lowest, highest = heights.min(), heights.max()
        home = _height(robot.home, joints[0], site)
        band = (highest - lowest) / highest
        found.append(f"{side} {lowest:.2f} to {highest:.2f} m, home {home:.2f}")
        if not band >= LEAST_BAND:
            failures.append(f"{side} leg: {lowest:.2f} to {highest:.2f} m, it cannot crouch")
        elif home > lowest + 1.02 * (highest - lowest):  # samples do not quite find the end
            warnings.append(f"{side} leg: home at {home:.2f} m is stretched, at most {highest:.2f} m")
    return Answer("hip over the sole: " + "; ".join(found), failures, warnings)


@lru_cache(maxsize=1)
def _palms(robot: RobotFile) -> list[Vector]:
    """(n, 3) [m] for each side, in world, the body at home."""
    torso, points = robot.id("body", "torso"), []
    for site in robot.pair("site", "palm"):
        joints = robot.joints_of(robot.chain(site, above=torso))
        points.append(np.array([data.site_xpos[site].copy() for data in _sampled(robot, joints, SAMPLES)]))
    return points


def _sampled(robot: RobotFile, joints: list[int], samples: int) -> Iterator[mujoco.MjData]:
    """The same MjData again and again, in another posture each time."""
    model, data, random = robot.model, mujoco.MjData(robot.model), np.random.default_rng(SEED)
    data.qpos[:] = robot.home.qpos
    places = model.jnt_qposadr[joints]
    lower, upper = model.jnt_range[joints].T
    for angles in random.uniform(lower, upper, size=(samples, len(joints))):
        data.qpos[places] = angles
        mujoco.mj_kinematics(model, data)
        yield data


def _height(data: mujoco.MjData, hip: int, site: int) -> float:
    """[m] of the leg's first joint over the plane of the sole; nan where it would be beside the sole."""
    up, offset = data.site_xmat[site].reshape(3, 3)[:, 2], data.xanchor[hip] - data.site_xpos[site]
    height = float(up @ offset)
    return height if np.linalg.norm(offset - height * up) <= ABOVE * height else float("nan")
