"""A strip of pictures: key moments side by side, from the side that shows the motion best."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wbmpc.figures.trace import Trace
from wbmpc.footage import Footage

FloatArray = NDArray[np.float64]
AZIMUTHS = (75.0, 105.0, 45.0, 135.0, 165.0, 195.0, 225.0, 255.0, 285.0, 315.0, 0.0)  # [deg] preferred ones first
_PREFERENCE = 0.02  # what each place further down that list costs
_MOTION_WEIGHT = 0.6  # of seeing the motion from its side, against seeing all of the robot
_SWAY = 0.02  # [m] motion that any robot on its feet makes
_PROBES = 3  # moments, and
_PROBE = 96  # [px] width and height of the pictures that the choice is made from
_GAP = 2  # [px] between the pictures


def save_strip(footage: Footage, times: Sequence[float], path: Path, picture: pictures.Picture) -> None:
    """Pictures of the moments `times` [s], each with its time, in one file.

    Raises:
        WbmpcError: no OpenGL, an unknown suffix, or the file cannot be written.
    """
    frames = pictures.render_frames(footage, times, picture)
    labelled = [_labelled(frame, f"{time:.1f} s") for frame, time in zip(frames, times, strict=True)]
    gap = np.full((picture.height, _GAP, 3), 255, np.uint8)
    pictures.save_picture([part for frame in labelled for part in (gap, frame)][1:], path)


def picture_of(
    footage: Footage,
    trace: Trace,
    moments: Sequence[float],
    *,
    size: tuple[int, int],
    distance: float,
    azimuth: float | None = None,
) -> pictures.Picture:
    """How to show the moments [s] of a run: the camera goes along; `azimuth` None is the side that shows most.

    Raises:
        WbmpcError: no OpenGL.
    """
    camera = pictures.Camera(distance=distance, follow=True)
    if azimuth is None:
        azimuth = best_azimuth(footage, trace, moments, camera)
    return pictures.Picture(*size, camera=replace(camera, azimuth=azimuth))


def best_azimuth(footage: Footage, trace: Trace, times: Sequence[float], camera: pictures.Camera) -> float:
    """Direction of view [deg] in which the world hides little of the robot and the motion goes across the picture.

    Args:
        times: [s] the moments to be shown.
        camera: its other settings.
    """
    probes = [times[k] for k in np.linspace(0, len(times) - 1, min(_PROBES, len(times))).round().astype(int)]
    cameras = [replace(camera, azimuth=azimuth) for azimuth in AZIMUTHS]
    alone = replace(footage, model=_robot_only(footage.model))
    seen, whole = (_robot_pixels(f, probes, cameras) for f in (footage, alone))  # (cameras, probes)
    share = np.mean(seen / np.maximum(whole, 1), axis=1)
    motion = np.array([across(trace, azimuth) for azimuth in AZIMUTHS])
    score = share * (1 - _MOTION_WEIGHT + _MOTION_WEIGHT * motion) - _PREFERENCE * np.arange(len(AZIMUTHS))
    return AZIMUTHS[int(np.argmax(score))]


def across(trace: Trace, azimuth: float) -> float:
    """Share, 0 to 1, of the horizontal motion of CoM and palms that goes across the picture at `azimuth` [deg]."""
    points = np.concatenate([trace.com[:, None, :2], trace.palm[:, :, :2]], axis=1)  # (n, 3, 2)
    motion = (points - points[0]).reshape(-1, 2)
    angle = np.radians(azimuth)
    right = np.array([np.sin(angle), -np.cos(angle)])  # in the picture
    small = len(motion) * _SWAY**2  # in every direction alike: what hardly moves can be seen from anywhere
    return float(np.sqrt((((motion @ right) ** 2).sum() + small) / ((motion**2).sum() + 2 * small)))


def _robot_pixels(footage: Footage, times: Sequence[float], cameras: Sequence[pictures.Camera]) -> FloatArray:
    """(cameras, times) how many pixels show a part of the robot."""
    model = footage.model
    robot = model.body_rootid[model.geom_bodyid] == model.jnt_bodyid[0]
    frames = pictures.render_segments(footage, times, cameras, size=_PROBE)
    counts = [np.count_nonzero(robot[frame[frame >= 0]]) for frame in frames]
    return np.array(counts, dtype=float).reshape(len(cameras), len(times))


def _robot_only(model: Any) -> Any:
    """A copy of the model in which nothing but the robot can be seen."""
    alone = copy(model)
    world = model.body_rootid[model.geom_bodyid] != model.jnt_bodyid[0]
    alone.geom_group[world] = mujoco.mjNGROUP - 1  # groups from 3 on are not drawn
    return alone


def _labelled(frame: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    image = Image.fromarray(frame)
    draw = ImageDraw.Draw(image)
    draw.text((6, 4), text, fill=(20, 20, 20), font=ImageFont.load_default(15), stroke_width=2, stroke_fill=(255,) * 3)
    return np.asarray(image)
