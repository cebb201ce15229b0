"""`wbmpc render`: a picture, a strip of pictures or an animation of a recording, without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import wbmpc.render as pictures  # first of all: it chooses MuJoCo's off-screen OpenGL before mujoco is imported
from wbmpc.commands.exits import ExitCode
from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink.reading import Recording

ANIMATED = (".webp", ".gif")


@dataclass(frozen=True, slots=True)
class RenderOptions:
    """The options of `wbmpc render`."""

    times: Sequence[float]  # [s] empty: the last sample, or the whole run for an animation
    rate: float  # [Hz] frames a second of an animation
    size: tuple[int, int]  # [px] width and height
    azimuth: float  # [deg]
    elevation: float  # [deg]
    distance: float  # [m]


def render(recording: Path, target: Path, options: RenderOptions) -> ExitCode:
    """Draw `recording` into `target`: several times make a strip, an animation's suffix an animation.

    Raises:
        WbmpcError: no such recording, a time outside the run, an unknown suffix, or no OpenGL.
    """
    if target.suffix.lower() not in pictures.FORMATS:
        raise WbmpcError(f"{target}: unknown kind of picture; choose one of {', '.join(pictures.FORMATS)}")
    footage = Recording(recording).footage()
    width, height = options.size
    camera = pictures.Camera(azimuth=options.azimuth, elevation=options.elevation, distance=options.distance)
    picture = pictures.Picture(width=width, height=height, camera=camera)
    animated = target.suffix.lower() in ANIMATED and len(options.times) != 1
    if animated:
        start, end = float(footage.time[0]), float(footage.time[-1])
        if options.times:
            start, end = min(options.times), max(options.times)
        count = max(1, round((end - start) * options.rate))
        times = [start + k / options.rate for k in range(count)]
        frames = pictures.render_frames(footage, times, picture)
        pictures.save_animation(frames, target, frame_rate=options.rate)
    else:
        times = list(options.times) or [float(footage.time[-1])]
        pictures.save_picture(pictures.render_frames(footage, times, picture), target)
    print(f"{target}: {len(times)} pictures" if len(times) > 1 else str(target))
    return ExitCode.PASSED
