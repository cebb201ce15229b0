"""The command line. Each command imports what it needs when it runs, so that `--version` and `validate` are quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import wbmpc.cli_again
import wbmpc.cli_pictures
from wbmpc.cli_options import Debug, Files, Jobs, Out, Overrides, ScenarioFile, Seed
from wbmpc.commands.exits import ExitCode, guarded
from wbmpc.pool import one_thread_each

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Closed-loop MuJoCo testbed for three-stage whole-body MPC with external contacts.",
)


def main() -> None:
    """Entry point of `wbmpc`. Exit codes: 0 all passed, 1 a scenario failed, 2 bad input, 3 internal error."""
    app()


def _print_versions(wanted: bool) -> None:
    if wanted:
        from wbmpc.versions import versions

        for name, number in versions().items():
            typer.echo(f"{name} {number}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_versions, is_eager=True, help="Versions of wbmpc and its solvers."),
    ] = False,
) -> None:
    """Options before the command."""
    one_thread_each()  # before any command imports numpy


@app.command("run", help="Run scenarios; write DIR/NAME.rrd, DIR/NAME.json and DIR/junit.xml.")
def run_command(
    scenarios: Files,
    overrides: Overrides,
    out: Out = Path("out"),
    seed: Seed = None,
    realtime: Annotated[bool, typer.Option("--realtime", help="Wall clock, the planner in its own thread.")] = False,
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no .rrd file.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Show the runs in a rerun viewer as they go on.")] = False,
    view_at: Annotated[
        str | None, typer.Option("--view-at", metavar="ADDRESS", help="In the viewer that listens at HOST:PORT.")
    ] = None,
    counterfactuals: Annotated[
        bool, typer.Option("--counterfactuals", help="Also run each scenario's counterfactuals.")
    ] = False,
    golden: Annotated[
        Path | None, typer.Option("--golden", metavar="DIR", help="Compare with the golden results DIR/NAME.json.")
    ] = None,
    write_golden: Annotated[
        Path | None, typer.Option("--write-golden", metavar="DIR", help="Make golden results of the runs that pass.")
    ] = None,
    jobs: Jobs = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.run import RunOptions, run
        from wbmpc.scenario import parse_overrides

        options = RunOptions(
            out=out,
            overrides=parse_overrides(overrides),
            seed=seed,
            realtime=realtime,
            record=not no_record,
            counterfactuals=counterfactuals,
            jobs=jobs,
            debug=debug,
            golden=golden,
            write_golden=write_golden,
            view=view,
            view_at=view_at,
        )
        return run(scenarios, options)

    raise typer.Exit(guarded(work, traceback_path=out / "run.traceback.txt", debug=debug))


@app.command("interact", help="Run a scenario in MuJoCo's viewer, in real time: push the robot, move its targets.")
def interact_command(
    scenario: ScenarioFile,
    overrides: Overrides,
    out: Out = Path("out"),
    seed: Seed = None,
    duration: Annotated[float, typer.Option(min=1, max=3600, help="[s] how long a run goes on at least.")] = 120.0,
    pace: Annotated[float, typer.Option(min=0.0625, max=1, help="Of real time; for machines that are too slow.")] = 1.0,
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no .rrd file.")] = False,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.interact import InteractOptions, interact
        from wbmpc.scenario import parse_overrides

        changes = parse_overrides(overrides)
        options = InteractOptions(
            out=out, overrides=changes, seed=seed, duration=duration, pace=pace, record=not no_record
        )
        return interact(scenario, options)

    raise typer.Exit(guarded(work, traceback_path=out / "interact.traceback.txt", debug=debug))


@app.command("validate", help="Check scenario files without running them.")
def validate_command(scenarios: Files, debug: Debug = False) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.validate import validate

        return validate(scenarios)

    raise typer.Exit(guarded(work, traceback_path=Path("validate.traceback.txt"), debug=debug))


@app.command("doctor", help="Examine this machine and a robot's MJCF; exit code 1 when something must be fixed.")
def doctor_command(
    robot: Annotated[
        str, typer.Option("--robot", metavar="MODEL", help="A model of models/ by name, or an .xml file.")
    ] = "surena_mini",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.doctor import doctor

        return doctor(robot, as_json=as_json)

    raise typer.Exit(guarded(work, traceback_path=Path("doctor.traceback.txt"), debug=debug))


@app.command("schema", help="Print the JSON Schema of scenario files, for editors.")
def schema_command(debug: Debug = False) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.validate import schema

        return schema()

    raise typer.Exit(guarded(work, traceback_path=Path("schema.traceback.txt"), debug=debug))


@app.command("sweep", help="Run random draws over the ranges that the scenario declares; resumes after a kill.")
def sweep_command(
    scenario: ScenarioFile,
    overrides: Overrides,
    draws: Annotated[int, typer.Option("--draws", min=1, help="Number of draws.", show_default=False)],
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws.")] = 0,
    min_rate: Annotated[
        float, typer.Option(min=0, max=1, help="Smallest share of passed draws for exit code 0.")
    ] = 1.0,
    out: Out = Path("out"),
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.sweep import SweepOptions, sweep
        from wbmpc.scenario import parse_overrides

        changes = parse_overrides(overrides)
        options = SweepOptions(draws=draws, jobs=jobs, seed=seed, min_rate=min_rate, out=out, overrides=changes)
        return sweep(scenario, options)

    raise typer.Exit(guarded(work, traceback_path=out / "sweep.traceback.txt", debug=debug))


@app.command("latency", help="Run a scenario at growing plan delays, and find the one at which it begins to fail.")
def latency_command(
    scenario: ScenarioFile,
    overrides: Overrides,
    delays: Annotated[
        list[float] | None,
        typer.Option("--delay", min=0, help="[ms] repeatable [0 10 20 40 60 80 100 150 200]; then bisected."),
    ] = None,
    jobs: Jobs = None,
    seed: Seed = None,
    out: Out = Path("out"),
    suffix: Annotated[str, typer.Option("--format", help="Of the figure: webp, png, pdf, svg.")] = "webp",
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.latency import LatencyOptions, latency
        from wbmpc.scenario import parse_overrides

        changes = parse_overrides(overrides)
        options = LatencyOptions(delays=delays or [], jobs=jobs, seed=seed, out=out, suffix=suffix, overrides=changes)
        return latency(scenario, options)

    raise typer.Exit(guarded(work, traceback_path=out / "latency.traceback.txt", debug=debug))


app.add_typer(wbmpc.cli_again.app)
app.add_typer(wbmpc.cli_pictures.app)
