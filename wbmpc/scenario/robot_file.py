"""Where the robot's MJCF is, and the names in it that a scenario may mention."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from wbmpc.errors import RobotError
from wbmpc.scenario.wording import near_misses

MODELS = Path(__file__).resolve().parents[2] / "models"


@dataclass(frozen=True, slots=True)
class RobotNames:
    """Names defined by a robot model."""

    bodies: frozenset[str]
    joints: frozenset[str]
    geoms: frozenset[str]
    keyframes: frozenset[str]


def find_robot(robot: str, *, scenario_directory: Path) -> Path:
    """The MJCF of a scenario's `robot`: a name in models/, or an .xml path relative to the scenario's directory.

    Raises:
        RobotError: there is no such file; names the choices.
    """
    path = scenario_directory / robot if robot.endswith(".xml") else MODELS / f"{robot}.xml"
    if path.is_file():
        return path
    if robot.endswith(".xml"):
        raise RobotError(f"no such file: '{robot}' relative to the scenario's directory")
    raise RobotError(f"no robot '{robot}' in models/" + near_misses(robot, [p.stem for p in MODELS.glob("*.xml")]))


def read_robot_names(path: Path) -> RobotNames:
    """Read the names without compiling the model, which would take a hundred times longer.

    Raises:
        RobotError: the file is not XML.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, UnicodeDecodeError) as error:
        raise RobotError(f"{path.name} is not a readable MJCF: {error}") from None

    def names(tag: str) -> frozenset[str]:
        found = (element.get("name") for world in root.iter("worldbody") for element in world.iter(tag))
        return frozenset(name for name in found if name)

    keys = frozenset(key.get("name", "") for block in root.iter("keyframe") for key in block.iter("key"))
    return RobotNames(bodies=names("body"), joints=names("joint"), geoms=names("geom"), keyframes=keys)
