"""What touches, what is named, what senses."""

from __future__ import annotations

import mujoco
import numpy as np

from wbmpc import model_contract
from wbmpc.doctor.check import Answer
from wbmpc.doctor.robot.subject import RobotFile
from wbmpc.signals import SIDES

LEAST_FRICTION = 0.3
ALIGNED = np.cos(np.radians(1.0))
LIMBS = ("foot", "shank", "thigh", "forearm", "palm_geom")  # named geoms of both sides


def names(robot: RobotFile) -> Answer:
    """Sites, geoms, body and keyframe by the contract's names."""
    problems = model_contract.named_problems(robot.model)
    return Answer(f"{', '.join(model_contract.SITES)}, torso, home; {len(LIMBS)} geoms a side", problems)


def contact_sites(robot: RobotFile) -> Answer:
    """Soles under the foot boxes, palms in the spheres' centres; soles at the ends of legs, palms of arms."""
    for kind, name in (("site", "sole"), ("site", "palm"), ("geom", "foot"), ("geom", "palm_geom")):
        robot.pair(kind, name)
    torso, base = robot.id("body", "torso"), robot.base
    problems = model_contract.contact_geom_problems(robot.model)
    counts = []
    for site, above, least in (("sole", base, 6), ("palm", torso, 3)):
        for side, place in zip(SIDES, robot.pair("site", site), strict=True):
            count = len(robot.joints_of(robot.chain(place, above=above)))
            counts.append(count)
            if count < least:
                name = robot.body_name(above)
                problems.append(f"{side}_{site} has {count} joints from {name} on, at least {least} needed")
    return Answer(f"legs of {counts[0]} and {counts[1]} joints, arms of {counts[2]} and {counts[3]}", problems)


def imu(robot: RobotFile) -> Answer:
    """The IMU's sensors, and its place: in the trunk, axes along the base's at home."""
    problems = model_contract.sensor_problems(robot.model)
    site = robot.id("site", "imu")
    body = int(robot.model.site_bodyid[site])
    warnings = []
    if body not in (robot.base, robot.id("body", "torso")):
        warnings.append(f"site 'imu' is on {robot.body_name(body)}, neither base nor torso")
    up = robot.home.site_xmat[site].reshape(3, 3)[2, 2]
    if up < ALIGNED:
        warnings.append(f"site 'imu' is tilted by {np.degrees(np.arccos(np.clip(up, -1, 1))):.1f}° at home")
    return Answer(f"quaternion, gyro and accelerometer on {robot.body_name(body)}", problems, warnings)


def feet(robot: RobotFile) -> Answer:
    """The foot polygon: both alike, large enough under a CoM so high."""
    left, right = (robot.model.geom_size[foot][:2] for foot in robot.pair("geom", "foot"))
    length, width = 2 * left
    failures, warnings = [], []
    if np.abs(left - right).max() > 1e-6:
        failures.append(f"left {length:.3g} × {width:.3g} m, right {2 * right[0]:.3g} × {2 * right[1]:.3g} m")
    if min(left) <= 0:
        failures.append(f"{length:.3g} × {width:.3g} m is no area")
    height = float(robot.home.subtree_com[0, 2])
    tilt = np.degrees(np.arctan2(min(left), height))
    if tilt < 2:
        warnings.append(f"{length:.3g} × {width:.3g} m under a CoM at {height:.2f} m: falls from {tilt:.1f}° on")
    return Answer(
        f"{length:.3g} × {width:.3g} m; half its shorter side seen from the CoM: {tilt:.0f}°", failures, warnings
    )


def hands(robot: RobotFile) -> Answer:
    """Palms, forearms and legs alike on both sides: the planner takes the left one's size for both."""
    unlike = []
    for limb in LIMBS[1:]:
        left, right = (robot.model.geom_size[geom] for geom in robot.pair("geom", limb))
        if np.abs(left - right).max() > 1e-6:
            unlike.append(f"{limb}: left {_sizes(left)}, right {_sizes(right)}")
    radius = robot.model.geom_size[robot.id("geom", "left_palm_geom"), 0]
    return Answer(f"palms of radius {1e3 * radius:.3g} mm, forearms, thighs and shanks alike", unlike)


def collisions(robot: RobotFile) -> Answer:
    """Limbs and trunk collide with the world."""
    model = robot.model
    collide = (model.geom_contype | model.geom_conaffinity) & 1 == 1  # a floor's own bits are 1 and 1
    through = [f"{side}_{limb}" for limb in LIMBS for side in SIDES if not collide[robot.id("geom", f"{side}_{limb}")]]
    failures = [f"geom {name!r} goes through everything" for name in through]
    torso = robot.id("body", "torso")
    warnings = [] if collide[model.geom_bodyid == torso].any() else ["no geom of the torso collides"]
    return Answer(f"{int(collide.sum())} of {model.ngeom} geoms collide, on every limb", failures, warnings)


def friction(robot: RobotFile) -> Answer:
    """Soles and palms hold: sliding friction, and contacts that know of it."""
    model, failures, warnings, found = robot.model, [], [], []
    for side in SIDES:
        for name in (f"{side}_foot", f"{side}_palm_geom"):
            geom = robot.id("geom", name)
            sliding, condim = float(model.geom_friction[geom, 0]), int(model.geom_condim[geom])
            found.append(sliding)
            if condim < 3:
                failures.append(f"{name}: condim {condim} has no friction")
            elif condim < 4:
                warnings.append(f"{name}: condim {condim} lets it spin on the spot")
            if sliding < LEAST_FRICTION:
                failures.append(f"{name}: sliding friction {sliding:g}")
    return Answer(f"sliding {min(found):g} to {max(found):g}, with torsion", failures, warnings)


def home_collisions(robot: RobotFile) -> Answer:
    """At home no part is inside another."""
    data = robot.home
    inside = []
    for contact in (data.contact[k] for k in range(data.ncon)):
        if contact.dist < 0:
            first, second = (_geom_name(robot, int(geom)) for geom in contact.geom)
            inside.append(f"{first} is {-1e3 * contact.dist:.2g} mm inside {second}")
    return Answer("none", inside)


def _geom_name(robot: RobotFile, geom: int) -> str:
    name = mujoco.mj_id2name(robot.model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    return name or f"a geom of {robot.body_name(int(robot.model.geom_bodyid[geom]))}"


def _sizes(size: np.ndarray) -> str:
    return " × ".join(f"{1e3 * value:.3g}" for value in size if value > 0) + " mm"
