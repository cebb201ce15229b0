"""Whether the robot stands at home, and what that costs."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from wbmpc.doctor.check import Answer
from wbmpc.doctor.robot.subject import RobotFile
from wbmpc.signals import GRAVITY, SIDES

FLAT = 1e-3  # [m] of a sole's corners over z = 0
CENTRED = 1e-3  # [m] of the point between the soles from x = 0
STRAIGHT = np.radians(2.0)  # heading of a sole
RESERVE = 0.25  # of half a sole's shorter side, from the CoM to the polygon's edge
LASTING = 0.5  # of the stall torque: more heats a servo that only stands


def home_feet(robot: RobotFile) -> Answer:
    """All corners of the soles on z = 0, x = 0 midway between them, toes ahead, soles beside each other."""
    corners = robot.sole_corners
    failures = []
    for side, sole in zip(SIDES, corners, strict=True):
        off = sole[np.abs(sole[:, 2]).argmax(), 2]
        if abs(off) > FLAT:
            failures.append(f"{side} sole: a corner {1e3 * off:+.1f} mm from the ground")
        ahead = sole[0] - sole[1]
        if abs(np.arctan2(ahead[1], ahead[0])) > STRAIGHT:
            failures.append(f"{side} sole points {np.degrees(np.arctan2(ahead[1], ahead[0])):+.0f}° to the side")
    middle = corners.mean(axis=(0, 1))
    if abs(middle[0]) > CENTRED:
        failures.append(f"the point between the soles is at x = {1e3 * middle[0]:+.1f} mm")
    gap = float(corners[0, :, 1].min() - corners[1, :, 1].max())
    if gap <= 0:
        failures.append(f"the soles overlap by {-1e3 * gap:.1f} mm")
    return Answer(f"soles flat on z = 0, {1e3 * gap:.0f} mm apart", failures)


def home_balance(robot: RobotFile) -> Answer:
    """The CoM's projection lies inside the soles' convex hull, not at its edge."""
    hull = ConvexHull(robot.sole_corners.reshape(-1, 3)[:, :2])
    com = robot.home.subtree_com[0]
    inside = -float((hull.equations[:, :2] @ com[:2] + hull.equations[:, 2]).max())
    least = RESERVE * robot.model.geom_size[robot.id("geom", "left_foot"), :2].min()
    words = f"CoM {1e3 * inside:.0f} mm inside the support polygon, {com[2]:.3f} m high"
    if inside < 0:
        return Answer("", [f"CoM {-1e3 * inside:.0f} mm outside the support polygon"])
    return Answer(words, (), [] if inside > least else [f"{words}: at its edge"])


def holding_torques(robot: RobotFile) -> Answer:
    """Static torques at home, each foot carrying its share straight up under the CoM: servos can hold them."""
    model, data = robot.model, robot.home
    robot.needs_floating_base()
    com, places = data.subtree_com[0], [data.site_xpos[site].copy() for site in robot.pair("site", "sole")]
    span = places[0][1] - places[1][1]
    if span <= 0:
        return Answer("", ["the left sole is not to the left of the right one"])
    left = (com[1] - places[1][1]) / span  # moments about x balance
    torque = data.qfrc_bias.copy()  # at rest: gravity's
    weight = float(model.body_subtreemass[0]) * GRAVITY
    for place, site, share in zip(places, robot.pair("site", "sole"), (left, 1 - left), strict=True):
        place[0] = com[0]  # moments about y balance
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, place, int(model.site_bodyid[site]))
        torque -= share * weight * jacobian[2]
    joints = [joint for joint in robot.hinges if model.jnt_actfrclimited[joint]]
    loads = {j: abs(torque[model.jnt_dofadr[j]]) / model.jnt_actfrcrange[j, 1] for j in joints}
    if not loads:
        return Answer("no torque limits: see servos")
    most = max(loads, key=loads.__getitem__)
    found = f"at most {loads[most]:.0%} of the limit ({robot.joint_name(most)})"
    words = {joint: f"{robot.joint_name(joint)} needs {load:.0%} of its limit" for joint, load in loads.items()}
    failures = [words[joint] for joint, load in loads.items() if load >= 1]
    return Answer(found, failures, [words[joint] for joint, load in loads.items() if LASTING < load < 1])
