"""A complete small scenario and robot for the tests of this folder; independent of models/ and of scenarios/."""

from __future__ import annotations

from pathlib import Path

from wbmpc.scenario import Scenario, load_scenario

ROBOT = """
<mujoco model="tiny">
  <worldbody>
    <body name="torso" pos="0 0 0.06">
      <freejoint name="root"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.02 0.03"/>
      <geom name="foot" type="box" size="0.05 0.04 0.06" friction="3 0.005 0.0001" contype="0" conaffinity="1"/>
      <body name="arm" pos="0 0 0.1">
        <joint name="elbow" axis="0 1 0" range="-1 1"/>
        <inertial pos="0 0 0.05" mass="0.5" diaginertia="0.001 0.001 0.001"/>
        <geom name="forearm" type="sphere" size="0.02" contype="0" conaffinity="1"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0 0 0.06 1 0 0 0 0"/></keyframe>
</mujoco>
"""

BASE = """\
name: base
robot: tiny.xml
seed: 3
duration: 12.0
initial: {keyframe: home, joints: {elbow: 0.1}}
world:
  floor: {friction: 0.7}
  objects:
    table: {kind: box, size: [0.2, 0.6, 0.2], position: [0.3, 0.0], yaw: 0.0, friction: 0.9}
patches:
  right: {on: table, face: top, offset: [0.04, -0.1], friction: 0.4, force_cap: 12.0}
tasks:
  - kind: reach
    target: [0.44, 0.05, 0.3]
    start: 0.5
    arrive_by: 4.0
    hold: 2.0
    withdraw: 2.5
disturbances:
  - {kind: impulse, body: torso, time: 2.0, duration: 0.1, impulse: [1.4, 0.0, 0.0]}
plant: {mass_scale: 1.0}
loop: {physics_rate: 1000, planner_rate: 100, planner_delay: 0.01}
checks:
  - {kind: reach, max: 0.01, hold: 2.0}
  - {kind: contact_patches, allowed: [right]}
counterfactuals:
  absent:
    set: {world.objects.table.present: false}
    expect: fail
    failing: [reach]
sweep:
  variations:
    - {key: tasks.0.target.0, uniform: [0.42, 0.46]}
"""


def write(folder: Path, text: str | bytes = BASE, name: str = "base.yaml") -> Path:
    """Write a scenario file, and the robot beside it."""
    (folder / "tiny.xml").write_text(ROBOT)
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def load(folder: Path, text: str = BASE) -> Scenario:
    """Write a scenario file and load it."""
    return load_scenario(write(folder, text))


def edited(old: str, new: str) -> str:
    """The base text with one part replaced."""
    assert BASE.count(old) == 1, old
    return BASE.replace(old, new)
