"""What a recorder keeps of each signal, and the tables that it is kept in.

What really happened is kept of every tick, because checks judge it; what the controller saw and wanted is kept as
often as the recording shows it. A row is gathered in a small buffer and copied into a preallocated table that doubles
when full: nothing is formatted, logged or allocated in the hot loop, and one place in memory is written, not one for
each column.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

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

    Args:
        parts: whose fields are the columns, in this order.
        sizes: of the vectors, by their letters in the layouts.
        rows: allocated at the start.
    """

    def __init__(self, parts: Iterable[Part], sizes: Mapping[str, int], rows: int) -> None:
        columns = [
            (prefix + name, kind, tuple(sizes[s] if isinstance(s, str) else s for s in shape))
            for _, prefix, fields in parts
            for name, (shape, kind) in fields.items()
        ]
        self.rows = np.zeros(max(1, rows), np.dtype(columns, align=True))
        self.row = np.zeros((), self.rows.dtype)
        self.names = tuple(name for name, _, _ in columns)
        self._cells = tuple(self.row[name] for name in self.names)

    def put(self, k: int, values: tuple[Any, ...]) -> None:
        """Store row k, which is in the table or the next one after it; the first one's shapes are checked.

        Raises:
            ValueError: a value's shape is not the declared one (numpy would broadcast it).
        """
        if k == 0:
            self._check_shapes(values)
        elif k == len(self.rows):
            self.rows = np.concatenate([self.rows, np.zeros_like(self.rows)])
        for cell, value in zip(self._cells, values, strict=True):
            cell[...] = value
        self.rows[k] = self.row

    def _check_shapes(self, values: tuple[Any, ...]) -> None:
        for name, cell, value in zip(self.names, self._cells, values, strict=True):
            if np.shape(value) != cell.shape:
                raise ValueError(f"{name}: got shape {np.shape(value)}, expected {cell.shape}")
