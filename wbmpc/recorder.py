"""In-memory columns of one run: the only source of the checks and of the recording file.

Columns are those of wbmpc/columns.py. Contacts vary in number, so they are kept ragged: one flat table of contacts, and
each tick's count.
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

from wbmpc.columns import EVERY_TICK, SAMPLED, Table, bytes_of
from wbmpc.signals import CONTACT, PlanReport, RobotState, Setpoint, TorqueCommand, Truth
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


_truth, _outcome = (attrgetter(*fields) for _, _, fields in EVERY_TICK)
_state, _setpoint, _command = (attrgetter(*fields) for _, _, fields in SAMPLED)


class Recorder:
    """Everything a run leaves behind, as trimmed numpy views.

    Every name of `names` is an attribute. What checks judge has n rows, n the ticks so far: `recorder.time` (n,),
    `recorder.qpos` (n, nq), `recorder.command_status` (n,). The controller's signals have a row for each of the m
    `sample_ticks`: `recorder.state_q` (m, nq), `recorder.setpoint_com_position` (m, 3). A view shows what was there at
    the moment it was taken: take it anew rather than keep it.

    Args:
        robot: gives nq, nv and nj.
        expected_ticks: rows allocated at the start; more ticks are welcome and cost one copy at each doubling.
        stride: ticks from one sample of the controller's signals to the next.
        plant_nq, plant_nv: sizes of `Truth.qpos` and `Truth.qvel`, when the world has free objects besides the robot.
    """

    def __init__(
        self,
        robot: RobotDimensions,
        *,
        expected_ticks: int,
        stride: int = 1,
        plant_nq: int | None = None,
        plant_nv: int | None = None,
    ) -> None:
        sizes = {"Q": plant_nq or robot.nq, "V": plant_nv or robot.nv, "q": robot.nq, "v": robot.nv, "j": robot.nj}
        self.stride = stride
        self._every = Table(EVERY_TICK, sizes, expected_ticks)
        self._sampled = Table(SAMPLED, sizes, -(-expected_ticks // stride))
        self.names = self._every.names + self._sampled.names  # of all columns, each an attribute of the recorder
        self._tables = {name: table for table in (self._every, self._sampled) for name in table.names}
        self._state = self._every.bytes_of("qpos", "qvel")
        self._contact_total = 0
        # In one piece, which the system gives page by page as it is written: most runs have fewer contacts.
        self._contact_rows = np.zeros(12 * max(1, expected_ticks), CONTACT)
        self._contacts, self._contact_bytes = _columns(self._contact_rows), bytes_of(self._contact_rows)
        self._ticks = 0
        self._hash = hashlib.sha256()
        self.plans: list[PlanReport] = []
        self.planned: list[tuple[RobotState, PlanReport]] = []  # those made from a snapshot of the run
        self.events: list[Event] = []
        self.timing = LoopTiming(expected_ticks=expected_ticks)  # filled by the loop; wall times, never compared

    # ---------------------------------------------------------------- writing

    def append(self, truth: Truth, state: RobotState, setpoint: Setpoint, command: TorqueCommand) -> None:
        """Store one tick.

        Raises:
            ValueError: on the first tick, when a value's shape is not the declared one.
        """
        k = self._ticks
        row = self._every.put(k, _truth(truth) + _outcome(command))
        if k % self.stride == 0:
            self._sampled.put(k // self.stride, _state(state) + _setpoint(setpoint) + _command(command))
        self._append_contacts(truth)
        self._hash.update(row[self._state])
        self._ticks = k + 1  # last: a reader in another thread never sees a half-written row

    def append_plan(self, plan: PlanReport, snapshot: RobotState | None = None) -> None:
        """Store one plan and what it was made from; its events join the run's events at the plan's time.

        The snapshot must not change afterwards. None: of a plan made before the run began.
        """
        self.plans.append(plan)
        if snapshot is not None:
            self.planned.append((snapshot, plan))
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
    def sample_ticks(self) -> NDArray[np.int64]:
        """(m,) ticks that the rows of the controller's signals belong to."""
        return np.arange(0, self._ticks, self.stride)

    @property
    def state_sha256(self) -> str:
        """Hex digest over (qpos, qvel) of every tick so far, in order, as native float64 bytes."""
        return self._hash.hexdigest()

    @property
    def states(self) -> NDArray[np.float64]:
        """(n, nq + nv) qpos and qvel of every tick side by side: what the hash is over. A read-only view."""
        view = _states(self._every.rows[: self._ticks])
        view.flags.writeable = False
        return view

    def column(self, name: str) -> NDArray[Any]:
        """Column `name`, (n, ...) or (m, ...), a read-only view.

        Raises:
            KeyError: with the choices, when there is no such column.
        """
        table = self._tables.get(name)
        if table is None:
            raise KeyError(f"no column {name!r}; choose one of {', '.join(self.names)}")
        rows = self._ticks if table is self._every else -(-self._ticks // self.stride)
        view: NDArray[Any] = table.rows[name][:rows]
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
        ticks, count = np.asarray(ticks, int), self.contact_count
        starts, lengths = (np.cumsum(count) - count)[ticks], count[ticks]
        before = np.cumsum(lengths) - lengths  # rows of the answer before each tick's
        index = np.repeat(starts - before, lengths) + np.arange(lengths.sum())
        table = self._contacts
        return Contacts(table.geoms[index], table.position[index], table.force[index], table.distance[index])

    # ---------------------------------------------------------------- inside

    def _append_contacts(self, truth: Truth) -> None:
        start = self._contact_total
        stop = start + len(truth.contacts)
        if stop > len(self._contact_rows):
            # At least one tick's worth of room, however small the table was.
            more = np.zeros(len(self._contact_rows) + 1000, CONTACT)
            self._contact_rows = np.concatenate([self._contact_rows, more])
            self._contacts, self._contact_bytes = _columns(self._contact_rows), bytes_of(self._contact_rows)
        size = CONTACT.itemsize  # as bytes: numpy copies structures field by field
        self._contact_bytes[start * size : stop * size] = truth.contacts.tobytes()
        self._contact_total = stop


def _columns(rows: NDArray[Any]) -> Contacts:
    return Contacts(rows["geoms"], rows["position"], rows["force"], rows["distance"])


def _states(rows: NDArray[Any]) -> NDArray[np.float64]:
    """qpos and qvel, which are neighbours in a row, as one array (n, nq + nv)."""
    qpos, qvel = rows["qpos"], rows["qvel"]
    first, second = (array.__array_interface__["data"][0] for array in (qpos, qvel))
    assert second == first + qpos[0].nbytes, "qvel follows qpos in a row"
    return np.lib.stride_tricks.as_strided(qpos, (len(rows), qpos.shape[1] + qvel.shape[1]))
