"""Pictures show what they should, as far as a test can see: something is there, at its place, in its colour."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
import mujoco
import numpy as np
import pytest
import small_run
from PIL import Image
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.commands.render import RenderOptions, animation_times
from wbmpc.errors import WbmpcError
from wbmpc.footage import Footage

SMALL = pictures.Picture(width=160, height=120)


@pytest.fixture(scope="module")
def footage() -> Footage:
    recorder = small_run.new_recorder()
    small_run.append_ticks(recorder, 400)
    return Footage.from_recorder(small_run.compile_model(), recorder, stride=10)


@pytest.fixture(scope="module")
def _gl(footage: Footage) -> None:
    try:
        pictures.render_frames(footage, [0.0], SMALL)
    except WbmpcError as error:
        pytest.skip(str(error))


@pytest.mark.usefixtures("_gl")
def test_the_robot_is_in_the_middle_of_the_picture(footage: Footage) -> None:
    far = np.array([50.0, 50.0, 0.0])
    gone = Footage(footage.model, footage.time, footage.qpos + np.array([*far, *np.zeros(6)]), *_rest(footage))
    bare = pictures.Picture(width=320, height=240, forces=False, balance=False)
    (here,), (away,) = (pictures.render_frames(f, [0.1], bare) for f in (footage, gone))
    assert here.shape == (240, 320, 3)
    rows, columns = np.nonzero(np.abs(here.astype(int) - away).max(axis=2) > 20)
    assert len(rows) > 500
    assert 80 < np.median(rows) < 160
    assert 80 < np.median(columns) < 240


@pytest.mark.usefixtures("_gl")
def test_forces_and_balance_are_drawn_over_the_scene(footage: Footage) -> None:
    time = 0.03  # three contacts

    def changed(**drawn: bool) -> int:
        options = {"forces": False, "balance": False} | drawn
        frame, bare = (
            pictures.render_frames(footage, [time], pictures.Picture(width=320, height=240, **o))[0]
            for o in (options, {"forces": False, "balance": False})
        )
        return int(np.sum(np.abs(frame.astype(int) - bare).max(axis=2) > 20))

    assert changed() == 0
    assert changed(forces=True) > 50
    assert changed(balance=True) > 50


@pytest.mark.usefixtures("_gl")
def test_rendering_leaves_the_runs_model_alone(footage: Footage) -> None:
    before = footage.model.vis.global_.offwidth
    pictures.render_frames(footage, [0.0], pictures.Picture(width=before + 16, height=64))
    assert footage.model.vis.global_.offwidth == before


@pytest.mark.usefixtures("_gl")
def test_strip_and_animation(footage: Footage, tmp_path: Path) -> None:
    frames = pictures.render_frames(footage, [0.0, 0.2, 0.39], SMALL)
    pictures.save_picture(frames, tmp_path / "new" / "strip.png")
    strip = np.asarray(Image.open(tmp_path / "new" / "strip.png"))
    np.testing.assert_array_equal(strip, np.hstack(frames))
    for suffix in ("webp", "gif"):
        pictures.save_animation(frames, tmp_path / f"a.{suffix}", frame_rate=20.0)
        with Image.open(tmp_path / f"a.{suffix}") as animation:
            assert animation.n_frames == 3
            animation.seek(1)
            animation.load()
            assert animation.info["duration"] == 50


@pytest.mark.parametrize(("suffix", "rate"), [(".webp", 30.0), (".gif", 30.0), (".gif", 50.0), (".webp", 7.0)])
def test_an_animation_keeps_its_speed(tmp_path: Path, suffix: str, rate: float) -> None:
    """A format's pauses are whole steps (a .gif's of 10 ms); rounded one by one they would add up to another speed."""
    frames = [np.full((8, 8, 3), k, np.uint8) for k in range(60)]
    pictures.save_animation(frames, tmp_path / f"a{suffix}", frame_rate=rate)
    total = 0.0
    with Image.open(tmp_path / f"a{suffix}") as animation:
        for k in range(animation.n_frames):
            animation.seek(k)
            animation.load()
            total += animation.info["duration"]
    assert total == pytest.approx(60e3 / rate, abs=10)


def test_a_video_has_its_frames_size_and_speed(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    frames = [np.full((65, 97, 3), 4 * k, np.uint8) for k in range(50)]
    pictures.save_animation(frames, tmp_path / "new" / "a.mp4", frame_rate=25.0)
    reader = ffmpeg.read_frames(str(tmp_path / "new" / "a.mp4"))
    about = next(reader)
    assert (about["size"], about["fps"], about["duration"]) == ((96, 64), 25.0, 2.0)
    shades = [np.frombuffer(frame, np.uint8).mean() for frame in reader]
    np.testing.assert_allclose(shades, [4 * k for k in range(50)], atol=6)


def test_without_its_writer_a_video_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(WbmpcError, match=r"a\.mp4: .*pip install 'wbmpc\[video\]'") as caught:
        pictures.save_animation([np.zeros((4, 4, 3), np.uint8)], tmp_path / "a.mp4", frame_rate=20.0)
    assert "\n" not in str(caught.value)


def test_times_of_an_animation(footage: Footage) -> None:
    def times(**changes: float) -> list[float]:
        given = {"times": (), "start": None, "end": None, "rate": 10.0, "speed": 1.0}
        view = {"size": (8, 8), "azimuth": 0.0, "elevation": 0.0, "distance": 1.0}
        return animation_times(footage, RenderOptions(**{**given, **view, **changes}))

    np.testing.assert_allclose(times(), [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(times(start=0.1, end=0.2, speed=0.5), [0.1, 0.15])
    np.testing.assert_allclose(times(speed=2.0), [0.0, 0.2])
    with pytest.raises(WbmpcError, match="its end is not after its start"):
        times(start=0.2, end=0.2)
    with pytest.raises(WbmpcError, match="no sample at 7 s"):
        times(end=7.0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "a.bmp"], r"choose one of \.png, \.webp, \.gif, \.mp4"),
        (["--out", "a.mp4", "--time", "1"], "a video has no single times"),
        (["--out", "a.png", "--from", "1"], r"a \.png does not move"),
        (["--out", "a.webp", "--from", "1", "--time", "1"], "--time asks for pictures"),
    ],
)
def test_options_that_do_not_fit_are_refused(words: list[str], message: str) -> None:
    result = CliRunner().invoke(app, ["render", "absent.rrd", *words])
    assert result.exit_code == 2
    assert re.search(message, result.output)
    assert result.output.count("\n") == 1


def test_bad_requests_are_one_clear_line(footage: Footage, tmp_path: Path) -> None:
    frame = np.zeros((4, 4, 3), np.uint8)
    (tmp_path / "file").write_text("")
    with pytest.raises(WbmpcError, match=r"no sample at 7 s: the run goes from 0 to 0\.39 s"):
        pictures.render_frames(footage, [7.0])
    with pytest.raises(WbmpcError, match=r"choose one of \.png"):
        pictures.save_picture([frame], tmp_path / "a.bmp")
    with pytest.raises(WbmpcError, match=r"one of \.webp, \.gif, \.mp4"):
        pictures.save_animation([frame], tmp_path / "a.png", frame_rate=20.0)
    with pytest.raises(WbmpcError, match="cannot write "):
        pictures.save_picture([frame], tmp_path / "file" / "a.png")


def test_without_opengl_the_packages_are_named(footage: Footage, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("eglInitialize failed\nlong story")

    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(mujoco, "Renderer", refuse)
    with pytest.raises(WbmpcError, match=r"eglInitialize failed\. On Debian: .*libegl1 libegl-mesa0 libgl1-mesa-dri"):
        pictures.render_frames(footage, [0.0])


@pytest.mark.parametrize(("time", "sample"), [(0.0, 0), (0.014, 1), (0.016, 2), (0.39, 39), (0.395, 39)])
def test_nearest_sample(footage: Footage, time: float, sample: int) -> None:
    assert footage.index(time) == sample


def _rest(footage: Footage) -> tuple:
    return footage.com, footage.contact_position, footage.contact_force, footage.support_polygon


@pytest.mark.parametrize("module", ["render", "commands.render", "commands.plot", "commands.report"])
def test_an_opengl_is_chosen_before_mujoco_is_imported(module: str) -> None:
    """MuJoCo reads MUJOCO_GL when it is first imported, and would look for a screen."""
    code = (
        "import importlib, os, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        assert name != 'mujoco' or os.environ.get('MUJOCO_GL'), 'mujoco is imported first'\n"
        "sys.meta_path.insert(0, Watch())\n"
        f"importlib.import_module('wbmpc.{module}')"
    )
    environment = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
