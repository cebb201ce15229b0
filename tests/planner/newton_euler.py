"""Centre of pressure of the feet from Newton's and Euler's equations on point forces: no ZMP formula in sight."""

from __future__ import annotations

import numpy as np

from wbmpc.signals import Vector

GRAVITY = np.array([0.0, 0.0, 9.81])


def centre_of_pressure(
    *,
    mass: float,
    com: Vector,
    acceleration: Vector,
    plane_height: float,
    point: Vector | None = None,
    force: Vector | None = None,
) -> Vector:
    """Where the feet push (2,) [m], for a robot whose angular momentum about the CoM stays constant.

    Foot forces at four points of the foot plane are solved for, so that together with `force` (3,) at `point` (3,), or
    several of each (k, 3), they give m (c̈ + g) = Σ f ([M] eq. Newton-Euler1) and no moment about the CoM (eq.
    Newton-Euler2 with L̇ = 0); their centre of pressure is Σ s f_z / Σ f_z. The points need not be the robot's: all
    distributions have the same centre.
    """
    hands = np.zeros((1, 3)) if force is None else np.atleast_2d(force)
    arms = np.zeros((1, 3)) if point is None else np.atleast_2d(point) - com
    feet = np.array([[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]])
    feet = np.column_stack([feet, np.full(4, plane_height)])
    net = mass * (acceleration + GRAVITY) - hands.sum(axis=0)
    moment = -np.cross(arms, hands).sum(axis=0)
    grasp = np.vstack(
        [np.hstack([np.eye(3)] * 4), np.hstack([np.cross(np.eye(3), s - com).T * -1.0 for s in feet])]
    )  # (6, 12): columns of the lower half are (s − c) × e_j
    foot_forces = np.linalg.lstsq(grasp, np.concatenate([net, moment]), rcond=None)[0].reshape(4, 3)
    assert np.allclose(foot_forces.sum(axis=0), net, atol=1e-9)
    assert np.allclose(np.cross(feet - com, foot_forces).sum(axis=0), moment, atol=1e-9)
    return (feet[:, :2] * foot_forces[:, 2:]).sum(axis=0) / foot_forces[:, 2].sum()
