"""One run as the page shows it, from whatever is there of it: recording, verdict, or both; whole or killed."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from wbmpc.counterfactuals import ending, objection
from wbmpc.errors import WbmpcError
from wbmpc.figures.panels import all_panels_of
from wbmpc.figures.trace import trace_of
from wbmpc.report.find import Source, Unreadable
from wbmpc.report.lanes import Lane, lanes_of
from wbmpc.report.pictures import Pictures, pictures_of
from wbmpc.report.plots import Plot, Span, Tick, plot_of, spans_of, ticks, time_range
from wbmpc.report.solver_times import SolverTimes, solver_times
from wbmpc.report.verdicts import Judgement, judgement_of, shown
from wbmpc.rerun_sink.documents import Table, parts_of
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import recorded_verdict
from wbmpc.scenario import Counterfactual

_FORMAT = "yaml"  # of the scenario
PASSED, FAILED, UNFINISHED = "passed", "failed", "unfinished"


@dataclass(frozen=True, slots=True)
class Firing:
    """One time that stage 3 fired."""

    time: float  # [s]
    title: str  # what came of it
    parts: Sequence[str | Table]  # what was asked, and the candidates


@dataclass(frozen=True, slots=True)
class Motion:
    """What a recording shows over time."""

    start: float  # [s]
    end: float  # [s]
    lanes: Sequence[Lane]
    plots: Sequence[Plot]
    spans: Sequence[Span]
    time_ticks: Sequence[Tick]


@dataclass(frozen=True, slots=True)
class Run:
    """A run."""

    folder: Path
    name: str
    verdict: Mapping[str, Any]  # content of NAME.json, or what the recording has of it; empty when it did not end
    judgement: Judgement | None
    motion: Motion | None = None
    pictures: Pictures | None = None
    events: Sequence[tuple[float, str]] = ()
    firings: Sequence[Firing] = ()
    solver: SolverTimes | None = None
    scenario: str = ""  # YAML; "" when it is not known
    experiments: Mapping[str, Counterfactual] = field(default_factory=dict)  # that the scenario declares
    commands: Sequence[tuple[str, str]] = ()  # what each is for, and how to repeat the run with it
    notes: Sequence[str] = ()  # what is missing here, and why
    undrawn: str = ""  # why there are no pictures of a motion
    objection: str | None = None  # a counterfactual's: what is wrong with how it ended
    declared: bool = False  # a counterfactual, and what it must lead to is known

    @property
    def parent(self) -> str:
        """The scenario of a counterfactual NAME.VARIANT; otherwise the run's own name."""
        return self.name.partition(".")[0]

    @property
    def variant(self) -> str:
        """Name of the counterfactual; "" of a scenario itself."""
        return self.name.partition(".")[2]

    @property
    def state(self) -> str:
        """Whether the run ended as it should."""
        if self.judgement is None:
            return UNFINISHED
        return PASSED if (self.objection is None if self.declared else self.judgement.passed) else FAILED

    @property
    def headline(self) -> str:
        """How it ended, in words."""
        if self.judgement is None:
            return f"{self.motion.end:.2f} s are recorded" if self.motion else "no motion is recorded"
        if self.objection is not None:
            return self.objection
        if self.declared:
            return f"{ending(self.judgement)}, as declared"
        return _values(self.judgement) if self.judgement.passed else ending(self.judgement)


def _values(judgement: Judgement) -> str:
    """What the checks of the scenario's own measured."""
    own = [check for check in judgement.checks if not check.universal]
    return ", ".join(f"{check.name} {shown(check.value)} {check.unit}".rstrip() for check in own) or "passes"


def read_run(source: Source, *, animation: bool) -> tuple[Run | None, list[Unreadable]]:
    """A run from its files; None when nothing of them can be read."""
    unreadable: list[Unreadable] = []
    recording = None
    if source.recording is not None:
        try:
            recording = Recording(source.recording)
        except WbmpcError as error:
            unreadable.append(Unreadable(source.recording, str(error).removeprefix(f"{source.recording}: ")))
    if recording is None and source.verdict is None:
        return None, unreadable
    verdict, notes = _verdict(source, recording)
    run = Run(
        folder=source.folder,
        name=source.name,
        verdict=verdict,
        judgement=judgement_of(verdict),
        solver=solver_times(verdict, recording),
        notes=notes,
    )
    return (run if recording is None else _with_recording(run, recording, animation=animation)), unreadable


def judged(runs: Sequence[Run]) -> list[Run]:
    """Counterfactuals judged by what their scenario's run, if it is among `runs`, declares of them."""
    parents = {(run.folder, run.name): run for run in runs}
    return [_judged(run, parents.get((run.folder, run.parent))) for run in runs]


def _judged(run: Run, parent: Run | None) -> Run:
    if not run.variant or parent is None or run.judgement is None or run.variant not in parent.experiments:
        return run
    return replace(run, declared=True, objection=objection(parent.experiments[run.variant], run.judgement))


def _verdict(source: Source, recording: Recording | None) -> tuple[Mapping[str, Any], list[str]]:
    """The verdict file's content; without one, the recording's."""
    recorded = _recorded_verdict(recording) if recording is not None else {}
    if source.verdict is None:
        return recorded, []
    notes = [] if source.recording else ["There is no recording of this run: no pictures and no curves."]
    hashes = [verdict.get("state_sha256") for verdict in (source.verdict, recorded)]
    if recording is not None and hashes[0] != hashes[1]:
        notes.append("The verdict file and the recording are of different runs: their state hashes differ.")
    return source.verdict, notes


def _recorded_verdict(recording: Recording) -> Mapping[str, Any]:
    """Empty when the run did not end."""
    if (whole := recorded_verdict(recording)) is not None:
        return whole
    verdict = recording.properties("verdict")  # of a recording older than that
    if verdict:
        verdict["metrics"] = recording.properties("metrics")
        verdict["versions"] = recording.properties("versions")
    return verdict


def _with_recording(run: Run, recording: Recording, *, animation: bool) -> Run:
    text = "".join(str(part) for part in recording.static("/scenario", "text"))
    scenario = text.removeprefix("~~~~yaml\n").removesuffix("\n~~~~")
    versions = recording.properties("versions")
    run = replace(
        run,
        verdict={"versions": versions, **recording.properties("run"), **run.verdict},
        events=[(float(t), word) for t, word in zip(*recording.words("/log/events", "text"), strict=True)],
        firings=list(_firings(recording)),
        scenario=scenario,
        experiments=_experiments(scenario),
        commands=_commands(run, recording, bool(scenario)),
    )
    try:
        footage = recording.footage()
    except WbmpcError as error:  # no sample yet, or another MuJoCo wrote it
        reason = str(error).removeprefix(f"{recording.path}: ")
        return replace(run, notes=[*run.notes, f"No curves and no pictures: {reason}."])
    trace = trace_of(recording, footage)
    start, end = time_range(trace.time)
    motion = Motion(
        start=start,
        end=end,
        lanes=lanes_of(recording, trace),
        plots=[plot_of(panel, trace) for panel in all_panels_of(trace)],
        spans=spans_of(trace),
        time_ticks=ticks(start, end, 10),
    )
    run = replace(run, motion=motion)
    try:
        return replace(run, pictures=pictures_of(footage, trace, animation=animation))
    except WbmpcError as error:
        return replace(run, undrawn=str(error), notes=[*run.notes, f"No pictures: {error}."])


def _firings(recording: Recording) -> Iterable[Firing]:
    for time, text in zip(*recording.words("/planner/candidates", "text"), strict=True):
        title, parts = parts_of(text)
        if any(isinstance(part, Table) for part in parts):
            yield Firing(float(time), title.partition(": ")[2], parts)


def _experiments(scenario: str) -> dict[str, Counterfactual]:
    """The counterfactuals of a scenario that this version may no longer accept as a whole."""
    try:
        document = YAML(typ="safe").load(scenario)
        declared = document.get("counterfactuals") if isinstance(document, dict) else None
        return {name: Counterfactual.model_validate(value, strict=False) for name, value in (declared or {}).items()}
    except (YAMLError, ValueError):
        return {}


def _commands(run: Run, recording: Recording, scenario: bool) -> list[tuple[str, str]]:
    commands = []
    if recording.static("/replay", "run"):
        commands.append(("the same run, compared bit by bit", f"wbmpc replay {shlex.quote(str(recording.path))}"))
    if scenario:
        commands.append(("the scenario below, saved", f"wbmpc run {shlex.quote(f'{run.name}.{_FORMAT}')}"))
    return commands
