"""What CI is told of finished runs, where its environment asks: annotations at lines, a summary in markdown."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from wbmpc.checks.result import CheckResult
from wbmpc.checks.settings import UniversalSettings
from wbmpc.commands.annotations import Annotation, announce
from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.one_run import Job, Outcome
from wbmpc.commands.summary import how_it_ended
from wbmpc.commands.tables import final_line, number
from wbmpc.errors import ScenarioError
from wbmpc.scenario.document import Document
from wbmpc.scenario.wording import KeyPath
from wbmpc.scenario.yaml_reader import read_document

# The columns of the summary: heading -> cell. A new one is a line here.
COLUMNS: dict[str, Callable[[Job, Outcome], str]] = {
    "": lambda job, outcome: "✅" if outcome.code is ExitCode.PASSED else "❌",
    "scenario": lambda job, outcome: job.scenario.name,
    "run": lambda job, outcome: job.variant,
    "expected": lambda job, outcome: job.expected,
    "values, or failing checks": lambda job, outcome: how_it_ended(outcome),
    "simulated [s]": lambda job, outcome: number(outcome.simulated_time),
    "wall [s]": lambda job, outcome: number(outcome.wall_time),
}


@dataclass(frozen=True, slots=True)
class Entry:
    """One run of the summary; plain text, since it travels between processes."""

    cells: tuple[str, ...]
    detail: str = ""  # markdown below the table; empty when all went well


def tell_ci(ended: Sequence[tuple[Job, Outcome]]) -> None:
    """Annotate the files of runs that went wrong, and append all runs to the summary."""
    announce(annotation for job, outcome in ended for annotation in annotations_of(job, outcome))
    append_summary([entry_of(job, outcome) for job, outcome in ended])


def annotations_of(job: Job, outcome: Outcome) -> list[Annotation]:
    """One for each failed check, at its line of the file; a counterfactual's at what the file expects of it."""
    if outcome.code is ExitCode.PASSED:
        return []
    name, file = job.name, job.scenario.source
    try:
        document = read_document(file)
    except ScenarioError:  # changed or gone since the run began
        return [Annotation(name, outcome.line, str(file))]
    if job.counterfactual is not None:
        path: KeyPath = ("counterfactuals", job.variant, "expect")
        return [_at(document, path, name, outcome.line.partition(": ")[2])]
    failing = [(index, check) for index, check in enumerate(outcome.checks) if not check.passed]
    if not failing:
        return [_at(document, (), name, outcome.line.partition(": ")[2])]
    return [_at(document, _path_of(index), f"{name}: {check.name}", _words(check)) for index, check in failing]


def entry_of(job: Job, outcome: Outcome) -> Entry:
    """The row of one run, and what to know of it when it went wrong."""
    cells = tuple(column(job, outcome) for column in COLUMNS.values())
    if outcome.code is ExitCode.PASSED:
        return Entry(cells)
    failing = [f"- {_plain(_words(check))}" for check in outcome.checks if not check.passed]
    blocks = [f"**{_plain(outcome.line)}**", "\n".join(failing), f"```sh\n{job.command}\n```"]
    return Entry(cells, "\n\n".join(block for block in blocks if block))


def append_summary(entries: Sequence[Entry]) -> None:
    """Append to the file that GITHUB_STEP_SUMMARY names, if it names one; that it cannot be written fails nothing."""
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if not path or not entries:
        return
    try:
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(markdown(entries))
    except OSError as error:
        say(f"no summary: GITHUB_STEP_SUMMARY={path}: {error.strerror}")


def markdown(entries: Sequence[Entry]) -> str:
    """A table of runs, those that went wrong first, and below it what is to know of these."""
    wrong = [entry for entry in entries if entry.detail]
    right = [entry for entry in entries if not entry.detail]
    lines = [f"### wbmpc: {len(right)} of {len(entries)} runs ended as declared", ""]
    lines += [_row(COLUMNS), _row("---" for _ in COLUMNS), *(_row(entry.cells) for entry in [*wrong, *right]), ""]
    lines += [f"{entry.detail}\n" for entry in wrong]
    return "\n".join(lines) + "\n"


def _path_of(index: int) -> KeyPath:
    """Where a file sets the check with this index among a run's: the universal ones come first."""
    universal = tuple(UniversalSettings.model_fields)
    if index < len(universal):
        return ("universal", universal[index])
    return ("checks", index - len(universal))


def _at(document: Document, path: KeyPath, title: str, message: str) -> Annotation:
    mark = document.mark(path, at_key=True)
    return Annotation(title, message, document.name, mark.line + 1, mark.column + 1)


def _words(check: CheckResult) -> str:
    when = "" if check.first_violation is None else f" (first at t = {check.first_violation:.3f} s)"
    return f"{final_line(check.name, [check]).partition(': ')[2]}: {check.message}{when}"


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(_plain(cell) for cell in cells)} |"


def _plain(text: str) -> str:
    """Text that markdown shows as it is, in one line."""
    escaped = "".join(f"\\{character}" if character in "\\|`*_<>[]" else character for character in text)
    return " ".join(escaped.split())
