"""The shipped robot and what the tests of the planner ask of it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.robot import Robot
from wbmpc.signals import Vector

ROOT = Path(__file__).parents[2]


@cache
def surena() -> Robot:
    return Robot.load(ROOT / "models" / "surena_mini.xml")


def at(q: Vector) -> Kinematics:
    """Kinematics of the robot at q (nq,)."""
    kinematics = Kinematics(surena())
    kinematics.update_kinematics(q)
    return kinematics


def soles(q: Vector) -> Vector:
    kinematics = at(q)
    return np.array([kinematics.position(frame) for frame in surena().sole_frames])


def palms(q: Vector) -> Vector:
    kinematics = at(q)
    return np.array([kinematics.position(frame) for frame in surena().palm_frames])


def standing_polygon(margin: float) -> SupportPolygon:
    """The support polygon of the home posture."""
    corners = [
        foot_corners(position=sole, yaw=0.0, half_extents=surena().sole_half_extents) for sole in soles(surena().home_q)
    ]
    return SupportPolygon.of_corners(np.vstack(corners), margin=margin, plane_height=0.0)
