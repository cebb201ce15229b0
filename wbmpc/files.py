"""Files that a user asks for, which may be impossible to write."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wbmpc.errors import WbmpcError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """The file `path` is written inside; its folder is made when there is none.

    Raises:
        WbmpcError: as `prepare`, or the file cannot be written.
    """
    prepare(path)
    try:
        yield
    except OSError as error:
        raise WbmpcError(f"cannot write {path}: {_reason(error)}") from error


def prepare(path: Path) -> None:
    """Make the folder of a file that will be written after long work.

    Raises:
        WbmpcError: the folder cannot be made, or there is a folder in the file's place.
    """
    _make(path.parent, f"cannot write {path}")
    if path.is_dir():
        raise WbmpcError(f"cannot write {path}: it is a folder")


def make_folder(folder: Path, option: str = "--out") -> None:
    """Make the folder that an option names, with those above it. Raises WbmpcError when that is impossible."""
    _make(folder, f"{option} {folder}")


def _make(folder: Path, what: str) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        place = next(above for above in (folder, *folder.parents) if above.exists() and not above.is_dir())
        raise WbmpcError(f"{what}: {place} is no folder") from error
    except OSError as error:
        raise WbmpcError(f"{what}: {_reason(error)}") from error


def _reason(error: OSError) -> str:
    return error.strerror or (str(error).strip().splitlines() or ["nobody says why"])[-1]
