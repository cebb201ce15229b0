"""`wbmpc plot`: of each recording a strip of its key moments and the figure of its curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import wbmpc.render as pictures  # first of all: it chooses MuJoCo's off-screen OpenGL before mujoco is imported
from wbmpc.commands.exits import ExitCode
from wbmpc.errors import WbmpcError
from wbmpc.figures.figure import FORMATS, figure_of, save_figure
from wbmpc.figures.moments import key_moments
from wbmpc.figures.strip import picture_of, save_strip
from wbmpc.figures.trace import trace_of
from wbmpc.rerun_sink.reading import Recording


@dataclass(frozen=True, slots=True)
class PlotOptions:
    """The options of `wbmpc plot`."""

    out: Path | None  # None: beside the recording
    suffix: str  # of the figure: png, webp, pdf, svg
    frames: int  # pictures of the strip; 0: no strip
    size: tuple[int, int]  # [px] of each picture
    azimuth: float | None  # [deg] None: the side that shows most
    distance: float  # [m]


def plot(recordings: Sequence[Path], options: PlotOptions) -> ExitCode:
    """Write NAME_strip and NAME_plot for each recording NAME.rrd.

    Raises:
        WbmpcError: no such recording, two of one name, an unknown suffix, or no OpenGL for the strip.
    """
    suffix = f".{options.suffix.removeprefix('.')}"
    if suffix not in FORMATS:
        raise WbmpcError(f"--format {options.suffix}: choose one of {', '.join(f[1:] for f in FORMATS)}")
    targets = [(options.out or path.parent) / path.stem for path in recordings]
    for target in targets:
        if targets.count(target) > 1:
            raise WbmpcError(f"two recordings are named {target.name!r}: their figures would overwrite each other")
    for path, target in zip(recordings, targets, strict=True):
        for written in _plot(path, target, suffix, options):
            print(written, flush=True)
    return ExitCode.PASSED


def _plot(path: Path, target: Path, suffix: str, options: PlotOptions) -> list[Path]:
    recording = Recording(path)
    footage = recording.footage()
    trace = trace_of(recording, footage)
    figure = target.with_name(f"{target.name}_plot{suffix}")
    save_figure(figure_of(trace, target.name), figure)
    if options.frames == 0:
        return [figure]
    moments = key_moments(footage, trace, options.frames)
    picture = picture_of(footage, trace, moments, size=options.size, distance=options.distance, azimuth=options.azimuth)
    strip = target.with_name(f"{target.name}_strip{suffix if suffix in pictures.FORMATS else '.webp'}")
    save_strip(footage, moments, strip, picture)
    return [figure, strip]
