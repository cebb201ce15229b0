"""Masses and inertias."""

from __future__ import annotations

import numpy as np

from wbmpc.doctor.check import Answer
from wbmpc.doctor.robot.subject import RobotFile

LEAST_SHARE = 5e-4  # of the robot's mass: lighter links make the mass matrix ill-conditioned
MOST_SHARE = 0.7
DENSITY = (5.0, 60.0)  # [kg/m³] mass over height cubed: a person has 13, small servo robots 20 to 25
LEAST_GYRATION = 5e-4  # [m]


def masses(robot: RobotFile) -> Answer:
    """Every link has a mass, none nearly nothing, none nearly all of it."""
    model = robot.model
    total, names = float(model.body_mass.sum()), [robot.body_name(body) for body in range(model.nbody)]
    moving = [body for body in range(1, model.nbody) if model.body_weldid[body] == body]
    if total <= 0:
        return Answer("", ["the robot has no mass"])
    failures = [f"{names[body]} has no mass" for body in moving if model.body_mass[body] <= 0]
    shares = {body: float(model.body_mass[body] / total) for body in moving if model.body_mass[body] > 0}
    light = [f"{names[b]} weighs {model.body_mass[b]:.2g} kg" for b, share in shares.items() if share < LEAST_SHARE]
    heavy = [f"{names[b]} has {share:.0%} of the mass" for b, share in shares.items() if share > MOST_SHARE]
    lightest, heaviest = min(shares, key=shares.__getitem__), max(shares, key=shares.__getitem__)
    found = f"{model.body_mass[lightest]:.3g} kg ({names[lightest]}) to {model.body_mass[heaviest]:.3g} kg"
    return Answer(f"{found} ({names[heaviest]})", failures, light + heavy)


def inertias(robot: RobotFile) -> Answer:
    """Principal moments that a solid of the robot's size can have: A + B ≥ C, radii of gyration between bounds."""
    model, size = robot.model, _height(robot)
    failures, warnings, radii = [], [], []
    for body in range(1, model.nbody):
        mass, moments = float(model.body_mass[body]), np.sort(model.body_inertia[body])
        if mass <= 0:
            continue  # that is for `masses`
        name = robot.body_name(body)
        if moments[0] + moments[1] < moments[2] * (1 - 1e-9) or moments[0] <= 0:
            failures.append(f"{name}: {moments[0]:.3g} + {moments[1]:.3g} < {moments[2]:.3g} kg·m²")
            continue
        radius = np.sqrt(moments / mass)
        radii.append(radius)
        if radius[2] > size / 2:
            failures.append(f"{name}: radius of gyration {radius[2]:.2g} m in a robot of {size:.2g} m")
        elif radius[0] < LEAST_GYRATION:
            warnings.append(f"{name}: radius of gyration {1e3 * radius[0]:.2g} mm")
    extremes = 1e3 * np.array(radii) if radii else np.zeros((1, 3))
    return Answer(f"radii of gyration {extremes.min():.0f} to {extremes.max():.0f} mm", failures, warnings)


def total_mass(robot: RobotFile) -> Answer:
    """A mass that fits the height."""
    total, height = float(robot.model.body_mass.sum()), _height(robot)
    density = total / height**3
    found = f"{total:.3g} kg at {height:.2f} m: {density:.0f} kg/m³"
    low, high = DENSITY
    return Answer(found, (), [] if low <= density <= high else [f"{found}, others have {low:g} to {high:g}"])


def _height(robot: RobotFile) -> float:
    """[m] from the lowest to the highest surface of a geom at home."""
    model, data = robot.model, robot.home
    up = data.geom_xmat.reshape(-1, 3, 3)[:, 2]  # the world's z in the geoms' axes
    centre = data.geom_xpos[:, 2] + np.sum(up * model.geom_aabb[:, :3], axis=1)
    half = np.sum(np.abs(up) * model.geom_aabb[:, 3:], axis=1)
    moving = model.geom_bodyid > 0
    return float((centre + half)[moving].max() - (centre - half)[moving].min())
