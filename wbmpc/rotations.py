"""Rotations: the few that planner and tracker share."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbmpc.signals import Vector

UP = np.array([0.0, 0.0, 1.0])  # in world
UP.setflags(write=False)


def cross(a: Vector, b: Vector) -> Vector:
    """a × b for vectors (3,); several times faster than numpy's general one, which the 1 kHz loop would feel."""
    a0, a1, a2 = a.tolist()
    b0, b1, b2 = b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def length(vector: Vector) -> float:
    """|vector| of a vector (n,), without the detours of numpy's norm."""
    return sqrt(vector @ vector)


def rotation_error(*, desired: Vector, measured: Vector) -> Vector:
    """Rotation vector (3,) in world that turns `measured` (3, 3) into `desired` (3, 3) [rad], |error| ≤ π."""
    R = desired @ measured.T
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = 0.5 * float(np.sqrt(axis @ axis))
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if sine < 1e-9:
        if cosine > 0.0:
            return 0.5 * axis
        about = R + np.eye(3)  # 2 a aᵀ for a half turn about a
        column = about[:, int(np.argmax(np.diag(about)))]
        return np.pi * column / np.sqrt(column @ column)
    return axis * (0.5 * np.arctan2(sine, cosine) / sine)


def heading_of(rotation: Vector) -> float:
    """Yaw [rad] of a frame (3, 3) that is not too far from level: the direction of its x axis in the ground plane."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def angle_difference(a: float, b: float) -> float:
    """a − b [rad], by the shorter way: in [−π, π)."""
    return (a - b + np.pi) % (2.0 * np.pi) - np.pi


def contact_frame(normal: Vector) -> Vector:
    """Rotation (3, 3) whose columns are two tangents and the unit `normal` (3,), in world."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    second = cross(normal, helper)
    second /= np.linalg.norm(second)
    return np.column_stack([cross(second, normal), second, normal])


def level_frame(yaw: float) -> Vector:
    """Rotation (3, 3) to world of a frame with heading `yaw` [rad] and z up."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def plane_rotation(yaw: float) -> Vector:
    """Rotation (2, 2) by `yaw` [rad] in the horizontal plane."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])
