"""Which runs a report is about: recordings and verdicts of the same name in the same folder are one run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wbmpc.errors import WbmpcError

RECORDING, VERDICT = ".rrd", ".json"


@dataclass(frozen=True, slots=True)
class Source:
    """The files of one run; at least one of them is there."""

    folder: Path
    name: str  # of the files, without suffix
    recording: Path | None = None
    verdict: Mapping[str, Any] | None = None  # content of NAME.json


@dataclass(frozen=True, slots=True)
class Unreadable:
    """A file that is no part of any run."""

    path: Path
    reason: str


def find_runs(paths: Sequence[Path]) -> tuple[list[Source], list[Unreadable]]:
    """Runs of files and folders, by folder and name, and the files that cannot be read.

    A folder gives all runs in it and below. Of a file, the verdict or recording beside it belongs to the run. What a
    folder holds besides (results of sweeps, say) is passed over; a file that is named itself must be a run's.

    Raises:
        WbmpcError: a path that does not exist.
    """
    found: dict[tuple[Path, str], Source] = {}
    unreadable: list[Unreadable] = []
    for path, named in _files(paths):
        key = path.parent, path.name.removesuffix(path.suffix)
        source = found.get(key, Source(*key))
        if path.suffix == RECORDING:
            found[key] = replace(source, recording=path)
            continue
        try:
            verdict = read_verdict(path)
        except WbmpcError as error:
            unreadable.append(Unreadable(path, str(error)))
            continue
        if verdict is not None:
            found[key] = replace(source, verdict=verdict)
        elif named:
            unreadable.append(Unreadable(path, "not the verdict of a run (it holds no checks)"))
    return [found[key] for key in sorted(found)], unreadable


def read_verdict(path: Path) -> dict[str, Any] | None:
    """The verdict in a JSON file; None when the file is something else.

    Raises:
        WbmpcError: the file cannot be read, or is no JSON.
    """
    try:
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise WbmpcError(error.strerror or str(error)) from error
    except json.JSONDecodeError as error:
        raise WbmpcError(f"line {error.lineno}, column {error.colno}: not JSON ({error.msg})") from error
    except ValueError as error:  # no text at all
        raise WbmpcError("not JSON (it is not UTF-8 text)") from error
    if isinstance(document, dict) and isinstance(document.get("checks"), list):
        return document
    return None


def _files(paths: Sequence[Path]) -> Iterable[tuple[Path, bool]]:
    """Every file once, and whether the user named it."""
    seen: dict[Path, bool] = {}
    for path in paths:
        if path.is_dir():
            inside = (
                file for file in sorted(path.rglob("*")) if file.suffix in (RECORDING, VERDICT) and file.is_file()
            )
            for file in inside:
                seen.setdefault(file, False)
        elif not path.exists():
            raise WbmpcError(f"no such file or folder: {path}")
        elif path.suffix not in (RECORDING, VERDICT):
            raise WbmpcError(
                f"{path}: neither a recording ({RECORDING}), nor a verdict ({VERDICT}), nor a folder of them"
            )
        else:
            seen[path] = True
            for suffix in (RECORDING, VERDICT):
                if (beside := path.with_suffix(suffix)).is_file():
                    seen.setdefault(beside, False)
    return seen.items()
