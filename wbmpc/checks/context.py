"""What the checks read: the recording, and the facts of the plant and scenario that no recording holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbmpc.checks.blocks import by_blocks, lengths
from wbmpc.recorder import Recorder
from wbmpc.signals import GRAVITY, SIDES, ContactPhase, Vector

TOUCH = 0.01  # [N] a lighter contact is none
CONTACT_FORCE = 0.3  # [N] lighter touches of a palm do not count as a contact made; the palms' sensing threshold
SAMPLE_PERIOD = 0.01  # [s] the soles' corners are evaluated this often: they move slowly, and cost a kinematics


@dataclass(frozen=True, slots=True)
class LiftedObject:
    """A box that the robot is asked to lift and that the world contains."""

    name: str
    geoms: frozenset[int]
    qpos: int  # where its pose begins in qpos: position, then quaternion wxyz
    half: Vector  # (3,) [m] half edge lengths


@dataclass(frozen=True, slots=True)
class Facts:
    """True facts of the plant (not of the controller's model), per geom id, per joint, per patch."""

    duration: float  # [s] how long the run should have lasted
    timestep: float  # [s]
    mass: float  # [kg] the plant's true robot mass, unmodelled mass included
    geom_name: tuple[str, ...]  # by geom id; the body's name where the geom has none
    geom_is_robot: NDArray[np.bool_]  # (ngeom,)
    geom_foot: NDArray[np.int64]  # (ngeom,) side index of the foot that the geom is part of, -1: not a foot
    geom_palm: NDArray[np.int64]  # (ngeom,) side index of the palm, -1: not a palm
    geom_walkable: NDArray[np.bool_]  # (ngeom,) the floor, and the objects that a foot may stand on
    joint_name: tuple[str, ...]  # (nj,)
    stall_torque: Vector  # (nj,) [N·m]
    no_load_speed: Vector  # (nj,) [rad/s]
    patch_geoms: Mapping[str, frozenset[int]]  # geoms of the object that carries each candidate patch
    patch_normal: Mapping[str, Vector]  # (3,) out of the surface, in world
    patch_force_cap: Mapping[str, float]  # [N] largest normal force that the planner may ask for
    lifted_objects: tuple[LiftedObject, ...]  # of the scenario's lift tasks
    reach_targets: tuple[Vector, ...]  # (3,) [m] in world, of the scenario's reach tasks
    step_targets: tuple[tuple[int, Vector], ...]  # side index, (2,) [m] in world, of the step tasks in order of time
    go_targets: tuple[Vector, ...]  # (2,) [m] in world, of the go tasks
    highest_ground: float | None  # [m] of what feet may stand on besides the floor, as told; None: there is nothing
    com_heights: tuple[tuple[float, float], ...]  # ([s], [m]) waypoints of the com_height task, above the floor
    sole_vertices: Callable[
        [Vector], Vector
    ]  # qpos (nq,) -> (2, 4, 3) [m] corners of both soles in world, front ones first


class CheckContext:
    """A finished run as the checks see it: the recorder's columns, the facts, and what both together say.

    Args:
        recorder: the run's columns; n ticks, c contacts over all ticks.
        facts: of the plant and the scenario.
    """

    def __init__(self, recorder: Recorder, facts: Facts) -> None:
        self.recorder = recorder
        self.facts = facts

    @property
    def time(self) -> Vector:
        """(n,) [s]"""
        return self.recorder.time

    @property
    def body_weight(self) -> float:
        """[N]"""
        return self.facts.mass * GRAVITY

    def ticks(self, duration: float) -> int:
        """Number of steps in `duration` [s], at least one."""
        return max(1, round(duration / self.facts.timestep))

    @cached_property
    def _first_contact(self) -> NDArray[np.int64]:
        """(n + 1,) rows of the contacts at which those of each tick begin, and their number."""
        return np.concatenate([[0], np.cumsum(self.recorder.contact_count)])

    def contact_tick(self, rows: ArrayLike) -> NDArray[np.int64]:
        """Ticks of these `rows` (r,) of the contacts."""
        return np.searchsorted(self._first_contact, rows, side="right") - 1

    def contact_time(self, row: int) -> float:
        """[s] time of one of the contacts."""
        return float(self.time[self.contact_tick(row)])

    def first_contact_time(self, violated: NDArray[np.bool_]) -> float | None:
        """[s] time of the first contact that is true in `violated` (c,); None when none is."""
        return self.contact_time(int(np.argmax(violated))) if violated.any() else None

    @cached_property
    def contact_sides(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.bool_]]:
        """Robot geom (c,), world geom (c,), and whether the contact joins the robot with the world (c,).

        Where it does not (self-collision, or two objects), the two geoms are in MuJoCo's order.
        """
        ordered = by_blocks(self._robot_first, self.recorder.contacts.geoms)
        is_robot = self.facts.geom_is_robot
        outside = by_blocks(lambda pair: is_robot[pair[:, 0]] ^ is_robot[pair[:, 1]], ordered)
        return ordered[:, 0], ordered[:, 1], outside

    def _robot_first(self, geoms: NDArray[np.int32]) -> NDArray[np.int32]:
        robot = self.facts.geom_is_robot[geoms]  # (c, 2)
        swap = robot[:, 1] & ~robot[:, 0]
        return np.where(swap[:, None], geoms[:, ::-1], geoms)

    @cached_property
    def palm_force(self) -> Vector:
        """(n, 2, 3) [N] force of the world on each palm, from the plant's contacts."""
        return self._force_on(self.facts.geom_palm)

    @cached_property
    def sole_force(self) -> Vector:
        """(n, 2, 3) [N] force of the world on each foot, from the plant's contacts."""
        return self._force_on(self.facts.geom_foot)

    @cached_property
    def sole_touching(self) -> NDArray[np.bool_]:
        """(n, 2) whether anything touches each foot."""
        return lengths(self.sole_force) > TOUCH

    @cached_property
    def sample_ticks(self) -> NDArray[np.int64]:
        """(m,) ticks at which `sole_corners` are known, one each `SAMPLE_PERIOD`."""
        return np.arange(0, self.recorder.ticks, self.ticks(SAMPLE_PERIOD))

    @cached_property
    def sole_corners(self) -> Vector:
        """(m, 2, 4, 3) [m] corners of both soles in world at `sample_ticks`, front ones first."""
        return np.array([self.facts.sole_vertices(qpos) for qpos in self.recorder.qpos[self.sample_ticks]])

    @cached_property
    def world_force(self) -> Vector:
        """(n, 3) [N] force of the whole world on the robot, from the plant's contacts."""
        return self._force_on(np.zeros_like(self.facts.geom_foot), parts=1)[:, 0]

    def _force_on(self, part_of_geom: NDArray[np.int64], parts: int = len(SIDES)) -> Vector:
        """(n, parts, 3) [N] force of the world on the geoms of each part; -1: of none."""
        robot_geom, _, outside = self.contact_sides
        force = self.recorder.contacts.force

        def sums(first: NDArray[np.int64], stop: NDArray[np.int64]) -> Vector:  # contacts of each tick of a block
            rows = slice(first[0], stop[-1]) if len(first) else slice(0)
            part = part_of_geom[robot_geom[rows]]
            counted = outside[rows] & (part >= 0)
            place = (parts * np.repeat(np.arange(len(first)), stop - first) + part)[counted]
            pushing, count = force[rows][counted], parts * len(first)
            axes = [np.bincount(place, weights=pushing[:, axis], minlength=count) for axis in range(3)]
            return np.stack(axes, axis=1).reshape(-1, parts, 3).astype(np.float64, copy=False)

        return by_blocks(sums, self._first_contact[:-1], self._first_contact[1:])

    @cached_property
    def plan_of_tick(self) -> NDArray[np.int64]:
        """(n,) index of the newest plan whose snapshot is not younger than the tick, -1 before the first."""
        times = np.array([plan.time for plan in self.recorder.plans])
        return np.searchsorted(times, self.time + 1e-9, side="right") - 1

    @cached_property
    def patch_of_tick(self) -> list[tuple[str, ...]]:
        """(n,) patch that each hand (left, right) is chosen for, approaches or holds; "" when none."""
        per_plan = self._patch_of_plan
        return [per_plan[index] for index in self.plan_of_tick]

    @cached_property
    def _patch_of_plan(self) -> list[tuple[str, ...]]:
        """The same for each plan, and at index -1 for the time before the first."""
        per_plan: list[tuple[str, ...]] = [
            tuple(
                patch if ContactPhase.CHOSEN <= phase <= ContactPhase.UNLOADED else ""
                for patch, phase in zip(plan.contact_patch, plan.contact_phase, strict=True)
            )
            for plan in self.recorder.plans
        ]
        return [*per_plan, ("", "")]

    @cached_property
    def patch_codes(self) -> tuple[tuple[str, ...], NDArray[np.int64]]:
        """Names of all patches ever chosen, and (n, 2) the index among them of `patch_of_tick`, -1 when none."""
        per_plan, which = self._patch_of_plan, self.plan_of_tick
        names = sorted({patch for index in np.unique(which) for patch in per_plan[index]} - {""})
        codes = {name: code for code, name in enumerate(names)}
        return tuple(names), np.array([[codes.get(patch, -1) for patch in pair] for pair in per_plan])[which]

    @cached_property
    def palm_push(self) -> Vector:
        """(n, 2) [N] force on each palm along the normal of the patch chosen for it; 0 when none is."""
        return self.push_along(self.patch_codes[1])

    def push_along(self, code: NDArray[np.int64]) -> Vector:
        """(n, 2) [N] force on each palm along the normal of the patch with index `code` (n, 2); 0 where that is -1."""
        normals = np.array([*(self.facts.patch_normal[name] for name in self.patch_codes[0]), np.zeros(3)])
        return np.einsum("nsx,nsx->ns", self.palm_force, normals[code])
