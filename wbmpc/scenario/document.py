"""A parsed file together with the line and column of every key and value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wbmpc.errors import Problem
from wbmpc.scenario.wording import KeyPath, dotted_path


@dataclass(frozen=True, slots=True)
class Mark:
    """A position in a text, both counted from 0."""

    line: int
    column: int


@dataclass(frozen=True)
class Document:
    """A parsed file: plain data, and where each part of it stands."""

    name: str  # as the user gave it
    text: str
    data: Any
    key_marks: dict[KeyPath, Mark] = field(default_factory=dict)
    value_marks: dict[KeyPath, Mark] = field(default_factory=dict)

    def mark(self, path: KeyPath, *, at_key: bool = False) -> Mark:
        """Where `path` stands: its key or its value, or the nearest ancestor that the file has."""
        for end in range(len(path), -1, -1):
            first, second = (self.key_marks, self.value_marks) if at_key else (self.value_marks, self.key_marks)
            mark = first.get(path[:end]) or second.get(path[:end])
            if mark:
                return mark
            at_key = True  # the part itself is absent: point at the name of the block where it belongs
        return Mark(0, 0)

    def problem(self, path: KeyPath, message: str, *, at_key: bool = False) -> Problem:
        """A problem at `path`, placed as `mark` says."""
        dotted = dotted_path(path)
        return self.problem_at(self.mark(path, at_key=at_key), f"{dotted}: {message}" if dotted else message)

    def problem_at(self, mark: Mark, message: str) -> Problem:
        """A problem at a position in the text."""
        return located_problem(self.name, self.text, mark, message)


def located_problem(name: str, text: str, mark: Mark, message: str) -> Problem:
    """A problem with its source line and a caret under the column; a long line is cut around the column."""
    lines = text.splitlines()
    source = lines[mark.line] if mark.line < len(lines) else ""
    start = max(0, mark.column - 100)
    indent = "".join("\t" if character == "\t" else " " for character in source[start : mark.column])
    excerpt = f"{source[start : start + 160].rstrip()}\n{indent}^"
    return Problem(f"{name}:{mark.line + 1}:{mark.column + 1}", message, excerpt if source else "")
