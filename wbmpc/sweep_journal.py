"""The journal of a sweep: a header and one JSON line per finished draw, so that a killed sweep goes on where it was."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wbmpc.errors import WbmpcError


class Journal:
    """Rows of the finished draws of one sweep.

    Args:
        path: the file; made when absent.
        header: what identifies the sweep.

    Raises:
        WbmpcError: the file belongs to another sweep, is no journal, or cannot be written.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        self.path = path
        self.rows: list[dict[str, Any]] = []
        try:
            complete = self._read(dict(header)) if path.exists() else b""
            if not complete:
                complete = _line({"sweep": dict(header)})
            # Written anew without the line that a kill may have cut in half.
            path.write_bytes(complete)
        except OSError as error:
            raise WbmpcError(f"{path}: {error.strerror}") from None

    def append(self, row: Mapping[str, Any]) -> None:
        """Add one finished draw; on disk when this returns."""
        with self.path.open("ab") as file:
            file.write(_line(row))
            file.flush()
            os.fsync(file.fileno())

    def remove(self) -> None:
        """The sweep is complete: nothing to resume."""
        self.path.unlink(missing_ok=True)

    def _read(self, header: dict[str, Any]) -> bytes:
        """Read rows into `self.rows`; the bytes of the complete lines."""
        complete = self.path.read_bytes()
        complete = complete[: complete.rfind(b"\n") + 1]
        if not complete:
            return b""
        try:
            found, *self.rows = (json.loads(line) for line in complete.splitlines())
            there = dict(found["sweep"])
        except (ValueError, KeyError, TypeError):
            raise WbmpcError(f"{self.path}: not the journal of a sweep; remove it to start anew") from None
        changed = [key for key in header if there.get(key) != header[key]]
        if changed:
            reason = f"its {', '.join(changed)} differ"
            raise WbmpcError(f"{self.path}: journal of another sweep ({reason}); remove it to start anew")
        return complete


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, allow_nan=False, ensure_ascii=False).encode() + b"\n"
