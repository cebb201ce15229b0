"""Made-up runs for the tests of the checks: a mass on two feet, whose forces and motion are written down by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from wbmpc.checks.context import CheckContext, Facts
from wbmpc.columns import EVERY_TICK, SAMPLED
from wbmpc.recorder import Recorder
from wbmpc.signals import CONTACT, ContactPhase, RobotState, Setpoint, SolveStatus, StageReport, TorqueCommand, Truth

FLOOR, LEFT_FOOT, RIGHT_FOOT, LEFT_PALM, RIGHT_PALM, TORSO, TABLE, WALL = range(8)
GEOMS = ("floor", "left_foot", "right_foot", "left_palm", "right_palm", "torso", "table", "wall")
STEP = 0.01  # [s] coarse, so that runs stay short
MASS = 2.0  # [kg]
WEIGHT = MASS * 9.81  # [N]
TARGET = np.array([0.4, 0.0, 0.3])
SOLE_HALF = (0.06, 0.035)  # [m]
SOLES = np.array([[0.0, 0.05, 0.0], [0.0, -0.05, 0.0]])  # [m] x from -0.06 to 0.06, y from -0.085 to 0.085
DIMENSIONS = SimpleNamespace(nq=9, nv=8, nj=2)


class SyntheticRun:
    """Stands still for n ticks unless a test writes something else into its columns before `context()`.

    `run.com[50:] = ...` changes a column of the plant's truth; `run.touch(...)` adds a contact; `run.plans` the plans.
    """

    def __init__(self, ticks: int = 100, *, duration: float | None = None) -> None:
        self.ticks = ticks
        self.duration = ticks * STEP if duration is None else duration
        self.time = np.arange(ticks) * STEP
        # A robot of two joints, and a loose object of six more degrees of freedom.
        self.qpos = np.zeros((ticks, 16))
        self.qvel = np.zeros((ticks, 14))
        self.torque = np.zeros((ticks, 2))
        self.torque_limit = np.full((ticks, 2), 2.0)
        self.com = np.tile([0.0, 0.0, 0.26], (ticks, 1))
        self.com_velocity = np.zeros((ticks, 3))
        self.palm_position = np.tile([[0.0, 0.1, 0.2], [0.0, -0.1, 0.2]], (ticks, 1, 1))
        self.sole_position = np.tile(SOLES, (ticks, 1, 1))
        self.torso_up = np.ones(ticks)
        self.external_force = np.zeros((ticks, 3))
        self.fallback = np.zeros(ticks, dtype=bool)
        self.contacts: list[list[tuple[int, int, np.ndarray, float]]] = [[] for _ in range(ticks)]
        self.plans: list[Any] = []
        self.facts: dict[str, Any] = {}
        self.sole_yaw = np.zeros((ticks, 2))  # [rad]
        self.walkable = {FLOOR}
        self.qpos[:, -1] = np.arange(ticks)  # a clock in the loose object's pose: `sole_vertices` sees qpos alone
        for foot in (LEFT_FOOT, RIGHT_FOOT):
            self.touch(range(ticks), FLOOR, foot, [0.0, 0.0, WEIGHT / 2])

    def touch(self, ticks: Any, first: int, second: int, force: Any, *, distance: float = -1e-4) -> None:
        """Add a contact between two geoms at every one of `ticks`; `force` (3,) [N] acts on the robot."""
        for tick in ticks:
            self.contacts[tick].append((first, second, np.asarray(force, dtype=float), distance))

    def plan(
        self,
        time: float,
        *,
        left: tuple[str, ContactPhase] = ("", ContactPhase.NONE),
        right: tuple[str, ContactPhase] = ("", ContactPhase.NONE),
        statuses: tuple[SolveStatus, ...] = (SolveStatus.SOLVED, SolveStatus.SOLVED, SolveStatus.NOT_RUN),
    ) -> None:
        """Add a plan of time `time` [s] with the patch and phase of each hand and the status of each stage."""
        stages = [StageReport(status=status, solve_time=1e-3, iterations=1) for status in statuses]
        self.plans.append(
            SimpleNamespace(
                time=time,
                contact_patch=(left[0], right[0]),
                com_height_band=np.array([[0.16, 0.275]]),
                contact_phase=np.array([left[1], right[1]]),
                stage1=stages[0],
                stage2=stages[1],
                stage3=stages[2],
                plan_time=2e-3,
                events=(),
            )
        )

    def context(self) -> CheckContext:
        recorder = Recorder(DIMENSIONS, expected_ticks=self.ticks, plant_nq=16, plant_nv=14)
        zeros = _zeros(recorder)
        for tick in range(self.ticks):
            truth = SimpleNamespace(**zeros[0])
            for name in zeros[0]:
                if hasattr(self, name):
                    setattr(truth, name, getattr(self, name)[tick])
            contacts = self.contacts[tick]
            truth.contact_count = len(contacts)
            truth.contacts = np.array([(c[:2], np.zeros(3), c[2], c[3]) for c in contacts], CONTACT)
            state, setpoint, command = (SimpleNamespace(**fields) for fields in zeros[1:])
            command.fallback, command.solve_time = self.fallback[tick], 1e-4
            recorder.append(truth, state, setpoint, command)  # type: ignore[arg-type]
        for plan in self.plans:
            recorder.append_plan(plan)
        return CheckContext(recorder, self._facts())

    def _facts(self) -> Facts:
        facts: dict[str, Any] = {
            "duration": self.duration,
            "timestep": STEP,
            "mass": MASS,
            "geom_name": GEOMS,
            "geom_is_robot": np.array([g in (LEFT_FOOT, RIGHT_FOOT, LEFT_PALM, RIGHT_PALM, TORSO) for g in range(8)]),
            "geom_foot": np.array([-1, 0, 1, -1, -1, -1, -1, -1]),
            "geom_palm": np.array([-1, -1, -1, 0, 1, -1, -1, -1]),
            "joint_name": ("hip", "knee"),
            "stall_torque": np.array([2.0, 2.5]),
            "no_load_speed": np.array([5.0, 6.0]),
            "patch_geoms": {"table_1": frozenset({TABLE}), "table_2": frozenset({TABLE}), "wall_1": frozenset({WALL})},
            "geom_walkable": np.isin(np.arange(8), list(self.walkable)),
            "patch_force_cap": {"table_1": 8.0, "table_2": 6.0, "wall_1": 5.0},
            "step_targets": (),
            "go_targets": (),
            "highest_ground": None,
            "patch_normal": {
                "table_1": np.array([0.0, 0.0, 1.0]),
                "table_2": np.array([0.0, 0.0, 1.0]),
                "wall_1": np.array([0.0, -1.0, 0.0]),
            },
            "lifted_objects": (),
            "reach_targets": (TARGET,),
            "com_heights": (),
            "sole_vertices": self._corners,
        }
        return Facts(**{**facts, **self.facts})

    def _corners(self, qpos: np.ndarray) -> np.ndarray:
        """(2, 4, 3) [m] corners of both soles at the tick that `qpos` (16,) belongs to, front ones first."""
        tick, (half_x, half_y) = int(qpos[-1]), SOLE_HALF
        corners = np.array([[x, y] for x in (half_x, -half_x) for y in (half_y, -half_y)])
        result = np.zeros((2, 4, 3))
        for side, yaw in enumerate(self.sole_yaw[tick]):
            turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
            result[side, :, :2] = corners @ turn.T
        return result + self.sole_position[tick][:, None]

    def step(self, foot: int, start: int, stop: int, displacement: Any = (0.0, 0.0), turn: float = 0.0) -> None:
        """`foot` leaves the ground at tick `start` and lands at tick `stop`, displaced [m] and turned [rad]."""
        side = (LEFT_FOOT, RIGHT_FOOT).index(foot)
        self.lift(range(start, stop), foot)
        share = np.clip((np.arange(self.ticks) - start) / (stop - start), 0.0, 1.0)
        self.sole_position[:, side, :2] += share[:, None] * np.asarray(displacement)
        self.sole_yaw[:, side] += share * turn

    def lift(self, ticks: Any, foot: int) -> None:
        """Take away every contact of the geom `foot` at `ticks`."""
        for tick in ticks:
            self.contacts[tick] = [contact for contact in self.contacts[tick] if foot not in contact[:2]]


def _zeros(recorder: Recorder) -> list[dict[str, Any]]:
    """For each signal, its fields by name, filled with zeros of the recorder's shapes."""
    zeros: dict[type, dict[str, Any]] = {cls: {} for cls in (Truth, RobotState, Setpoint, TorqueCommand)}
    for cls, prefix, fields in EVERY_TICK + SAMPLED:
        for name, (_, dtype) in fields.items():
            zeros[cls][name] = np.zeros(recorder.column(prefix + name).shape[1:], dtype)
    return list(zeros.values())
