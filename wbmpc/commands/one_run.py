"""One run of `wbmpc run`, in this process or in a worker: the simulation, its files, and how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import JsonValue

from wbmpc.checks.result import CheckResult
from wbmpc.checks.settings import ScenarioCheck
from wbmpc.commands.exits import ExitCode, write_traceback
from wbmpc.commands.reproduce import run_command
from wbmpc.commands.tables import cause_lines, final_line, golden_words
from wbmpc.counterfactuals import ending, objection
from wbmpc.errors import WbmpcError
from wbmpc.files import writing
from wbmpc.golden import Golden, against_golden, write_golden
from wbmpc.junit import Case, Suite, case_of
from wbmpc.recorder import Recorder
from wbmpc.scenario import Counterfactual, Scenario
from wbmpc.triage.causes import Triage
from wbmpc.verdict import Verdict

LAST_STATES = 200  # ticks kept of a run that went non-finite
_FILES = ("json", "rrd", "traceback.txt", "last_states.npz")


@dataclass(frozen=True, slots=True)
class Job:
    """One run to make; plain data, since it travels to another process."""

    scenario: Scenario
    variant: str  # name of the counterfactual; empty: the scenario itself
    counterfactual: Counterfactual | None
    out: Path
    record: bool
    realtime: bool
    overrides: Mapping[str, JsonValue] = field(default_factory=dict)  # the user's own, by dotted path
    seed: int | None = None  # the user's own; None: the scenario's
    golden: tuple[Path, Golden] | None = None  # the golden result to compare with, and its file
    write_golden: Path | None = None  # the file of the golden result to make
    viewer: str | None = None  # URL of a rerun viewer

    @property
    def name(self) -> str:
        """Names the files: NAME or NAME.COUNTERFACTUAL."""
        return f"{self.scenario.name}.{self.variant}" if self.variant else self.scenario.name

    @property
    def expected(self) -> str:
        """ "pass", "fail", or "fail: " and the checks that must be among the failed ones."""
        declared = self.counterfactual
        if declared is None or declared.expect == "pass":
            return "pass"
        return f"fail: {', '.join(declared.failing)}" if declared.failing else "fail"

    @property
    def command(self) -> str:
        """The shell command that makes this run again, and no other."""
        changes, declared = dict(self.overrides), self.counterfactual
        if declared is not None:
            changes |= declared.set
            if declared.checks:
                changes["checks"] = [_written(check) for check in self.scenario.checks]
        return run_command(self.scenario.source, seed=self.seed, changes=changes)

    def file(self, suffix: str) -> Path:
        """OUT/NAME.SUFFIX."""
        return self.out / f"{self.name}.{suffix}"

    @property
    def recording(self) -> Path | None:
        """The .rrd file; None when none is asked for."""
        return self.file("rrd") if self.record else None

    def remove_files(self) -> None:
        """Results of an earlier run must not pass for this one's. Raises WbmpcError for what is no file."""
        for suffix in _FILES:
            with writing(self.file(suffix)):
                self.file(suffix).unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended; plain data."""

    code: ExitCode
    line: str  # PASS ... or FAIL ...
    suite: Suite
    checks: tuple[CheckResult, ...] = ()
    seed: int = 0
    simulated_time: float = nan  # [s]
    wall_time: float = nan  # [s]
    real_time_factor: float = nan
    timing: Mapping[str, float] = field(default_factory=dict)
    triage: Triage | None = None
    golden: Mapping[str, Any] | None = None
    traceback: str = ""  # of an internal error
    verdict: Mapping[str, Any] = field(default_factory=dict)  # what NAME.json says; empty where there is none


def carry_out(job: Job, on_progress: Callable[[float], None] | None = None) -> Outcome:
    """Run, and write NAME.json and NAME.rrd.

    Raises:
        WbmpcError: the robot cannot be read, or the recording not written.
    """
    from wbmpc.session import run_scenario  # MuJoCo, Pinocchio and the solvers: only when something runs

    try:
        result = run_scenario(
            job.scenario,
            name=job.name,
            recording=job.recording,
            viewer=job.viewer,
            realtime=job.realtime,
            on_progress=on_progress,
        )
        verdict = _with_golden(job, result.verdict)
        verdict.write(job.file("json"))
        dump_last_states(result.recorder, job.file("last_states.npz"))
    except WbmpcError:
        raise
    except Exception as error:  # a run that breaks the program must not lose the others
        line, traceback = write_traceback(error, job.file("traceback.txt"))
        return broken(job, line, traceback)
    return _outcome(job, verdict, result.wall_time)


def _with_golden(job: Job, verdict: Verdict) -> Verdict:
    """The verdict with what its golden result says; makes one when asked to, of a run that passed."""
    if job.write_golden is not None and verdict.passed:
        write_golden(job.write_golden, verdict.as_dict())
    if job.golden is None:
        return verdict
    return replace(verdict, golden=against_golden(*job.golden, verdict.as_dict()).as_dict())


def broken(job: Job, reason: str, traceback: str = "") -> Outcome:
    """The outcome of a run that gave no verdict."""
    suite = Suite(job.name, 0.0, [Case("run", reason)])
    return Outcome(ExitCode.INTERNAL_ERROR, f"FAIL {job.name}: {reason}", suite, traceback=traceback)


def dump_last_states(recorder: Recorder, path: Path) -> None:
    """Write the last ticks of a run whose state became non-finite; remove the file of an earlier run otherwise."""
    if np.isfinite(recorder.qpos).all() and np.isfinite(recorder.qvel).all() and np.isfinite(recorder.torque).all():
        path.unlink(missing_ok=True)
        return
    last = {name: recorder.column(name)[-LAST_STATES:] for name in ("time", "qpos", "qvel", "torque")}
    np.savez(path, allow_pickle=False, **last)


def _outcome(job: Job, verdict: Verdict, wall_time: float) -> Outcome:
    why = "\n".join(cause_lines(verdict.triage, job.recording)) if verdict.triage else ""
    if job.counterfactual is None:
        failures = [check for check in verdict.checks if not check.passed]
        off = "" if verdict.golden is None or verdict.golden["passed"] else golden_words(verdict.golden)
        passed = not failures and not off
        cases = [case_of(check, why) for check in verdict.checks]
        if verdict.golden is not None:
            cases.append(Case("golden", off or None))
        line = final_line(job.name, failures, off)
    else:  # one test: whether the run ended as declared
        wrong = objection(job.counterfactual, verdict)
        passed = wrong is None
        cases = [Case("counterfactual", wrong, why)]
        line = f"PASS {job.name}: {ending(verdict)}, as declared" if wrong is None else final_line(job.name, [], wrong)
    return Outcome(
        code=ExitCode.PASSED if passed else ExitCode.FAILED,
        line=line,
        suite=Suite(job.name, wall_time, cases),
        checks=tuple(verdict.checks),
        seed=verdict.seed,
        simulated_time=verdict.metrics.get("simulated_time", nan),
        wall_time=wall_time,
        real_time_factor=verdict.real_time_factor,
        timing=verdict.timing,
        verdict=verdict.as_dict(),
        triage=verdict.triage,
        golden=verdict.golden,
    )


def _written(check: ScenarioCheck) -> dict[str, JsonValue]:
    """A check as somebody would write it: without defaults."""
    return {"kind": check.kind, **check.model_dump(mode="json", exclude_defaults=True)}
