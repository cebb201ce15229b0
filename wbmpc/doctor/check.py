"""A check, what it answers, and how a list of them is gone through."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

Subject = TypeVar("Subject")
MOST_NAMED = 4  # of many things that are wrong


class Status(StrEnum):
    """How serious an answer is."""

    OK = "ok"
    WARN = "warn"  # works, but perhaps not as wished
    FAIL = "fail"  # must be fixed
    SKIPPED = "skipped"  # needs something that another check finds missing


@dataclass(frozen=True, slots=True)
class Answer:
    """What a check found."""

    found: str  # when all is well
    failures: Sequence[str] = ()
    warnings: Sequence[str] = ()

    @property
    def status(self) -> Status:
        """The worst of it."""
        return Status.FAIL if self.failures else Status.WARN if self.warnings else Status.OK

    @property
    def text(self) -> str:
        """What is wrong, the worst first, or `found`."""
        wrong = [*self.failures, *self.warnings]
        more = len(wrong) - MOST_NAMED
        return "; ".join(wrong[:MOST_NAMED]) + (f"; and {more} more" if more > 0 else "") if wrong else self.found


@dataclass(frozen=True)
class Check(Generic[Subject]):
    """One question, and what to do when the answer is bad."""

    name: str
    look: Callable[[Subject], Answer]
    hint: str


@dataclass(frozen=True, slots=True)
class Finding:
    """One row of the report."""

    name: str
    status: Status
    found: str
    hint: str


class Missing(Exception):
    """A check needs something that is not there; its text says what."""


def examine(
    checks: Sequence[Check[Subject]], subject: Subject, on_done: Callable[[str], None] | None = None
) -> list[Finding]:
    """The finding of every check, in order; none can end the others. `on_done` is told the name of each."""
    findings = []
    for check in checks:
        findings.append(_finding(check, subject))
        if on_done is not None:
            on_done(check.name)
    return findings


def _finding(check: Check[Subject], subject: Subject) -> Finding:
    try:
        answer = check.look(subject)
    except Missing as missing:
        return Finding(check.name, Status.SKIPPED, f"needs {missing}", check.hint)
    except Exception as error:  # a model may be wrong in ways that nobody thought of: that is a finding, too
        first = (str(error).splitlines() or [""])[0]
        return Finding(check.name, Status.FAIL, f"cannot be looked at: {type(error).__name__}: {first}", check.hint)
    return Finding(check.name, answer.status, answer.text, check.hint)
