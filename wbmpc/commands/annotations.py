"""Annotations of GitHub Actions: a line of standard output that shows a message beside a line of a file.

Syntax: GitHub's documentation, "Workflow commands for GitHub Actions"; escapes as in its toolkit (packages/core).
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

from wbmpc.errors import ScenarioError

_IN_MESSAGE = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_IN_PROPERTY = {**_IN_MESSAGE, ":": "%3A", ",": "%2C"}


@dataclass(frozen=True, slots=True)
class Annotation:
    """One error and its place; `str()` is the workflow command."""

    title: str
    message: str
    file: str = ""  # empty: of no file
    line: int = 0  # from 1, as are columns; 0: of no line
    column: int = 0

    def __str__(self) -> str:
        place = {"file": _from_the_repository(self.file), "line": self.line, "col": self.column, "title": self.title}
        properties = ",".join(f"{key}={_escaped(str(value), _IN_PROPERTY)}" for key, value in place.items() if value)
        return f"::error {properties}::{_escaped(self.message, _IN_MESSAGE)}"


def asked_for() -> bool:
    """Whether standard output is read by GitHub Actions."""
    return os.environ.get("GITHUB_ACTIONS") == "true"


def announce(annotations: Iterable[Annotation]) -> None:
    """Print them where they are asked for."""
    if asked_for():
        for annotation in annotations:
            print(annotation, flush=True)


def annotations_of_problems(error: ScenarioError) -> list[Annotation]:
    """One for each mistake in a scenario, at its line; of no file where an option of the command is to blame."""
    return [_of_problem(problem.place, str(problem), problem.message) for problem in error.problems]


def _of_problem(place: str, text: str, message: str) -> Annotation:
    title = "scenario is not valid"
    file, *numbers = place.rsplit(":", 2)
    if len(numbers) == 2 and all(number.isdigit() for number in numbers):
        return Annotation(title, message, file, int(numbers[0]), int(numbers[1]))
    return Annotation(title, text)


def _from_the_repository(file: str) -> str:
    """Paths are shown relative to the checkout, wherever the command runs."""
    root = os.environ.get("GITHUB_WORKSPACE")
    if not file or not root:
        return file
    inside = os.path.relpath(os.path.realpath(file), os.path.realpath(root))
    return file if inside.startswith(os.pardir) else inside


def _escaped(text: str, replaced: dict[str, str]) -> str:
    return "".join(replaced.get(character, character) for character in text)
