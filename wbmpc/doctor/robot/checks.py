"""All checks of a robot's MJCF, in the order in which one would mend it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wbmpc.doctor.check import Check, Finding, examine
from wbmpc.doctor.robot import joints, links, parts, reach, reading, standing
from wbmpc.doctor.robot.subject import RobotFile
from wbmpc.doctor.robot.symmetry import symmetry

_CONTRACT = "models/README.md, section 'The contract', says what an MJCF must have"
CHECKS: tuple[Check[RobotFile], ...] = (
    Check(
        "mujoco", reading.readable, "mend what the message names; `python -m mujoco.viewer --mjcf=FILE` shows the model"
    ),
    Check(
        "pinocchio", reading.pinocchio_reads, "leave out what only MuJoCo knows, or attach it in the scenario's world"
    ),
    Check("tree", joints.tree, _CONTRACT),
    Check("names", parts.names, _CONTRACT),
    Check("servos", joints.servos, _CONTRACT),
    Check("motor ranges", joints.motor_ranges, "leave the limit to the joint's actuatorfrcrange; ctrllimited='false'"),
    Check("joint ranges", joints.joint_ranges, "lower bound first, in the unit of <compiler angle=...>"),
    Check("rotors", joints.rotors, "armature: rotor inertia times the gear ratio squared, from the servo's data sheet"),
    Check("speeds", joints.speeds, "user=... is the servo's no-load speed in rad/s: rev/min times 0.105"),
    Check("masses", links.masses, "merge tiny links into their parents, or weigh them; give every body an <inertial>"),
    Check("inertias", links.inertias, "moments about the link's CoM in kg·m², from CAD; of a box: m (b² + c²) / 12"),
    Check("total mass", links.total_mass, "compare with the data sheet: mass in kg, lengths in m"),
    Check("one robot", reading.same_robot, _CONTRACT),
    Check(
        "one dynamics", reading.same_dynamics, "an explicit <inertial> for every body, geoms that only show mass='0'"
    ),
    Check("one kinematics", reading.same_frames, "no site named like a body or joint; one robot, under the first body"),
    Check("contact sites", parts.contact_sites, _CONTRACT),
    Check("imu", parts.imu, "a site 'imu' in the torso or the base, x ahead, z up, and its three sensors"),
    Check("feet", parts.feet, "boxes left_foot and right_foot of one size: half length, half width, half height"),
    Check("limb sizes", parts.hands, "give both sides the geom sizes of one"),
    Check("collisions", parts.collisions, "contype='1' conaffinity='1' for limbs and trunk"),
    Check("friction", parts.friction, "condim='4' and friction='0.8 0.005 0.0001' for rubber soles and palms"),
    symmetry("symmetric legs", site="sole", above="base"),
    symmetry("symmetric arms", site="palm", above="torso"),
    Check(
        "home",
        joints.home_in_range,
        "move the posture of keyframe 'home', or the range, until the joint can go both ways",
    ),
    Check(
        "home feet",
        standing.home_feet,
        "set the base of 'home' so that both soles are level on z = 0, x = 0 between them",
    ),
    Check(
        "home balance", standing.home_balance, "lean the ankles of 'home' until the CoM is over the middle of the feet"
    ),
    Check(
        "home collisions",
        parts.home_collisions,
        "spread the limbs of 'home', or <exclude> neighbours that overlap at a joint",
    ),
    Check(
        "holding torques",
        standing.holding_torques,
        "bend the knees of 'home' less, or see whether torque limits are in N·m",
    ),
    Check("leg reach", reach.leg_reach, "wider ranges of hip pitch, knee and ankle pitch; a bent knee at home"),
    Check(
        "palm reach", reach.palm_reach, "wider ranges of shoulder pitch and elbow; reaching scenarios then need a lean"
    ),
    Check(
        "hands meet", reach.hands_meet, "wider inward ranges of shoulder roll and yaw; without them no two-handed task"
    ),
    Check("timestep", joints.timestep, "<option timestep='0.001'/>; scenarios run at loop.physics_rate whatever it is"),
    Check(
        "physics",
        joints.physics_options,
        "<option integrator='implicitfast' cone='elliptic' impratio='10'/>, no <flag>",
    ),
)


def examine_robot(path: Path, on_done: Callable[[str], None] | None = None) -> list[Finding]:
    """The finding of every check of the MJCF at `path`, whatever the file holds."""
    return examine(CHECKS, RobotFile(path), on_done)
