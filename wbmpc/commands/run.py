"""`wbmpc run`: scenarios, their counterfactuals, and the files that they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import JsonValue

from wbmpc.commands.exits import ExitCode, report_internal_error
from wbmpc.commands.progress import simulated_time
from wbmpc.commands.tables import final_line, print_checks
from wbmpc.counterfactuals import objection
from wbmpc.errors import WbmpcError
from wbmpc.junit import Case, Suite, case_of, write_junit
from wbmpc.recorder import Recorder
from wbmpc.scenario import Counterfactual, Scenario, counterfactual, load_scenario
from wbmpc.verdict import Verdict

LAST_STATES = 200  # ticks kept of a run that went non-finite


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of `wbmpc run`."""

    out: Path
    overrides: Mapping[str, JsonValue]  # by dotted path
    seed: int | None  # None: the scenario's own
    realtime: bool
    record: bool
    counterfactuals: bool
    debug: bool


@dataclass(frozen=True, slots=True)
class Job:
    """One run to make."""

    name: str  # names the files: NAME or NAME.COUNTERFACTUAL
    scenario: Scenario
    counterfactual: Counterfactual | None


def run(paths: Sequence[Path], options: RunOptions) -> ExitCode:
    """Run every scenario and write its files. All are read before the first one runs.

    Raises:
        ScenarioError: a scenario or an override is not valid.
        WbmpcError: two scenarios would write the same files, or the output folder cannot be made.
    """
    jobs = [job for path in paths for job in jobs_of(path, options)]
    names = [job.name for job in jobs]
    for name in names:
        if names.count(name) > 1:
            raise WbmpcError(f"two scenarios are named {name!r}: their results would overwrite each other")
    make_folder(options.out)
    suites: list[Suite] = []
    lines: list[str] = []
    code = ExitCode.PASSED
    for job in jobs:
        job_code, suite, line = _run_job(job, options)
        code = max(code, job_code)
        suites.append(suite)
        lines.append(line)
        write_junit(options.out / "junit.xml", suites)  # after every run: a killed session leaves what it has
    print("\n".join(lines), flush=True)
    return code


def jobs_of(path: Path, options: RunOptions) -> list[Job]:
    """The run of one scenario file, then those of its counterfactuals when asked for."""
    scenario = load_scenario(path, options.overrides, options.seed)
    jobs = [Job(scenario.name, scenario, None)]
    if options.counterfactuals:
        jobs += [
            Job(f"{scenario.name}.{name}", counterfactual(scenario, name), declared)
            for name, declared in scenario.counterfactuals.items()
        ]
    return jobs


def make_folder(folder: Path) -> None:
    """Make the output folder. Raises WbmpcError when that is impossible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WbmpcError(f"--out {folder}: {error.strerror}") from None


def _run_job(job: Job, options: RunOptions) -> tuple[ExitCode, Suite, str]:
    """Run, write NAME.json, print the table; the exit code, the junit suite and the final line."""
    from wbmpc.session import run_scenario  # MuJoCo, Pinocchio and the solvers: only when something runs

    recording = options.out / f"{job.name}.rrd" if options.record else None
    for suffix in ("json", "rrd", "traceback.txt"):  # results of an earlier run must not pass for this one's
        (options.out / f"{job.name}.{suffix}").unlink(missing_ok=True)
    try:
        with simulated_time(job.name, job.scenario.duration) as on_progress:
            result = run_scenario(
                job.scenario, name=job.name, recording=recording, realtime=options.realtime, on_progress=on_progress
            )
        result.verdict.write(options.out / f"{job.name}.json")
        dump_last_states(result.recorder, options.out / f"{job.name}.last_states.npz")
    except WbmpcError:
        raise
    except Exception as error:
        report_internal_error(error, options.out / f"{job.name}.traceback.txt", debug=options.debug)
        text = f"internal error: {type(error).__name__}: {error}"
        return ExitCode.INTERNAL_ERROR, Suite(job.name, 0.0, [Case("run", text)]), f"FAIL {job.name}: {text}"
    return _report(job, result.verdict, result.wall_time)


def dump_last_states(recorder: Recorder, path: Path) -> None:
    """Write the last ticks of a run whose state became non-finite; remove the file of an earlier run otherwise."""
    if np.isfinite(recorder.qpos).all() and np.isfinite(recorder.qvel).all() and np.isfinite(recorder.torque).all():
        path.unlink(missing_ok=True)
        return
    last = {name: recorder.column(name)[-LAST_STATES:] for name in ("time", "qpos", "qvel", "torque")}
    np.savez(path, allow_pickle=False, **last)


def _report(job: Job, verdict: Verdict, wall_time: float) -> tuple[ExitCode, Suite, str]:
    title = f"{job.name}  (seed {verdict.seed}, real-time factor {verdict.real_time_factor:.2f})"
    print_checks(title, verdict.checks)
    if job.counterfactual is None:
        failures = [check for check in verdict.checks if not check.passed]
        code = ExitCode.FAILED if failures else ExitCode.PASSED
        suite = Suite(job.name, wall_time, [case_of(check) for check in verdict.checks])
        return code, suite, final_line(job.name, failures)
    # A counterfactual is one test: whether the run ended as declared.
    wrong = objection(job.counterfactual, verdict)
    code = ExitCode.PASSED if wrong is None else ExitCode.FAILED
    outcome = "passes" if verdict.passed else f"fails {', '.join(verdict.failing)}"
    line = f"PASS {job.name}: {outcome}, as declared" if wrong is None else final_line(job.name, [], wrong)
    return code, Suite(job.name, wall_time, [Case("counterfactual", wrong)]), line
