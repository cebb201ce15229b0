"""In-memory columns of one run: the only source of the checks and of the recording file.

One row a tick, gathered in a small buffer and copied into a preallocated table that doubles when full: nothing is
formatted, logged or allocated in the hot loop, and one place in memory is written, not one for each column. Contacts
vary in number, so they are kept ragged: one flat table of contacts, and each tick's count.
The hash over the state trajectory lives here, whether or not a file is written.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wbmpc.signals import PlanReport, RobotState, Setpoint, TorqueCommand, Truth
from wbmpc.timing import LoopTiming


class RobotDimensions(Protocol):
    """What the recorder asks of a robot: the sizes of its vectors."""

    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def nj(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth a line in the log."""

    time: float  # [s]
    text: str


@dataclass(frozen=True, slots=True)
class Contacts:
    """Contacts of one tick, or of all ticks one after another: c rows."""

    geoms: NDArray[np.int32]  # (c, 2) MuJoCo geom ids
    position: NDArray[np.float64]  # (c, 3) [m] in world
    force: NDArray[np.float64]  # (c, 3) [N] in world, on the robot
    distance: NDArray[np.float64]  # (c,) [m] negative: penetration


# Shapes of the recorded fields; "q", "v", "j" stand for the robot's nq, nv, nj, "Q" and "V" for the whole plant's.
# Units and frames are those of wbmpc.signals.
_Layout = dict[str, tuple[tuple[int | str, ...], type]]
_TRUTH: _Layout = {
    "time": ((), float),
    "qpos": (("Q",), float),
    "qvel": (("V",), float),
    "torque": (("j",), float),
    "torque_limit": (("j",), float),
    "com": ((3,), float),
    "com_velocity": ((3,), float),
    "palm_position": ((2, 3), float),
    "sole_position": ((2, 3), float),
    "torso_up": ((), float),
    "external_force": ((3,), float),
    "zmp": ((2,), float),
    "contact_count": ((), int),
}
_STATE: _Layout = {
    "q": (("q",), float),
    "v": (("v",), float),
    "sole_wrench_in_world": ((2, 6), float),
    "palm_force_in_world": ((2, 3), float),
    "mass_scale": ((), float),
}
_SETPOINT: _Layout = {
    "com_position": ((3,), float),
    "com_velocity": ((3,), float),
    "com_acceleration": ((3,), float),
    "joint_position": (("j",), float),
    "joint_velocity": (("j",), float),
    "torso_rotation": ((3, 3), float),
    "torso_angular_velocity": ((3,), float),
    "foot_stance": ((2,), bool),
    "foot_position": ((2, 3), float),
    "foot_yaw": ((2,), float),
    "foot_yaw_rate": ((2,), float),
    "foot_velocity": ((2, 3), float),
    "foot_acceleration": ((2, 3), float),
    "hand_mode": ((2,), int),
    "hand_position": ((2, 3), float),
    "hand_velocity": ((2, 3), float),
    "hand_acceleration": ((2, 3), float),
    "hand_urgency": ((2,), float),
    "hand_force": ((2, 3), float),
    "hand_force_cap": ((2,), float),
    "hand_normal": ((2, 3), float),
    "hand_friction": ((2,), float),
    "arm_keep_out": ((2, 3, 5), float),
}
_COMMAND: _Layout = {
    "torque": (("j",), float),
    "acceleration": (("v",), float),
    "sole_wrench_in_world": ((2, 6), float),
    "palm_force_in_world": ((2, 3), float),
    "status": ((), int),
    "solve_time": ((), float),
    "fallback": ((), bool),
}
# Truth keeps its plain names ("com", "torque"); the controller's signals are prefixed ("state_q", "command_torque").
LAYOUT: tuple[tuple[type, str, _Layout], ...] = (
    (Truth, "", _TRUTH),
    (RobotState, "state_", _STATE),
    (Setpoint, "setpoint_", _SETPOINT),
    (TorqueCommand, "command_", _COMMAND),
)
_TRUTH_FIELDS, _STATE_FIELDS, _SETPOINT_FIELDS, _COMMAND_FIELDS = (attrgetter(*fields) for _, _, fields in LAYOUT)


class Recorder:
    """Everything a run leaves behind, as trimmed numpy views.

    Every name of `names` is an attribute of n rows, n the ticks so far: `recorder.time` (n,), `recorder.qpos` (n, nq),
    `recorder.setpoint_com_position` (n, 3), `recorder.command_status` (n,). A view shows the ticks up to the moment it
    was taken: take it anew rather than keep it.

    Args:
        robot: gives nq, nv and nj.
        expected_ticks: rows allocated at the start; more ticks are welcome and cost one copy at each doubling.
        plant_nq, plant_nv: sizes of `Truth.qpos` and `Truth.qvel`, when the world has free objects besides the robot.
    """

    def __init__(
        self,
        robot: RobotDimensions,
        *,
        expected_ticks: int,
        plant_nq: int | None = None,
        plant_nv: int | None = None,
    ) -> None:
        size = {"Q": plant_nq or robot.nq, "V": plant_nv or robot.nv, "q": robot.nq, "v": robot.nv, "j": robot.nj}
        self._capacity = max(1, expected_ticks)
        row = [
            (prefix + name, kind, tuple(size[s] if isinstance(s, str) else s for s in shape))
            for _, prefix, fields in LAYOUT
            for name, (shape, kind) in fields.items()
        ]
        self._table = np.zeros(self._capacity, np.dtype(row, align=True))
        self._row = np.zeros((), self._table.dtype)
        self._cells = tuple(self._row[name] for name in self.names)
        self._qpos, self._qvel = self._row["qpos"].data, self._row["qvel"].data  # bytes for the hash
        self._contact_capacity = 12 * self._capacity
        self._contact_total = 0
        self._contacts = self._allocate_contacts(self._contact_capacity)
        self._ticks = 0
        self._hash = hashlib.sha256()
        self.plans: list[PlanReport] = []
        self.events: list[Event] = []
        self.timing = LoopTiming(expected_ticks=expected_ticks)  # filled by the loop; wall times, never compared

    # ---------------------------------------------------------------- writing

    def append(self, truth: Truth, state: RobotState, setpoint: Setpoint, command: TorqueCommand) -> None:
        """Store one tick.

        Raises:
            ValueError: on the first tick, when a value's shape is not the declared one (numpy would broadcast it).
        """
        k = self._ticks
        values = _TRUTH_FIELDS(truth) + _STATE_FIELDS(state) + _SETPOINT_FIELDS(setpoint) + _COMMAND_FIELDS(command)
        if k == 0:
            self._check_shapes(values)
        elif k == self._capacity:
            self._grow()
        for cell, value in zip(self._cells, values, strict=True):
            cell[...] = value
        self._table[k] = self._row
        self._append_contacts(truth)
        # The row's cells, not the caller's arrays: always contiguous float64, so equal states give equal bytes.
        self._hash.update(self._qpos)
        self._hash.update(self._qvel)
        self._ticks = k + 1  # last: a reader in another thread never sees a half-written row

    def append_plan(self, plan: PlanReport) -> None:
        """Store one plan; its events join the run's events at the plan's time."""
        self.plans.append(plan)
        for text in plan.events:
            self.event(plan.time, text)

    def event(self, time: float, text: str) -> None:
        """Note that something happened at `time` [s]."""
        self.events.append(Event(time, text))

    # ---------------------------------------------------------------- reading

    @property
    def ticks(self) -> int:
        """Number of ticks stored so far."""
        return self._ticks

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns, each an attribute of the recorder."""
        return tuple(self._table.dtype.names or ())

    @property
    def state_sha256(self) -> str:
        """Hex digest over (qpos, qvel) of every tick so far, in order, as native float64 bytes."""
        return self._hash.hexdigest()

    def column(self, name: str) -> NDArray[Any]:
        """Column `name`, (ticks, ...), a read-only view.

        Raises:
            KeyError: with the choices, when there is no such column.
        """
        if name not in self.names:
            raise KeyError(f"no column {name!r}; choose one of {', '.join(self.names)}")
        view: NDArray[Any] = self._table[name][: self._ticks]
        view.flags.writeable = False
        return view

    def __getattr__(self, name: str) -> NDArray[Any]:
        # Only called when ordinary lookup fails; underscored names must fail fast (copy and pickle probe for them).
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self.column(name)
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> Iterable[str]:
        return [*super().__dir__(), *self.names]

    @property
    def contacts(self) -> Contacts:
        """Contacts of all ticks, in order of time; `contact_tick` gives the tick of each row."""
        total, table = int(self.contact_count.sum()), self._contacts
        return Contacts(table.geoms[:total], table.position[:total], table.force[:total], table.distance[:total])

    @property
    def contact_tick(self) -> NDArray[np.int64]:
        """(c,) tick index of each row of `contacts`."""
        return np.repeat(np.arange(self._ticks), self.contact_count)

    def contacts_at(self, tick: int) -> Contacts:
        """Contacts of one tick."""
        return self.contacts_of([tick])

    def contacts_of(self, ticks: Sequence[int] | NDArray[np.integer]) -> Contacts:
        """Contacts of the given ticks one after another; `contact_count[ticks]` says how many belong to each."""
        ends = np.cumsum(self.contact_count)
        rows = [np.arange(ends[k] - self.contact_count[k], ends[k]) for k in ticks]
        index = np.concatenate(rows) if rows else np.zeros(0, np.int64)
        table = self._contacts
        return Contacts(table.geoms[index], table.position[index], table.force[index], table.distance[index])

    # ---------------------------------------------------------------- inside

    @staticmethod
    def _allocate_contacts(rows: int) -> Contacts:
        return Contacts(np.zeros((rows, 2), np.int32), np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros(rows))

    def _append_contacts(self, truth: Truth) -> None:
        count = truth.contact_count
        start, stop = self._contact_total, self._contact_total + count
        if stop > self._contact_capacity:
            self._grow_contacts()
        table = self._contacts
        table.geoms[start:stop] = truth.contact_geoms[:count]
        table.position[start:stop] = truth.contact_position[:count]
        table.force[start:stop] = truth.contact_force[:count]
        table.distance[start:stop] = truth.contact_distance[:count]
        self._contact_total = stop

    def _check_shapes(self, values: tuple[Any, ...]) -> None:
        for name, cell, value in zip(self.names, self._cells, values, strict=True):
            if np.shape(value) != cell.shape:
                raise ValueError(f"{name}: got shape {np.shape(value)}, expected {cell.shape}")

    def _grow(self) -> None:
        self._table = np.concatenate([self._table, np.zeros_like(self._table)])
        self._capacity *= 2

    def _grow_contacts(self) -> None:
        old, rows = self._contacts, self._contact_capacity
        # At least one tick's worth of room, however small the table was.
        new = self._allocate_contacts(2 * rows + 1000)
        new.geoms[:rows], new.position[:rows], new.force[:rows] = old.geoms, old.position, old.force
        new.distance[:rows] = old.distance
        self._contacts, self._contact_capacity = new, 2 * rows + 1000
