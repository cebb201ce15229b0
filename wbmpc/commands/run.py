"""`wbmpc run`: scenarios and their counterfactuals, in parallel processes, and the files that they leave."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import JsonValue

from wbmpc.commands.ci import tell_ci
from wbmpc.commands.exits import ExitCode, say
from wbmpc.commands.one_run import Job, Outcome, broken, carry_out
from wbmpc.commands.progress import counted, simulated_time
from wbmpc.commands.summary import print_runs
from wbmpc.commands.tables import cause_lines, print_checks, timing_line
from wbmpc.errors import WbmpcError
from wbmpc.files import make_folder
from wbmpc.golden import Golden, read_golden
from wbmpc.junit import write_junit
from wbmpc.pool import Died, available_cores, finished
from wbmpc.scenario import Scenario, counterfactual, load_scenario


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of `wbmpc run`."""

    out: Path
    overrides: Mapping[str, JsonValue]  # by dotted path
    seed: int | None  # None: the scenario's own
    realtime: bool
    record: bool
    counterfactuals: bool
    jobs: int | None  # parallel processes; None: one per core, one for a real-time run
    debug: bool
    golden: Path | None = None  # folder of the golden results to compare with
    write_golden: Path | None = None  # folder of those to make
    view: bool = False  # open a rerun viewer and show the runs in it
    view_at: str | None = None  # address of one that is open


def run(paths: Sequence[Path], options: RunOptions) -> ExitCode:
    """Run every scenario and write its files. All are read before the first one runs.

    Raises:
        ScenarioError: a scenario or an override is not valid.
        WbmpcError: two scenarios would write the same files, a golden result is missing or not one, an output folder
            cannot be made, real-time runs were asked for in parallel, or there is no viewer where one was asked for.
    """
    if options.realtime and (options.jobs or 1) > 1:
        raise WbmpcError(f"--jobs {options.jobs}: real-time runs share no cores, run them one at a time")
    jobs = [job for path in paths for job in jobs_of(path, options)]
    names = [job.name for job in jobs]
    for name in names:
        if names.count(name) > 1:
            raise WbmpcError(f"two scenarios are named {name!r}: their results would overwrite each other")
    if options.write_golden is not None:
        make_folder(options.write_golden, "--write-golden")
    make_folder(options.out)
    if viewer := _viewer(options):
        jobs = [replace(job, viewer=viewer) for job in jobs]
    for job in jobs:
        job.remove_files()
    outcomes: dict[int, Outcome] = {}
    interrupted = False
    try:
        with closing(_outcomes(jobs, options)) as results:
            for index, outcome in results:
                outcomes[index] = outcome
                if options.debug and outcome.traceback:
                    say(outcome.traceback)
                # After every run: a killed session leaves what it has.
                write_junit(options.out / "junit.xml", [outcomes[k].suite for k in sorted(outcomes)])
    except KeyboardInterrupt:
        interrupted = True
    _report([(jobs[k], outcomes[k]) for k in sorted(outcomes)], single=len(jobs) == 1)
    tell_ci([(jobs[k], outcomes[k]) for k in sorted(outcomes)])
    if interrupted:
        say(f"interrupted: {len(outcomes)} of {len(jobs)} runs finished, their results are in {options.out}")
        return ExitCode.INTERRUPTED
    if len(jobs) > 1 and all(outcome.code is ExitCode.PASSED for outcome in outcomes.values()):
        print(f"PASS: all {len(jobs)} runs ended as declared", flush=True)
    return max(outcome.code for outcome in outcomes.values())


def jobs_of(path: Path, options: RunOptions) -> list[Job]:
    """The run of one scenario file, then those of its counterfactuals when asked for."""
    scenario = load_scenario(path, options.overrides, options.seed)
    rest = (options.out, options.record, options.realtime, options.overrides, options.seed)
    golden = _golden(scenario, options.golden), _golden_file(scenario, options.write_golden)
    jobs = [Job(scenario, "", None, *rest, *golden)]
    if options.counterfactuals:
        declared = scenario.counterfactuals.items()
        jobs += [Job(counterfactual(scenario, name), name, change, *rest) for name, change in declared]
    return jobs


def _viewer(options: RunOptions) -> str | None:
    """URL of the viewer that was asked for, which listens by now."""
    if options.view and options.view_at is not None:
        raise WbmpcError("--view opens a viewer, --view-at takes one that is open: give one of them")
    if not options.view and options.view_at is None:
        return None
    from wbmpc.rerun_sink.live import new_viewer, viewer_at

    return new_viewer() if options.view_at is None else viewer_at(options.view_at)


def _golden(scenario: Scenario, folder: Path | None) -> tuple[Path, Golden] | None:
    """A scenario's golden result, known before anything runs."""
    if folder is None:
        return None
    path = folder / f"{scenario.name}.json"
    golden = read_golden(path)
    if golden.seed != scenario.seed:
        raise WbmpcError(f"{path}: of seed {golden.seed}, this run has seed {scenario.seed}")
    return path, golden


def _golden_file(scenario: Scenario, folder: Path | None) -> Path | None:
    return None if folder is None else folder / f"{scenario.name}.json"


def _outcomes(jobs: Sequence[Job], options: RunOptions) -> Generator[tuple[int, Outcome], None, None]:
    """Index and outcome of every run, as they finish."""
    if len(jobs) == 1:
        # Before it says that it runs: Ctrl-C in the middle of some compiled module's import ends Python by the signal,
        # whatever exit code the command returns.
        import wbmpc.session  # noqa: F401

        with simulated_time(jobs[0].name, jobs[0].scenario.duration, log=True) as on_progress:
            outcome = carry_out(jobs[0], on_progress)
        yield 0, outcome
        return
    processes = options.jobs or (1 if options.realtime else available_cores())
    order = list(range(len(jobs)))
    if processes > 1:  # longest first: a long run that begins last would keep one core busy and the others waiting
        order.sort(key=lambda k: -jobs[k].scenario.duration)
    with (
        counted("runs", len(jobs), log=True) as advance,
        closing(finished(carry_out, [jobs[k] for k in order], jobs=processes)) as results,
    ):
        for place, result in results:
            index = order[place]
            outcome = broken(jobs[index], result.reason) if isinstance(result, Died) else result
            yield index, outcome  # kept before it is announced: Ctrl-C may come with the line
            advance(outcome.line)


def _report(ended: Sequence[tuple[Job, Outcome]], *, single: bool) -> None:
    """A single run: its checks. Several: a table of runs, then a line for each that went wrong."""
    if ended and not single:
        print_runs(ended)
    for job, outcome in ended:
        if single and outcome.checks:
            title = f"{job.name}  (seed {outcome.seed}, real-time factor {outcome.real_time_factor:.2f})"
            print_checks(title, outcome.checks)
        if job.realtime and outcome.timing:
            print(timing_line(job.name, outcome.timing), flush=True)
        wrong = outcome.code is not ExitCode.PASSED
        if single or wrong:
            print(outcome.line, flush=True)
        if wrong and outcome.triage:
            for line in cause_lines(outcome.triage, job.recording):
                print(f"  {line}", flush=True)
