"""`wbmpc render`: a picture, a strip of pictures or an animation of a recording, without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import wbmpc.render as pictures  # first of all: it chooses MuJoCo's off-screen OpenGL before mujoco is imported
from wbmpc.commands.exits import ExitCode
from wbmpc.errors import WbmpcError
from wbmpc.footage import Footage
from wbmpc.rerun_sink.reading import Recording


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """The options of `wbmpc render`."""

    times: Sequence[float]  # [s] one picture each; empty: the last sample, or an animation
    start: float | None  # [s] of an animation; None: the first sample
    end: float | None  # [s] None: the last sample
    rate: float  # [Hz] frames a second of an animation
    speed: float  # of an animation, over real time
    size: tuple[int, int]  # [px] width and height
    azimuth: float  # [deg]
    elevation: float  # [deg]
    distance: float  # [m]


def render(recording: Path, target: Path, options: RenderOptions) -> ExitCode:
    """Draw `recording` into `target`: several times make a strip; none and an animation's suffix, an animation.

    Raises:
        WbmpcError: no such recording, a time outside the run, options that do not fit, an unknown suffix, or no OpenGL.
    """
    suffix = target.suffix.lower()
    kinds = dict.fromkeys((*pictures.FORMATS, *pictures.ANIMATIONS))
    if suffix not in kinds:
        raise WbmpcError(f"{target}: unknown kind of picture; choose one of {', '.join(kinds)}")
    animated = suffix in pictures.ANIMATIONS and not options.times
    if not animated and suffix not in pictures.FORMATS:
        raise WbmpcError(f"{target}: a video has no single times; say --from and --to")
    if not animated and (options.start, options.end) != (None, None):
        reason = "--time asks for pictures" if options.times else f"a {suffix} does not move"
        raise WbmpcError(f"{target}: --from and --to are of an animation, and {reason}")
    footage = Recording(recording).footage()
    width, height = options.size
    camera = pictures.Camera(azimuth=options.azimuth, elevation=options.elevation, distance=options.distance)
    picture = pictures.Picture(width=width, height=height, camera=camera)
    if animated:
        pictures.prepare_animation(target, frame_rate=options.rate)
        times = animation_times(footage, options)
        frames = pictures.render_frames(footage, times, picture)
        pictures.save_animation(frames, target, frame_rate=options.rate)
    else:
        times = list(options.times) or [float(footage.time[-1])]
        pictures.save_picture(pictures.render_frames(footage, times, picture), target)
    print(f"{target}: {len(times)} pictures" if len(times) > 1 else str(target))
    return ExitCode.PASSED


def animation_times(footage: Footage, options: RenderOptions) -> list[float]:
    """Times [s] of the frames.

    Raises:
        WbmpcError: the end is not after the start, or one of them is outside the run.
    """
    start = float(footage.time[0]) if options.start is None else options.start
    end = float(footage.time[-1]) if options.end is None else options.end
    if end <= start and len(footage.time) > 1:
        raise WbmpcError(f"an animation from {start:g} to {end:g} s: its end is not after its start")
    footage.index(start), footage.index(end)
    count = max(1, round((end - start) * options.rate / options.speed))
    return [start + k * options.speed / options.rate for k in range(count)]
