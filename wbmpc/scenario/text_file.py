"""Reading a text file that may be anything: absent, huge, binary, a directory."""

from __future__ import annotations

from pathlib import Path

from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario.wording import near_misses

MAX_BYTES = 200_000  # a scenario is a page or two; more is a mistake, and parsing it would take many seconds


def read_text(path: Path, name: str) -> str:
    """The text of a UTF-8 file; `name` is what messages call it.

    Raises:
        ScenarioError: there is no such regular file, it is too large, or it is not UTF-8 text.
    """

    def fail(message: str) -> ScenarioError:
        return ScenarioError([Problem(name, message)])

    try:
        if path.is_dir():
            raise fail("is a directory, expected a scenario file")
        if not path.exists():
            siblings = [p.name for p in path.parent.glob("*.y*ml")] if path.parent.is_dir() else []
            raise fail("no such file" + near_misses(path.name, siblings))
        if not path.is_file():
            raise fail("is not a regular file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise fail(f"is too large for a scenario: {size / 1e3:.0f} kB, at most {MAX_BYTES / 1e3:.0f} kB")
        raw = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the file's name
        raise fail(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8", errors="replace")
        problem = f"not a UTF-8 text file (byte 0x{raw[error.start]:02x})"
        raise ScenarioError([Problem(f"{name}:{line_and_column(before, len(before))}", problem)]) from None
    if "\0" in text:
        raise ScenarioError(
            [Problem(f"{name}:{line_and_column(text, text.index(chr(0)))}", "not a text file (NUL byte)")]
        )
    return text


def line_and_column(text: str, index: int) -> str:
    """The place of a character of a text, as "LINE:COLUMN", both from 1."""
    before = text[:index]
    return f"{before.count(chr(10)) + 1}:{index - before.rfind(chr(10))}"
