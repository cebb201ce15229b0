"""Scenario files as tests of pytest: an item for the run that a file describes, one for each of its counterfactuals.

The hooks of `pytest --wbmpc`; `pytest_wbmpc.py`, outside this package, registers them.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Generator, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from wbmpc.commands.annotations import Annotation, annotations_of_problems, announce
from wbmpc.commands.ci import Entry, annotations_of, append_summary, entry_of
from wbmpc.commands.exits import ExitCode
from wbmpc.commands.one_run import Job, Outcome, carry_out
from wbmpc.commands.run import RunOptions, jobs_of
from wbmpc.commands.tables import checks_table, plain_text
from wbmpc.errors import ScenarioError, WbmpcError
from wbmpc.files import make_folder
from wbmpc.scenario import parse_overrides
from wbmpc.scenario.text_file import MAX_BYTES
from wbmpc.scenario.yaml_reader import read_document
from wbmpc.versions import versions

SUFFIXES = ("yaml", "yml")
# Of these keys a scenario has three and hardly another YAML file two; one may be mistyped.
_TELLING = re.compile(rb"^(duration|tasks|checks)[ \t]*:", re.MULTILINE)
_OPTIONS = pytest.StashKey[RunOptions]()
_NAMED = pytest.StashKey[dict[str, Path]]()  # scenario name -> file
MARKERS = (
    "scenario: the run that a scenario file describes (wbmpc)",
    "counterfactual: a changed run of a scenario, with the outcome that it must have (wbmpc)",
)


def configure(config: pytest.Config) -> None:
    """Take the options and register the hooks below.

    Raises:
        pytest.UsageError: a `--wbmpc-set` that is not KEY=VALUE.
    """
    try:
        overrides = parse_overrides(config.getoption("--wbmpc-set"))
    except ScenarioError as error:
        raise pytest.UsageError(str(error).replace("--set", "--wbmpc-set")) from None
    config.stash[_OPTIONS] = RunOptions(
        out=Path(config.getoption("--wbmpc-out")),
        overrides=overrides,
        seed=None,
        realtime=False,
        record=not config.getoption("--wbmpc-no-record"),
        counterfactuals=True,
        jobs=None,
        debug=False,
    )
    config.stash[_NAMED] = {}
    for marker in MARKERS:
        config.addinivalue_line("markers", marker)
    config.pluginmanager.register(Hooks(), "wbmpc_scenarios")


class Hooks:
    """What pytest calls."""

    def pytest_report_header(self, config: pytest.Config) -> str:
        found = versions()
        results = config.stash[_OPTIONS].out
        return f"wbmpc: {found['wbmpc']}, mujoco {found['mujoco']}, pin {found['pin']}; results in {results}"

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
        """A file that is named on the command line, whatever it holds; in a folder what looks like a scenario."""
        if file_path.suffix.removeprefix(".") not in SUFFIXES:
            return None
        if not (parent.session.isinitpath(file_path) or looks_like_scenario(file_path)):
            return None
        collector: ScenarioFile = ScenarioFile.from_parent(parent, path=file_path)
        return collector

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> Generator[None, Any, Any]:
        """What pytest-xdist carries from a worker is what a report has as an attribute."""
        report = yield
        if isinstance(collector, ScenarioFile) and collector.annotations:
            report.wbmpc_annotations = [asdict(annotation) for annotation in collector.annotations]
        return report

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
        report = yield
        if isinstance(item, ScenarioItem) and item.outcome is not None and call.when == "call":
            report.wbmpc_annotations = [asdict(note) for note in annotations_of(item.job, item.outcome)]
            report.wbmpc_entry = asdict(entry_of(item.job, item.outcome))
        return report

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """In CI: annotations and the summary, from the process that hears of all runs."""
        if hasattr(terminalreporter.config, "workerinput"):  # a worker of pytest-xdist
            return
        found = (report for group in terminalreporter.stats.values() for report in group if hasattr(report, "nodeid"))
        reports = sorted(found, key=lambda report: report.nodeid)
        terminalreporter.ensure_newline()  # a workflow command is one only at the beginning of a line
        for report in reports:
            announce(Annotation(**note) for note in getattr(report, "wbmpc_annotations", ()))
        entries = [report.wbmpc_entry for report in reports if hasattr(report, "wbmpc_entry")]
        append_summary([Entry(tuple(entry["cells"]), entry["detail"]) for entry in entries])


def looks_like_scenario(path: Path) -> bool:
    """Whether a YAML file is worth reading: at least two of a scenario's obligatory keys begin a line."""
    try:
        with path.open("rb") as file:
            return len(set(_TELLING.findall(file.read(MAX_BYTES)))) >= 2
    except OSError:
        return False


class ScenarioFile(pytest.File):
    """One scenario file; a mistake in it is a collection error with file, line and column."""

    annotations: list[Annotation]

    def collect(self) -> Iterator[ScenarioItem]:
        self.annotations = []
        path = _short(self.path)
        try:
            jobs = jobs_of(path, self.config.stash[_OPTIONS])
            document = read_document(path)
        except WbmpcError as error:
            if isinstance(error, ScenarioError):
                self.annotations = annotations_of_problems(error)
            raise self.CollectError(str(error)) from None
        name = jobs[0].scenario.name
        first = self.config.stash[_NAMED].setdefault(name, self.path)
        if first != self.path:
            raise self.CollectError(
                f"{path}: {_short(first)} is named {name!r}, too: their results would overwrite each other"
            )
        for job in jobs:
            mark = document.mark(("counterfactuals", job.variant) if job.variant else ("name",), at_key=True)
            yield ScenarioItem.from_parent(self, name=job.variant or name, job=job, line=mark.line)


class ScenarioItem(pytest.Item):
    """One run; fails with the table of failed checks and the command that makes it again."""

    def __init__(self, *, job: Job, line: int, **rest: Any) -> None:
        super().__init__(**rest)
        self.job, self._line = job, line
        self.outcome: Outcome | None = None
        self.add_marker("counterfactual" if job.variant else "scenario")
        # For -k: what the scenario is about.
        self.extra_keyword_matches |= {task.kind for task in job.scenario.tasks} | {job.scenario.robot}

    def reportinfo(self) -> tuple[Path, int, str]:
        """The place in the file, and what it is called there."""
        return self.path, self._line, f"{self.path.stem}: {self.name}"

    def setup(self) -> None:
        """Raises WbmpcError when the folder of the results cannot be made."""
        make_folder(self.job.out)
        self.job.remove_files()

    def runtest(self) -> None:
        """Raises RunFailed when the run did not end as its file declares."""
        with warnings.catch_warnings():  # the verdict is that of `wbmpc run`, whatever a project makes of warnings
            warnings.simplefilter("default")
            outcome = self.outcome = carry_out(self.job)
        self.user_properties += _properties(self.job, outcome)
        if outcome.code is not ExitCode.PASSED:
            raise RunFailed(outcome.line)
        if outcome.checks:
            self.add_report_section("call", "checks", plain_text(checks_table(self.job.name, outcome.checks)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What a reader needs to go on, and no traceback of this program."""
        if isinstance(excinfo.value, WbmpcError):
            return str(excinfo.value)
        if not isinstance(excinfo.value, RunFailed) or self.outcome is None:
            return super().repr_failure(excinfo, style)
        job, outcome = self.job, self.outcome
        wrong = [check for check in outcome.checks if not check.passed]
        shown = wrong or list(outcome.checks)  # a counterfactual that should have failed: what it passed with
        parts = [outcome.line, ""]
        if shown:
            title = f"{job.name}  (seed {outcome.seed}, {outcome.simulated_time:g} s simulated)"
            parts += [plain_text(checks_table(title, shown)), ""]
        parts += [f"recording: {path}" for path in [job.file("rrd")] if path.is_file()]
        parts += [f"reproduce: {job.command}"]
        if outcome.traceback and self.config.getoption("fulltrace"):
            parts += ["", outcome.traceback]
        return "\n".join(parts)


class RunFailed(Exception):
    """A run that did not end as its file declares."""


def _properties(job: Job, outcome: Outcome) -> list[tuple[str, object]]:
    """For --junitxml, by the names of NAME.json."""
    verdict = outcome.verdict
    if not verdict:
        return []
    files = [(kind, str(path)) for kind, path in (("verdict", job.file("json")), ("recording", job.file("rrd")))]
    return [
        ("state_sha256", verdict["state_sha256"]),
        ("seed", verdict["seed"]),
        *(found for found in files if Path(found[1]).is_file()),
        *((f"metrics.{name}", value) for name, value in verdict["metrics"].items()),
        *((f"checks.{check['name']}", check["value"]) for check in verdict["checks"]),
    ]


def _short(path: Path) -> Path:
    """Relative to the working directory, for messages and commands, where it is below."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
