"""The commands that make something to look at of runs that are over."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbmpc.cli_options import Debug, Jobs, RecordingFile, RecordingFiles, finite
from wbmpc.commands.exits import ExitCode, guarded

app = typer.Typer()


@app.command("render", help="Draw a recording (.rrd) without a screen: a picture, a strip of them, or an animation.")
def render_command(
    recording: RecordingFile,
    target: Annotated[
        Path, typer.Option("--out", metavar="FILE", help=".png a picture; .webp, .gif, .mp4 an animation.")
    ] = Path("out/render.png"),
    times: Annotated[
        list[float] | None,
        typer.Option("--time", help="[s] repeatable, one picture each, side by side [of a .png: the last sample]."),
    ] = None,
    start: Annotated[float | None, typer.Option("--from", help="[s] Start of an animation [the first sample].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="[s] End of an animation [the last sample].")] = None,
    rate: Annotated[float, typer.Option("--fps", min=1, max=100, help="[Hz] Frames a second of an animation.")] = 20.0,
    speed: Annotated[
        float, typer.Option(min=0.01, max=100, help="Of an animation, over real time; 0.25: slow motion.")
    ] = 1.0,
    width: Annotated[int, typer.Option(min=16, max=4096, help="[px]")] = 800,
    height: Annotated[int, typer.Option(min=16, max=4096, help="[px]")] = 800,
    azimuth: Annotated[
        float, typer.Option(callback=finite, help="[deg] direction of view about z: 90 along +y.")
    ] = 75.0,
    elevation: Annotated[float, typer.Option(callback=finite, help="[deg] negative: from above.")] = -14.0,
    distance: Annotated[float, typer.Option(min=0.05, callback=finite, help="[m] from the robot.")] = 1.15,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.render import RenderOptions, render

        options = RenderOptions(
            times=times or [],
            start=start,
            end=end,
            rate=rate,
            speed=speed,
            size=(width, height),
            azimuth=azimuth,
            elevation=elevation,
            distance=distance,
        )
        return render(recording, target, options)

    raise typer.Exit(guarded(work, traceback_path=Path("out/render.traceback.txt"), debug=debug))


@app.command("screenshot", help="Picture of a recording (.rrd) in rerun's viewer, without a screen (needs Vulkan).")
def screenshot_command(
    recording: RecordingFile,
    target: Annotated[Path, typer.Option("--out", metavar="FILE", help=".png or .webp.")] = Path("out/viewer.png"),
    moment: Annotated[
        float | None, typer.Option("--time", callback=finite, help="[s] [where the viewer opens].")
    ] = None,
    tab: Annotated[str | None, typer.Option(help="Tab in front, e.g. Planner or Mismatch [the first].")] = None,
    view: Annotated[
        str | None, typer.Option(help="Only the view of that title, e.g. Robot [the whole window].")
    ] = None,
    width: Annotated[int, typer.Option(min=200, max=7680, help="[px] of the window.")] = 1600,
    height: Annotated[int, typer.Option(min=200, max=4320, help="[px]")] = 1000,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.screenshot import screenshot

        return screenshot(recording, target, moment=moment, tab=tab, view=view, size=(width, height))

    raise typer.Exit(guarded(work, traceback_path=Path("out/screenshot.traceback.txt"), debug=debug))


@app.command("report", help="Write one HTML page about runs: checks, pictures, curves, contacts, solver times.")
def report_command(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUNS", help="Recordings (.rrd), verdicts (.json), folders of them.", show_default=False
        ),
    ],
    target: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="The page [report.html beside the first run].")
    ] = None,
    no_animation: Annotated[
        bool, typer.Option("--no-animation", help="Key moments only: a smaller page, and much sooner made.")
    ] = False,
    title: Annotated[str, typer.Option("--title", help="Heading of the page.")] = "Runs",
    jobs: Jobs = None,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.report import report

        return report(runs, target, animation=not no_animation, title=title, jobs=jobs)

    raise typer.Exit(guarded(work, traceback_path=Path("out/report.traceback.txt"), debug=debug))


@app.command("plot", help="Draw recordings (.rrd): a strip of key moments, and balance, hand forces and footsteps.")
def plot_command(
    recordings: RecordingFiles,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder [beside the recording].")] = None,
    suffix: Annotated[str, typer.Option("--format", help="webp, png, or pdf, svg with the strip as webp.")] = "webp",
    frames: Annotated[int, typer.Option(min=0, max=20, help="Pictures of the strip; 0: no strip.")] = 6,
    width: Annotated[int, typer.Option(min=16, max=2048, help="[px] of each picture.")] = 210,
    height: Annotated[int, typer.Option(min=16, max=2048, help="[px]")] = 270,
    azimuth: Annotated[
        float | None,
        typer.Option(
            callback=finite, help="[deg] direction of view about z: 90 along +y [what shows the motion best]."
        ),
    ] = None,
    distance: Annotated[float, typer.Option(min=0.05, callback=finite, help="[m] from the robot.")] = 1.05,
    debug: Debug = False,
) -> None:
    def work() -> ExitCode:
        from wbmpc.commands.plot import PlotOptions, plot

        options = PlotOptions(
            out=out, suffix=suffix, frames=frames, size=(width, height), azimuth=azimuth, distance=distance
        )
        return plot(recordings, options)

    raise typer.Exit(guarded(work, traceback_path=Path("out/plot.traceback.txt"), debug=debug))
