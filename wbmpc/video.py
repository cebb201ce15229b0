"""Pictures of a run as a .mp4, for slides and players; needs the optional extra `video`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.errors import WbmpcError
from wbmpc.files import writing

_QUALITY = 8  # of 10


def save_video(frames: Iterable[NDArray[np.uint8]], path: Path, *, frame_rate: float) -> None:
    """Write H.264 in the pixel format that every player knows, at `frame_rate` [Hz].

    Args:
        frames: (height, width, 3) each, of one size; an odd last row or column is left out, which the format asks for.

    Raises:
        WbmpcError: imageio-ffmpeg is not installed, there is no frame, or the file cannot be written.
    """
    encoder = ffmpeg(path)
    frames = iter(frames)
    first = next(frames, None)
    if first is None:
        raise WbmpcError(f"cannot write the video {path}: it has no frames")
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    with writing(path):  # ffmpeg's own complaints are an OSError, too
        writer = encoder.write_frames(
            str(path),
            (width, height),
            fps=frame_rate,
            quality=_QUALITY,
            macro_block_size=2,
            output_params=["-movflags", "+faststart"],
        )
        writer.send(None)
        for frame in (first, *frames):
            writer.send(np.ascontiguousarray(frame[:height, :width]))
        writer.close()


def ffmpeg(path: Path) -> Any:
    """What writes the video `path`. Raises WbmpcError when it is not installed."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise WbmpcError(
            f"{path}: .mp4 needs imageio-ffmpeg (pip install 'wbmpc[video]'); .webp and .gif do not"
        ) from error
    return imageio_ffmpeg
