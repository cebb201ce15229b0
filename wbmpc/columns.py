"""What a recorder keeps of each signal, and the tables that it is kept in.

What really happened is kept of every tick, because checks judge it; what the controller saw and wanted is kept as
often as the recording shows it. A row is put together from the bytes of its values and copied into a preallocated table
that doubles when full: nothing is formatted or logged in the hot loop, and one place in memory is written, not one for
each column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.signals import RobotState, Setpoint, TorqueCommand, Truth

# Shapes of the recorded fields; "q", "v", "j" stand for the robot's nq, nv, nj, "Q" and "V" for the whole plant's.
# Units and frames are those of wbmpc.signals.
Layout = dict[str, tuple[tuple[int | str, ...], type]]
_TRUTH: Layout = {
    "time": ((), float),
    "qpos": (("Q",), float),
    "qvel": (("V",), float),
    "torque": (("j",), float),
    "torque_limit": (("j",), float),
    "com": ((3,), float),
    "com_velocity": ((3,), float),
    "angular_momentum": ((3,), float),
    "palm_position": ((2, 3), float),
    "sole_position": ((2, 3), float),
    "torso_up": ((), float),
    "external_force": ((3,), float),
    "zmp": ((2,), float),
    "contact_count": ((), int),
}
_STATE: Layout = {
    "q": (("q",), float),
    "v": (("v",), float),
    "sole_wrench_in_world": ((2, 6), float),
    "palm_force_in_world": ((2, 3), float),
    "mass_scale": ((), float),
}
_SETPOINT: Layout = {
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
_COMMAND: Layout = {
    "torque": (("j",), float),
    "acceleration": (("v",), float),
    "sole_wrench_in_world": ((2, 6), float),
    "palm_force_in_world": ((2, 3), float),
}
_OUTCOME: Layout = {
    "status": ((), int),
    "solve_time": ((), float),
    "fallback": ((), bool),
}
_CODES = {float: "d", int: "q", bool: "?"}  # of `struct`
# Truth keeps its plain names ("com", "torque"); the controller's signals are prefixed ("state_q", "command_torque").
Part = tuple[type, str, Layout]
EVERY_TICK: tuple[Part, ...] = ((Truth, "", _TRUTH), (TorqueCommand, "command_", _OUTCOME))
SAMPLED: tuple[Part, ...] = (
    (RobotState, "state_", _STATE),
    (Setpoint, "setpoint_", _SETPOINT),
    (TorqueCommand, "command_", _COMMAND),
)


class Table:
    """Named columns in one array of rows, which doubles when full.

    A row has the numbers first, then the arrays, those of truth values last: a C struct without gaps but at two ends,
    so that the bytes of its values, one after another, are its bytes.

    Args:
        parts: whose fields are the columns.
        sizes: of the vectors, by their letters in the layouts.
        rows: allocated at the start.
    """

    def __init__(self, parts: Iterable[Part], sizes: Mapping[str, int], rows: int) -> None:
        columns = [
            (prefix + name, kind, tuple(sizes[s] if isinstance(s, str) else s for s in shape))
            for _, prefix, fields in parts
            for name, (shape, kind) in fields.items()
        ]
        self.names = tuple(name for name, _, _ in columns)
        numbers = [i for i, (_, _, shape) in enumerate(columns) if not shape]
        arrays = [i for i, (_, _, shape) in enumerate(columns) if shape]
        arrays.sort(key=lambda i: columns[i][1] is bool)
        self._numbers, self._arrays = _picked(numbers), _picked(arrays)
        self._pack = Struct("".join(_CODES[columns[i][1]] for i in numbers) + "0q").pack
        self.rows = np.zeros(max(1, rows), np.dtype([columns[i] for i in (*numbers, *arrays)], align=True))
        self._bytes = bytes_of(self.rows)
        length = len(self._pack(*(0 for _ in numbers))) + sum(self.rows.dtype[columns[i][0]].itemsize for i in arrays)
        self._size = self.rows.itemsize
        self._gap = bytes(self._size - length)

    def put(self, k: int, values: tuple[Any, ...]) -> bytes:
        """Store row k, which is in the table or the next one after it, and return it; the first one is checked.

        Args:
            values: in the order of `names`; arrays contiguous.

        Raises:
            ValueError: a value's shape or type is not the declared one, an array is not contiguous.
        """
        if k == 0:
            self._check(values)
        elif k == len(self.rows):
            self.rows = np.concatenate([self.rows, np.zeros_like(self.rows)])
            self._bytes = bytes_of(self.rows)
        row = b"".join((self._pack(*self._numbers(values)), *self._arrays(values), self._gap))
        size = self._size
        self._bytes[k * size : (k + 1) * size] = row
        return row

    def bytes_of(self, first: str, last: str) -> slice:
        """Where the columns from `first` to `last`, neighbours in a row, are in what `put` returns."""
        fields = self.rows.dtype.fields
        assert fields is not None
        return slice(fields[first][1], fields[last][1] + fields[last][0].itemsize)

    def _check(self, values: tuple[Any, ...]) -> None:
        for name, value in zip(self.names, values, strict=True):
            declared, given = self.rows.dtype[name], np.asarray(value)
            if given.shape != declared.shape:
                raise ValueError(f"{name}: got shape {given.shape}, expected {declared.shape}")
            if declared.shape and not (given.dtype == declared.base and given.flags.c_contiguous):
                layout = "" if given.flags.c_contiguous else ", strided"
                raise ValueError(f"{name}: got {given.dtype}{layout}, expected {declared.base}, contiguous")


def _picked(indices: Sequence[int]) -> Callable[[tuple[Any, ...]], Iterable[Any]]:
    """Takes the values of these indices out of a tuple; of fewer than two, `itemgetter` makes no tuple."""
    return itemgetter(*indices) if len(indices) > 1 else lambda values: [values[i] for i in indices]


def bytes_of(rows: NDArray[Any]) -> memoryview:
    """The same memory as bytes."""
    return rows.view(np.uint8).data
