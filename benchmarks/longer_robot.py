"""The robot with more joints than it has: a chain of small links on its back, for growth only.

Joints of wrists or fingers would have to be told of to every scenario; a chain at the end of the tree changes nothing
that is there: the contract is met, the first joints are those of the robot, and its mass grows by a gram a link.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.braced_states import Ticks
from wbmpc.robot import Robot

LINK = 0.01  # [m] length of a link


def with_chain(robot: Robot, links: int, folder: Path) -> Robot:
    """`robot` and `links` more joints; its file is written to `folder`."""
    tree = ElementTree.parse(robot.path)
    root = tree.getroot()
    body, motors, key = root.find(".//body[@name='torso']"), root.find("actuator"), root.find(".//key[@name='home']")
    assert body is not None
    assert motors is not None
    assert key is not None
    for i in range(links):
        body = ElementTree.SubElement(body, "body", name=f"chain_{i}", pos="-0.06 0 0.1" if i == 0 else f"{-LINK} 0 0")
        ElementTree.SubElement(body, "inertial", mass="0.001", pos="0 0 0", diaginertia="1e-7 1e-7 1e-7")
        axis = ("0 1 0", "0 0 1")[i % 2]
        joint = {"class": "neck", "name": f"chain_{i}_joint", "axis": axis, "range": "-1 1"}
        ElementTree.SubElement(body, "joint", joint)
        ElementTree.SubElement(motors, "motor", name=f"chain_{i}_servo", joint=joint["name"])
    key.set("qpos", " ".join([key.attrib["qpos"], *["0"] * links]))
    path = folder / f"robot_{robot.nj + links}.xml"
    tree.write(path)
    return Robot.load(path)


def lengthened(ticks: Ticks, robot: Robot) -> Ticks:
    """The same ticks of a robot whose joints after the known ones rest at zero."""
    more = np.zeros(robot.nj - ticks.robot.nj)
    states = [replace(s, q=np.append(s.q, more), v=np.append(s.v, more)) for s in ticks.states]
    setpoints = [
        replace(
            s,
            joint_position=np.append(s.joint_position, more),
            joint_velocity=np.append(s.joint_velocity, more),
        )
        for s in ticks.setpoints
    ]
    return Ticks(robot, ticks.step, states, setpoints)
