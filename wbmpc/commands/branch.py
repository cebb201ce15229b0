"""`wbmpc branch`: a recorded run that takes another turn at one tick; both futures, and how they part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wbmpc.branch import Branch
from wbmpc.branch import branch as make_both
from wbmpc.commands.branch_tables import print_partings, print_verdicts
from wbmpc.commands.exits import ExitCode
from wbmpc.commands.progress import simulated_time
from wbmpc.errors import WbmpcError
from wbmpc.explain.changes import OF_A_RUN, Change, change_of
from wbmpc.explain.past import Past, open_past
from wbmpc.files import make_folder
from wbmpc.verdict import finite, write_json
from wbmpc.warm_up import compile_kernels


@dataclass(frozen=True, slots=True)
class BranchOptions:
    """The options of `wbmpc branch`."""

    at: float  # [s]
    overrides: Mapping[str, Any]  # by dotted path
    out: Path
    record: bool
    robot: Path | None


def branch(path: Path, options: BranchOptions) -> ExitCode:
    """Make both futures, write OUT/NAME.branch.rrd and .json, and print how they part.

    Exit code 1 when the unchanged one is not the recorded run to the bit.

    Raises:
        ScenarioError: a change that cannot be made.
        WbmpcError: as `open_past`, a time outside the recording, or a file that cannot be written.
    """
    past = open_past(path, robot=options.robot)
    change = change_of(past.run.scenario, options.overrides, allowed=OF_A_RUN)
    recording = options.out / f"{past.run.name}.branch.rrd"
    if options.record and recording.resolve() == path.resolve():
        raise WbmpcError(f"--out {options.out}: {recording} would replace the recording that is read")
    past.tick_at(options.at)  # known before minutes of runs
    make_folder(options.out)
    compile_kernels()
    duration = past.run.scenario.duration
    with simulated_time(f"{past.run.name} twice", 2 * duration) as on_progress:

        def report(name: str, time: float) -> None:
            on_progress(time if name == "branch" else duration + time)

        both = make_both(
            past, change, at=options.at, recording=recording if options.record else None, on_progress=report
        )
    _write(both, change, past, options.out / f"{past.run.name}.branch.json")
    print(_identity(both, past), flush=True)
    print_partings(both, change)
    print_verdicts(both)
    if options.record:
        print(f"both futures: {recording}", flush=True)
    return ExitCode.PASSED if both.unlike_recording is None else ExitCode.FAILED


def _identity(both: Branch, past: Past) -> str:
    step = past.run.scenario.loop.timestep
    if both.unlike_recording is None:
        ticks = past.run.run.schedule.ticks
        return (
            f"{past.run.name}: made again, all {ticks} recorded ticks the same to the bit; branched at tick {both.tick}"
        )
    note = "" if past.run.same_source else "; the program's source is not the one that made the recording"
    tick = both.unlike_recording
    return f"{past.run.name}: NOT the recorded run from tick {tick} ({tick * step:.3f} s) on{note}"


def _write(both: Branch, change: Change, past: Past, target: Path) -> None:
    document = {
        "run": past.run.name,
        "tick": both.tick,
        "time": both.tick * past.run.scenario.loop.timestep,
        "changes": list(change.words),
        "first_unlike_recording": both.unlike_recording,
        "partings": [asdict(parting) for parting in both.partings],
        "original": both.original.verdict.as_dict(),
        "branch": both.changed.verdict.as_dict(),
    }
    write_json(target, finite(document))
