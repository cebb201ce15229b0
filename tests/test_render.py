"""Pictures show what they should, as far as a test can see: something is there, at its place, in its colour."""

from __future__ import annotations

from pathlib import Path

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
import mujoco
import numpy as np
import pytest
import small_run
from PIL import Image

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


def test_bad_requests_are_one_clear_line(footage: Footage, tmp_path: Path) -> None:
    frame = np.zeros((4, 4, 3), np.uint8)
    (tmp_path / "file").write_text("")
    with pytest.raises(WbmpcError, match=r"no sample at 7 s: the run goes from 0 to 0\.39 s"):
        pictures.render_frames(footage, [7.0])
    with pytest.raises(WbmpcError, match=r"choose one of \.png"):
        pictures.save_picture([frame], tmp_path / "a.bmp")
    with pytest.raises(WbmpcError, match=r"\.webp or a \.gif"):
        pictures.save_animation([frame], tmp_path / "a.png", frame_rate=20.0)
    with pytest.raises(WbmpcError, match="cannot write the picture"):
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
