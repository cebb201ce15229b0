"""A robot's MJCF as far as it can be read: a check asks for what it needs, and is skipped where that is missing."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from wbmpc.doctor.check import Missing
from wbmpc.signals import SIDES, Vector

SEED = 0  # of all random configurations


class RobotFile:
    """One MJCF in MuJoCo and, if possible, in Pinocchio. Everything may raise Missing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.mujoco_error = self.pinocchio_error = ""
        self._model: mujoco.MjModel | None = None
        self._pin_model: pin.Model | None = None
        try:
            self._model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            self.mujoco_error = " ".join(str(error).split())
            return  # what MuJoCo refuses may take Pinocchio anywhere
        try:
            self._pin_model = pin.buildModelFromMJCF(str(path))
        except (ValueError, RuntimeError, IndexError) as error:
            self.pinocchio_error = " ".join(str(error).rpartition("message: ")[2].split())  # without its source line

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's reading."""
        if self._model is None:
            raise Missing("a file that MuJoCo reads")
        return self._model

    @property
    def pin_model(self) -> pin.Model:
        """Pinocchio's reading."""
        if self._pin_model is None:
            raise Missing("a file that Pinocchio reads")
        return self._pin_model

    def id(self, kind: str, name: str) -> int:
        """Id of a named `body`, `geom`, `site` or `key`."""
        found = mujoco.mj_name2id(self.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
        if found < 0:
            raise Missing(f"a {kind} {name!r}")
        return int(found)

    def pair(self, kind: str, name: str) -> tuple[int, int]:
        """Ids of `left_NAME` and `right_NAME`."""
        left, right = (self.id(kind, f"{side}_{name}") for side in SIDES)
        return left, right

    @cached_property
    def home(self) -> mujoco.MjData:
        """At the keyframe `home`, forward pass done."""
        data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, self.id("key", "home"))
        mujoco.mj_forward(self.model, data)
        return data

    @property
    def hinges(self) -> list[int]:
        """Ids of all joints but a floating base."""
        free = mujoco.mjtJoint.mjJNT_FREE
        found = [joint for joint in range(self.model.njnt) if self.model.jnt_type[joint] != free]
        if not found:
            raise Missing("joints")
        return found

    @property
    def base(self) -> int:
        """The body with the floating base."""
        self.needs_floating_base()
        return int(self.model.jnt_bodyid[0])

    def needs_floating_base(self) -> None:
        """Raises Missing unless the first joint is free and all others are hinges."""
        model = self.model
        hinges = len(self.hinges)
        free, hinge = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_HINGE)
        if model.jnt_type.tolist() != [free] + [hinge] * hinges:
            raise Missing("a floating base, then hinges")

    def chain(self, site: int, *, above: int) -> list[int]:
        """Bodies from below the body `above` to that of a site, from the trunk out."""
        bodies: list[int] = []
        body = int(self.model.site_bodyid[site])
        while body not in (above, 0):
            bodies.insert(0, body)
            body = int(self.model.body_parentid[body])
        if body != above:
            raise Missing(f"a site {self.model.site(site).name!r} on a limb of body {self.model.body(above).name!r}")
        return bodies

    def joints_of(self, bodies: list[int]) -> list[int]:
        """Ids of the joints of these bodies, in order."""
        return [joint for body in bodies for joint in range(self.model.njnt) if self.model.jnt_bodyid[joint] == body]

    def joint_name(self, joint: int) -> str:
        """Its name, or its number where it has none."""
        return str(self.model.joint(joint).name or f"joint {joint}")

    def body_name(self, body: int) -> str:
        """Its name, or its number where it has none."""
        return str(self.model.body(body).name or f"body {body}")

    @property
    def sole_corners(self) -> Vector:
        """(2, 4, 3) [m] corners of the soles at home, in world."""
        sites, feet = self.pair("site", "sole"), self.pair("geom", "foot")
        signs = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
        corners = []
        for site, foot in zip(sites, feet, strict=True):
            rotation = self.home.site_xmat[site].reshape(3, 3)
            corners.append(self.home.site_xpos[site] + (signs * self.model.geom_size[foot]) @ rotation.T)
        return np.array(corners)
