"""A recording back into arrays: columns by entity, and the footage for pictures.

A file names no times but those of its samples; everything else (a plan, say) is looked up as the viewer does: the
latest row at or before the sample.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from wbmpc.errors import WbmpcError
from wbmpc.footage import Footage
from wbmpc.rerun_sink.palette import METRES_PER_NEWTON
from wbmpc.rerun_sink.stream import TIMELINE

FloatArray = NDArray[np.float64]


class Recording:
    """One .rrd file written by RerunSink, whole or cut short by a kill.

    Raises:
        WbmpcError: no such file, or not a recording of this project.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows: dict[tuple[str, str], list[tuple[NDArray[Any] | None, list[Any]]]] = {}
        for chunk in _chunks(path):
            batch = chunk.to_record_batch()
            columns = dict(zip(batch.schema.names, batch.columns, strict=True))
            time = columns.get(TIMELINE)
            stamps = None if time is None else time.to_numpy(zero_copy_only=False).astype(np.int64) / 1e9
            for name, values in columns.items():
                if ":" in name or chunk.is_static:
                    rows = self._rows.setdefault((chunk.entity_path, name.rsplit(":", 1)[-1]), [])
                    rows.append((stamps, values))
        if not self.static("/model", "mjb"):  # the first that a run writes
            raise WbmpcError(f"{path}: not a recording of wbmpc (it holds no model)")

    def column(self, entity: str, component: str) -> tuple[FloatArray, list[NDArray[Any]]]:
        """Times (n,) [s] and the n values of a component, in order of time: `column("/state/qpos", "scalars")`."""
        blocks = [(t, v) for t, v in self._rows.get((entity, component), []) if t is not None]
        times = np.concatenate([t for t, _ in blocks]) if blocks else np.zeros(0)
        values = [np.array(row or []) for _, block in blocks for row in block.to_pylist()]  # type: ignore[attr-defined]
        order = np.argsort(times, kind="stable")
        return times[order], [values[i] for i in order]

    def entities(self, component: str) -> list[str]:
        """Entities that have a component over time, in order of their names."""
        return sorted(
            entity
            for (entity, name), blocks in self._rows.items()
            if name == component and any(time is not None for time, _ in blocks)
        )

    def static(self, entity: str, component: str) -> list[Any]:
        """Value of a component that does not change; empty when it is not in the file."""
        blocks = [v for t, v in self._rows.get((entity, component), []) if t is None]
        return list(blocks[-1].to_pylist()[-1] or []) if blocks else []  # type: ignore[attr-defined]

    def words(self, entity: str, component: str) -> tuple[FloatArray, list[str]]:
        """Times (n,) [s] and texts: `words("/log/events", "text")`; "" where a row is empty."""
        times, rows = self.column(entity, component)
        return times, [str(row[0]) if len(row) else "" for row in rows]

    def properties(self, name: str) -> dict[str, Any]:
        """Named values of the whole file, as `Stream.properties` wrote them; empty when there are none."""
        entity = f"/__properties/{name}"
        names = [key for where, key in self._rows if where == entity and "." not in key]  # rerun's own have dots
        return {key: value[0] for key in names if (value := self.static(entity, key))}

    def footage(self) -> Footage:
        """Everything that pictures need.

        Raises:
            WbmpcError: the file holds no sample, or another MuJoCo release wrote the model.
        """
        model = self._model()
        time, qpos = self.column("/state/qpos", "scalars")
        if not len(time):
            raise WbmpcError(f"{self.path}: no samples; the run ended before the first block was written")
        com = self._at(time, "/world/com/measured", "positions")
        return Footage(
            model=model,
            time=time,
            qpos=np.array(qpos),
            com=np.array(com).reshape(len(time), 3),
            contact_position=self._at(time, "/world/contacts", "origins"),
            contact_force=[v / METRES_PER_NEWTON for v in self._at(time, "/world/contacts", "vectors")],
            support_polygon=self._at(time, "/world/support_polygon", "strips"),
        )

    def pushes(self, time: FloatArray) -> FloatArray:
        """(n, 3) [N] the declared disturbance, each sample at the nearest of `time` (n,) [s]."""
        stamps, vectors = self.column("/world/disturbance", "vectors")
        force = np.zeros((len(time), 3))
        for stamp, vector in zip(stamps, vectors, strict=True):
            if vector.size:
                force[np.abs(time - stamp).argmin()] = vector.reshape(-1, 3).sum(axis=0) / METRES_PER_NEWTON
        return force

    def _at(self, time: FloatArray, entity: str, component: str) -> list[FloatArray]:
        stamps, values = self.column(entity, component)
        latest = np.searchsorted(stamps, time + 1e-9, side="right") - 1
        return [np.asarray(values[k], float).reshape(-1, 3) if k >= 0 else np.zeros((0, 3)) for k in latest]

    def _model(self) -> Any:
        packed, release = self.static("/model", "mjb"), self.static("/model", "mujoco")
        if release != [mujoco.__version__]:
            raise WbmpcError(
                f"{self.path}: written with MuJoCo {release[0]}, this is {mujoco.__version__}; run it anew"
            )
        return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": zlib.decompress(bytes(packed[0]))})


def _chunks(path: Path) -> list[Any]:
    if not path.is_file():
        raise WbmpcError(f"{path}: a folder, not a recording" if path.is_dir() else f"no such recording: {path}")
    with whole_messages(path) as whole, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a killed run's file has no footer, which is no trouble here
        try:
            return list(RrdReader(whole).stream().to_chunks())
        except (RuntimeError, ValueError) as error:
            reason = str(error).splitlines()[0].removeprefix(f"Failed to read RRD file at {whole}: ")
            raise WbmpcError(f"{path}: not a readable recording ({reason})") from error


@contextmanager
def whole_messages(path: Path) -> Iterator[Path]:
    """The file, or a copy without the message that a kill cut short, for which strict readers refuse the whole file."""
    content = path.read_bytes()
    end = _end_of_messages(content)
    if end in (0, len(content)):
        yield path
        return
    with TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_bytes(content[:end])
        yield copy


_FILE_HEADER, _MESSAGE_HEADER = 12, struct.Struct("<QQ")  # kind and length of the payload that follows


def _end_of_messages(content: bytes) -> int:
    """Where the last message ends that is there to its end; 0 when `content` is not of a .rrd."""
    if not content.startswith(b"RRF2"):
        return 0
    end = _FILE_HEADER
    while end + _MESSAGE_HEADER.size <= len(content):
        _, length = _MESSAGE_HEADER.unpack_from(content, end)
        if end + _MESSAGE_HEADER.size + length > len(content):
            break
        end += _MESSAGE_HEADER.size + length
    return end
