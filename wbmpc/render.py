"""Off-screen pictures of a run: one moment, a strip of moments, or an animation.

MuJoCo reads MUJOCO_GL when it is first imported: whoever wants pictures imports this module before mujoco, or sets
the variable. Without it MuJoCo would look for a screen.
"""

from __future__ import annotations

import ctypes
import io
import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from ctypes.util import find_library
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wbmpc.errors import WbmpcError
from wbmpc.files import prepare, writing
from wbmpc.footage import Footage
from wbmpc.video import ffmpeg, save_video

_NO_GL = "no off-screen OpenGL (MUJOCO_GL={backend}): {reason}. On Debian: apt-get install {packages}"
_PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"


def _backend() -> str:
    """The first off-screen OpenGL that can be loaded; with one that cannot, `import mujoco` itself would fail."""
    for backend, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if name := find_library(library):
            try:
                ctypes.CDLL(name)
            except OSError:
                continue
            return backend
    return "disable"


def _no_gl(error: Exception) -> WbmpcError:
    backend = os.environ.get("MUJOCO_GL", "")
    reason = (str(error).splitlines() or [type(error).__name__])[0]
    if backend == "disable":
        reason = "neither libEGL nor libOSMesa can be loaded"
    return WbmpcError(_NO_GL.format(backend=backend, reason=reason, packages=_PACKAGES))


if sys.platform == "linux":  # elsewhere MuJoCo's own choice needs no screen
    os.environ.setdefault("MUJOCO_GL", _backend())
try:
    import mujoco
except (AttributeError, RuntimeError) as error:  # MUJOCO_GL names a library that is not there, or nothing known
    raise _no_gl(error) from error

FORMATS = (".png", ".webp", ".gif")
ANIMATIONS = (".webp", ".gif", ".mp4")
_GIF_RATE = 50  # [Hz] browsers take a shorter pause than 2 / 100 s for a mistake, and wait 10 / 100 s
_METRES_PER_NEWTON = 0.015  # of an arrow: longer than in a recording, for a picture cannot be turned
_FORCE_RGBA = (0.24, 0.55, 1.0, 1.0)
_COM_RGBA = (1.0, 0.65, 0.16, 1.0)
_SUPPORT_RGBA = (0.10, 0.45, 0.30, 1.0)
_LOOK_AHEAD = (0.08, 0.0, 0.0)  # [m] from the CoM: what the robot reaches for is before it
_DRAFT_SHADOWS = 1024  # [px] of the shadow map; MuJoCo's own is 4096
_LEAST_DRAWN_FORCE = 0.2  # [N] a shorter arrow is all head


@dataclass(frozen=True, slots=True)
class Camera:
    """Where the picture is taken from; by default from the right, where a lean shows, standing still."""

    azimuth: float = 75.0  # [deg] about z; 90 looks along +y, 180 along -x
    elevation: float = -14.0  # [deg] negative: from above
    distance: float = 1.15  # [m] from lookat
    lookat: tuple[float, float, float] | None = None  # [m] in world; None: a little before the first picture's CoM
    follow: bool = False  # each picture is aimed anew, over the floor; the height stays that of the first


@dataclass(frozen=True, slots=True)
class Picture:
    """Size of a picture and what is drawn over the scene."""

    width: int = 800  # [px]
    height: int = 800  # [px]
    camera: Camera = Camera()
    forces: bool = True  # contact forces, 15 mm a newton
    balance: bool = True  # CoM, its projection, and the support polygon
    draft: bool = False  # no reflections, coarse shadows: quicker where no graphics card helps


def render_frames(footage: Footage, times: Sequence[float], picture: Picture = Picture()) -> list[NDArray[np.uint8]]:
    """Pictures (height, width, 3) of the samples nearest to `times` [s].

    Raises:
        WbmpcError: a time outside the run, or no OpenGL on this machine.
    """
    return _render(footage, [(time, picture.camera) for time in times], picture, segments=False)


def render_segments(
    footage: Footage, times: Sequence[float], cameras: Sequence[Camera], *, size: int
) -> list[NDArray[np.int32]]:
    """For each camera and, within it, each time: ids (size, size) of the geoms that are seen, -1: none.

    Raises as `render_frames`.
    """
    picture = Picture(width=size, height=size, forces=False, balance=False, draft=True)
    shots = [(time, camera) for camera in cameras for time in times]
    found = _render(footage, shots, picture, segments=True)
    return [np.where(frame[..., 1] == mujoco.mjtObj.mjOBJ_GEOM, frame[..., 0], -1) for frame in found]


def _render(
    footage: Footage, shots: Sequence[tuple[float, Camera]], picture: Picture, *, segments: bool
) -> list[NDArray[Any]]:
    """One frame a shot; `picture` without its camera."""
    rows = [footage.index(time) for time, _ in shots]
    model = copy(footage.model)  # its off-screen buffer is about to grow; the run's own model stays as it is
    data = mujoco.MjData(model)
    frames = []
    with _renderer(model, picture) as renderer:
        if segments:
            renderer.enable_segmentation_rendering()
        if picture.draft:
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        for row, (_, camera) in zip(rows, shots, strict=True):
            centre = footage.com[rows[0]].copy()
            if camera.follow:
                centre[:2] = footage.com[row, :2]
            data.qpos[: footage.qpos.shape[1]] = footage.qpos[row]
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, _aim(camera, centre))
            if picture.forces:
                _draw_forces(renderer.scene, footage, row)
            if picture.balance:
                _draw_balance(renderer.scene, footage, row)
            frames.append(renderer.render())
    return frames


def save_picture(frames: Sequence[NDArray[np.uint8]], path: Path) -> None:
    """One frame, or several side by side, as one picture."""
    _save(Image.fromarray(np.concatenate(list(frames), axis=1)), path)


def prepare_animation(path: Path, *, frame_rate: float) -> None:
    """What `save_animation` would refuse, before minutes of drawing.

    Raises:
        WbmpcError: another suffix, a .gif of more than 50 Hz, no writer of .mp4, or the folder cannot be made.
    """
    suffix = path.suffix.lower()
    if suffix not in ANIMATIONS:
        raise WbmpcError(f"{path}: an animation is one of {', '.join(ANIMATIONS)}")
    if suffix == ".gif" and frame_rate > _GIF_RATE:
        raise WbmpcError(f"a .gif has at most {_GIF_RATE} frames a second, not {frame_rate:g}; a .webp has more")
    if suffix == ".mp4":
        ffmpeg(path)
    prepare(path)


def save_animation(frames: Sequence[NDArray[np.uint8]], path: Path, *, frame_rate: float) -> None:
    """An endless .webp or .gif, or a .mp4, at `frame_rate` [Hz].

    Raises:
        WbmpcError: as `prepare_animation`, or the file cannot be written.
    """
    prepare_animation(path, frame_rate=frame_rate)
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        save_video(frames, path, frame_rate=frame_rate)
        return
    _write(path, encoded_animation(frames, suffix, frame_rate=frame_rate))


def encoded_animation(frames: Sequence[NDArray[np.uint8]], suffix: str, *, frame_rate: float, **options: Any) -> bytes:
    """The content of an endless .webp or .gif; `options` are the encoder's."""
    first, *rest = [Image.fromarray(frame) for frame in frames]
    options |= {
        "save_all": True,
        "append_images": rest,
        "loop": 0,
        "duration": _durations(len(frames), suffix, frame_rate),
    }
    return _encoded(first, suffix, **options)


def encoded_picture(frame: NDArray[np.uint8], suffix: str, **options: Any) -> bytes:
    """The content of a picture file; `options` are the encoder's."""
    return _encoded(Image.fromarray(frame), suffix, **options)


def _durations(count: int, suffix: str, frame_rate: float) -> list[int]:
    """(count,) [ms] in whole steps of the format that do not add up to another speed."""
    step = 10 if suffix == ".gif" else 1
    edges = [step * round(1000 * k / frame_rate / step) for k in range(count + 1)]
    return [b - a for a, b in itertools.pairwise(edges)]


def _encoded(image: Image.Image, suffix: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, suffix.removeprefix("."), **options)
    return buffer.getvalue()


def _save(image: Image.Image, path: Path, **options: Any) -> None:
    if path.suffix.lower() not in FORMATS:
        raise WbmpcError(f"{path}: unknown kind of picture; choose one of {', '.join(FORMATS)}")
    _write(path, _encoded(image, path.suffix.lower(), **options))


def _write(path: Path, content: bytes) -> None:
    with writing(path):
        path.write_bytes(content)


@contextmanager
def _renderer(model: Any, picture: Picture) -> Iterator[Any]:
    # The model's own off-screen buffer may be smaller than the picture; MuJoCo refuses rather than grow it.
    model.vis.global_.offwidth = max(model.vis.global_.offwidth, picture.width)
    model.vis.global_.offheight = max(model.vis.global_.offheight, picture.height)
    if picture.draft:
        model.vis.quality.shadowsize = min(model.vis.quality.shadowsize, _DRAFT_SHADOWS)
    try:
        renderer = mujoco.Renderer(model, picture.height, picture.width)
    except Exception as error:  # each OpenGL has its own kind
        raise _no_gl(error) from error
    try:
        yield renderer
    finally:
        renderer.close()


def _aim(settings: Camera, com: NDArray[np.float64]) -> Any:
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = settings.azimuth, settings.elevation, settings.distance
    camera.lookat[:] = settings.lookat if settings.lookat is not None else com + np.array(_LOOK_AHEAD)
    return camera


def _draw_forces(scene: Any, footage: Footage, row: int) -> None:
    for origin, force in zip(footage.contact_position[row], footage.contact_force[row], strict=True):
        if np.linalg.norm(force) > _LEAST_DRAWN_FORCE:
            tip = origin + _METRES_PER_NEWTON * force
            _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, 0.005, origin, tip, _FORCE_RGBA)


def _draw_balance(scene: Any, footage: Footage, row: int) -> None:
    com, polygon = footage.com[row], footage.support_polygon[row]
    contacts = footage.contact_position[row]
    heights = polygon[:, 2] if len(polygon) else contacts[:, 2] if len(contacts) else np.zeros(1)
    projection = np.array([com[0], com[1], heights.min()])
    _ball(scene, 0.013, com, _COM_RGBA)
    _ball(scene, 0.010, projection, _COM_RGBA)
    _connect(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, 0.0015, com, projection, _COM_RGBA)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if not np.array_equal(start, end):
            _connect(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, 0.002, start, end, _SUPPORT_RGBA)


def _next_geom(scene: Any) -> Any | None:
    """A free slot of the scene; None when it is full: decoration is then left out."""
    if scene.ngeom >= scene.maxgeom:
        return None
    scene.ngeom += 1
    return scene.geoms[scene.ngeom - 1]


def _ball(scene: Any, radius: float, centre: NDArray[np.float64], rgba: Sequence[float]) -> None:
    if (geom := _next_geom(scene)) is not None:
        kind = mujoco.mjtGeom.mjGEOM_SPHERE
        colour = np.asarray(rgba, np.float32)
        mujoco.mjv_initGeom(geom, kind, np.full(3, radius), np.asarray(centre, float), np.eye(3).ravel(), colour)


def _connect(
    scene: Any,
    kind: Any,
    width: float,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    rgba: Sequence[float],
) -> None:
    if (geom := _next_geom(scene)) is not None:
        colour = np.asarray(rgba, np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour)
        mujoco.mjv_connector(geom, kind, width, np.asarray(start, float), np.asarray(end, float))
