"""Errors that a user can cause; everything else that escapes is a defect of the program.

The command line prints `str(error)` and exits with `error.exit_code`; it never shows a traceback for these.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class WbmpcError(Exception):
    """Bad input: its text says what was given, what was expected, and the choices."""

    exit_code = 2


class RobotError(WbmpcError):
    """A robot model (MJCF) that cannot be read or that breaks the model contract."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake in a scenario, with the place where the user can mend it."""

    place: str  # "reach.yaml:14:26", "--set tasks.0.tarjet", or "reach.yaml" when there is no line
    message: str  # "world.objects.table.frction: unknown key, did you mean 'friction'?"
    excerpt: str = ""  # the offending source line and, under it, a caret; empty when there is no line

    def __str__(self) -> str:
        # Keys and values come from the user and may hold line breaks; a problem is always one line.
        text = f"{self.place}: {self.message}"
        return "".join(character if character.isprintable() else repr(character)[1:-1] for character in text)


class ScenarioError(WbmpcError):
    """A scenario that cannot be read or is not valid.

    `str(error)` has one line per problem, in the order of the file; `problems[i].excerpt` shows the source line.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[tuple[Problem, ...]]]:
        # The default rebuilds an exception from its text, which would break it on its way out of a worker process.
        return type(self), (self.problems,)
