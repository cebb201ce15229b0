"""One run of `wbmpc run`, in this process or in a worker: the simulation, its files, and how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import nan
from pathlib import Path

import numpy as np

from wbmpc.checks.result import CheckResult
from wbmpc.commands.exits import ExitCode, write_traceback
from wbmpc.commands.tables import final_line
from wbmpc.counterfactuals import objection
from wbmpc.errors import WbmpcError
from wbmpc.junit import Case, Suite, case_of
from wbmpc.recorder import Recorder
from wbmpc.scenario import Counterfactual, Scenario
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

    def file(self, suffix: str) -> Path:
        """OUT/NAME.SUFFIX."""
        return self.out / f"{self.name}.{suffix}"

    def remove_files(self) -> None:
        """Results of an earlier run must not pass for this one's."""
        for suffix in _FILES:
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
    traceback: str = ""  # of an internal error


def carry_out(job: Job, on_progress: Callable[[float], None] | None = None) -> Outcome:
    """Run, and write NAME.json and NAME.rrd.

    Raises:
        WbmpcError: the robot cannot be read, or the recording not written.
    """
    from wbmpc.session import run_scenario  # MuJoCo, Pinocchio and the solvers: only when something runs

    recording = job.file("rrd") if job.record else None
    try:
        result = run_scenario(
            job.scenario, name=job.name, recording=recording, realtime=job.realtime, on_progress=on_progress
        )
        result.verdict.write(job.file("json"))
        dump_last_states(result.recorder, job.file("last_states.npz"))
    except WbmpcError:
        raise
    except Exception as error:  # a run that breaks the program must not lose the others
        line, traceback = write_traceback(error, job.file("traceback.txt"))
        return broken(job, line, traceback)
    return _outcome(job, result.verdict, result.wall_time)


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
    if job.counterfactual is None:
        failures = [check for check in verdict.checks if not check.passed]
        passed = not failures
        cases = [case_of(check) for check in verdict.checks]
        line = final_line(job.name, failures)
    else:  # one test: whether the run ended as declared
        wrong = objection(job.counterfactual, verdict)
        passed = wrong is None
        cases = [Case("counterfactual", wrong)]
        ended = "passes" if verdict.passed else f"fails {', '.join(verdict.failing)}"
        line = f"PASS {job.name}: {ended}, as declared" if wrong is None else final_line(job.name, [], wrong)
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
    )
