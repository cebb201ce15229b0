"""The command line. Each command imports what it needs when it runs, so that `--version` and `validate` are quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbmpc.commands.exits import ExitCode, guarded
from wbmpc.pool import one_thread_each

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Closed-loop MuJoCo testbed for three-stage whole-body MPC with external contacts.",
)

Files = Annotated[list[Path], typer.Argument(metavar="SCENARIO", help="Scenario files (YAML).", show_default=False)]
ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (YAML).", show_default=False)]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="An .rrd file.", show_default=False)]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers [the scenario's].")]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the results.")]
Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        default_factory=list,
        help="Set a scenario key by its dotted path (lists by index), e.g. tasks.0.target.0=0.45; repeatable.",
        show_default=False,
    ),
]
Jobs = Annotated[int | None, typer.Option("--jobs", min=1, help="Parallel processes [one per core].")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")]


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
    counterfactuals: Annotated[
        bool, typer.Option("--counterfactuals", help="Also run each scenario's counterfactuals.")
    ] = False,
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
        )
        return run(scenarios, options)

    raise typer.Exit(guarded(work, traceback_path=out / "run.traceback.txt", debug=debug))


@app.command("validate", help="Check scenario files without running them.")
def validate_command(scenarios: Files, debug: Debug = False) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.validate import validate

        return validate(scenarios)

    raise typer.Exit(guarded(work, traceback_path=Path("validate.traceback.txt"), debug=debug))


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


@app.command("replay", help="Make a recording's run again in lockstep, plan by plan; exit code 1 when a bit differs.")
def replay_command(
    recording: RecordingFile,
    robot: Annotated[
        Path | None, typer.Option("--robot", metavar="FILE", help="The robot's MJCF, if it is elsewhere now.")
    ] = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.replay import replay

        return replay(recording, robot=robot)

    raise typer.Exit(guarded(work, traceback_path=Path("out/replay.traceback.txt"), debug=debug))


@app.command("render", help="Draw a recording (.rrd) without a screen: a picture, a strip of them, or an animation.")
def render_command(
    recording: RecordingFile,
    target: Annotated[
        Path, typer.Option("--out", metavar="FILE", help=".png; .webp or .gif: animated unless one --time is given.")
    ] = Path("out/render.png"),
    times: Annotated[
        list[float] | None,
        typer.Option("--time", help="[s] repeatable; one picture each, or the ends of an animation [the last sample]."),
    ] = None,
    rate: Annotated[float, typer.Option(min=1, max=100, help="[Hz] frames a second of an animation.")] = 20.0,
    width: Annotated[int, typer.Option(min=16, max=4096, help="[px]")] = 800,
    height: Annotated[int, typer.Option(min=16, max=4096, help="[px]")] = 800,
    azimuth: Annotated[float, typer.Option(help="[deg] direction of view about z: 90 along +y.")] = 75.0,
    elevation: Annotated[float, typer.Option(help="[deg] negative: from above.")] = -14.0,
    distance: Annotated[float, typer.Option(min=0.05, help="[m] from the robot.")] = 1.15,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.render import RenderOptions, render

        options = RenderOptions(
            times=times or [],
            rate=rate,
            size=(width, height),
            azimuth=azimuth,
            elevation=elevation,
            distance=distance,
        )
        return render(recording, target, options)

    raise typer.Exit(guarded(work, traceback_path=Path("out/render.traceback.txt"), debug=debug))


@app.command("plot", help="Draw recordings (.rrd): a strip of key moments, and balance, hand forces and footsteps.")
def plot_command(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="The .rrd files.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder [beside the recording].")] = None,
    suffix: Annotated[str, typer.Option("--format", help="webp, png, or pdf, svg with the strip as webp.")] = "webp",
    frames: Annotated[int, typer.Option(min=0, max=20, help="Pictures of the strip; 0: no strip.")] = 6,
    width: Annotated[int, typer.Option(min=16, max=2048, help="[px] of each picture.")] = 210,
    height: Annotated[int, typer.Option(min=16, max=2048, help="[px]")] = 270,
    azimuth: Annotated[
        float | None, typer.Option(help="[deg] direction of view about z: 90 along +y [what shows the motion best].")
    ] = None,
    distance: Annotated[float, typer.Option(min=0.05, help="[m] from the robot.")] = 1.05,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.plot import PlotOptions, plot

        options = PlotOptions(
            out=out, suffix=suffix, frames=frames, size=(width, height), azimuth=azimuth, distance=distance
        )
        return plot(recordings, options)

    raise typer.Exit(guarded(work, traceback_path=Path("out/plot.traceback.txt"), debug=debug))
