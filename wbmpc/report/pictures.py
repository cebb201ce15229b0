"""The pictures of a run as data URIs: key moments, and the run in motion."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
import numpy as np

from wbmpc.figures.moments import key_moments
from wbmpc.figures.strip import picture_of
from wbmpc.figures.trace import Trace
from wbmpc.footage import Footage

MOMENTS = 6
SIZE = 360  # [px] width and height
RATE = 10.0  # [Hz] of the animation
_MOST_FRAMES = 200  # a longer run is shown faster
_QUALITY = 60  # of 100; a page of ten runs still loads at once
_DISTANCE = 1.05  # [m]


@dataclass(frozen=True, slots=True)
class Still:
    """A picture of one moment."""

    time: float  # [s]
    uri: str


@dataclass(frozen=True, slots=True)
class Pictures:
    """What a run looks like."""

    size: int  # [px]
    moments: Sequence[Still]
    animation: str = ""  # URI; "" when there is none
    speed: int = 1  # of the animation, over real time


def pictures_of(footage: Footage, trace: Trace, *, animation: bool) -> Pictures:
    """Draw a run, all pictures from the side that shows it best.

    Raises:
        WbmpcError: no OpenGL on this machine.
    """
    moments = key_moments(footage, trace, MOMENTS)
    picture = picture_of(footage, trace, moments, size=(SIZE, SIZE), distance=_DISTANCE)
    frames = pictures.render_frames(footage, moments, picture)
    stills = [
        Still(time, _uri(pictures.encoded_picture(frame, ".webp", quality=80)))
        for time, frame in zip(moments, frames, strict=True)
    ]
    start, end = float(footage.time[0]), float(footage.time[-1])
    speed = max(1, ceil((end - start) * RATE / _MOST_FRAMES))
    if not animation or end - start < speed / RATE:
        return Pictures(SIZE, stills)
    times = [float(t) for t in np.arange(start, end, speed / RATE)]
    moving = pictures.render_frames(footage, times, replace(picture, draft=True))
    content = pictures.encoded_animation(moving, ".webp", frame_rate=RATE, quality=_QUALITY, method=4)
    return Pictures(SIZE, stills, _uri(content), speed)


def _uri(webp: bytes) -> str:
    return f"data:image/webp;base64,{b64encode(webp).decode()}"
