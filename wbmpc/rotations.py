"""Rotations: the few that planner and tracker share."""

from __future__ import annotations

import numpy as np

from wbmpc.signals import Vector


def rotation_error(*, desired: Vector, measured: Vector) -> Vector:
    """Rotation vector (3,) in world that turns `measured` (3, 3) into `desired` (3, 3) [rad], |error| ≤ π."""
    R = desired @ measured.T
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = 0.5 * float(np.sqrt(axis @ axis))
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if sine < 1e-9:
        return 0.5 * axis
    return axis * (0.5 * np.arctan2(sine, cosine) / sine)


def contact_frame(normal: Vector) -> Vector:
    """Rotation (3, 3) whose columns are two tangents and the unit `normal` (3,), in world."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    second = np.cross(normal, helper)
    second /= np.linalg.norm(second)
    return np.column_stack([np.cross(second, normal), second, normal])


def level_frame(yaw: float) -> Vector:
    """Rotation (3, 3) to world of a frame with heading `yaw` [rad] and z up."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
