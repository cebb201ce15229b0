"""The commands that ask a recorded run what happened: again, why, what if, what differs; see cli.py."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbmpc.cli_options import Changes, Debug, Out, RecordingFile, RecordingFiles, RobotFile, finite
from wbmpc.commands.exits import ExitCode, guarded

app = typer.Typer()


@app.command("replay", help="Make a recording's run again in lockstep, plan by plan; exit code 1 when a bit differs.")
def replay_command(
    recording: RecordingFile,
    robot: RobotFile = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.replay import replay

        return replay(recording, robot=robot)

    raise typer.Exit(guarded(work, traceback_path=Path("out/replay.traceback.txt"), debug=debug))


@app.command("explain", help="Solve one plan of a recording again, bit for bit, and take it apart; --set: what if.")
def explain_command(
    recording: RecordingFile,
    overrides: Changes,
    at: Annotated[
        float | None, typer.Option("--at", help="[s] the latest plan not later [list the plans worth a look].")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="The whole answer as JSON; - prints it.")
    ] = None,
    most: Annotated[int, typer.Option("--most", min=0, help="Active constraints printed for each stage.")] = 8,
    robot: RobotFile = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.explain import ExplainOptions, explain
        from wbmpc.scenario import parse_overrides

        changes = parse_overrides(overrides)
        return explain(recording, ExplainOptions(at=at, overrides=changes, robot=robot, json=json, most=most))

    raise typer.Exit(guarded(work, traceback_path=Path("out/explain.traceback.txt"), debug=debug))


@app.command("branch", help="Let a recorded run take another turn at one tick; both futures, and how they part.")
def branch_command(
    recording: RecordingFile,
    overrides: Changes,
    at: Annotated[float, typer.Option("--at", help="[s] when it takes the turn.", show_default=False)],
    out: Out = Path("out"),
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no .rrd file.")] = False,
    robot: RobotFile = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.branch import BranchOptions, branch
        from wbmpc.scenario import parse_overrides

        changes = parse_overrides(overrides)
        return branch(recording, BranchOptions(at=at, overrides=changes, out=out, record=not no_record, robot=robot))

    raise typer.Exit(guarded(work, traceback_path=Path("out/branch.traceback.txt"), debug=debug))


@app.command("triage", help="Say why recorded runs failed: the first cause with its time, and what followed.")
def triage_command(recordings: RecordingFiles, robot: RobotFile = None, debug: Debug = False) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.triage import triage

        return triage(recordings, robot=robot)

    raise typer.Exit(guarded(work, traceback_path=Path("out/triage.traceback.txt"), debug=debug))


@app.command("compare", help="Compare two results (.json or .rrd); exit code 1 when they differ.")
def compare_command(
    first: Annotated[Path, typer.Argument(metavar="A", help="NAME.json or NAME.rrd.", show_default=False)],
    second: Annotated[Path, typer.Argument(metavar="B", help="The same of another run.", show_default=False)],
    atol: Annotated[
        float, typer.Option(min=0, callback=finite, help="Absolute tolerance, in each quantity's own unit.")
    ] = 0.0,
    rtol: Annotated[
        float, typer.Option(min=0, callback=finite, help="Relative tolerance, of the larger absolute value.")
    ] = 0.0,
    everything: Annotated[bool, typer.Option("--all", help="Every signal that differs, not the first ones.")] = False,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.compare import compare

        return compare(first, second, atol=atol, rtol=rtol, everything=everything)

    raise typer.Exit(guarded(work, traceback_path=Path("out/compare.traceback.txt"), debug=debug))
