"""The real viewer shows a recording: its tabs, its times; and what is said when it cannot."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import small_run
from test_rerun_sink import open_sink
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink import viewer as module
from wbmpc.rerun_sink.viewer import Viewer, headless_viewer


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("screenshot") / "small.rrd"
    recorder = small_run.new_recorder()
    with open_sink(path, recorder) as sink:
        small_run.append_ticks(recorder, 300)
        sink.finish({"scenario": "small", "passed": True})
    return path


@pytest.fixture(scope="module")
def shown(recording: Path) -> Iterator[Viewer]:
    try:
        with headless_viewer(recording, width=900, height=600) as viewer:
            yield viewer
    except WbmpcError as error:
        if "graphics" not in str(error):
            raise
        pytest.skip("no Vulkan here")


def test_tabs_and_times_change_the_picture(shown: Viewer) -> None:
    shown.go_to(0.06)
    shown.show_tab("Stage 3")
    table = np.asarray(shown.picture())
    assert table.shape[1] == 900
    assert table.std() > 10.0
    right = table[:, 500:]
    shown.show_tab("Verdict")
    assert (np.asarray(shown.picture())[:, 500:] != right).mean() > 0.01
    before = np.asarray(shown.picture("Robot"))
    shown.go_to(0.25)
    assert (np.asarray(shown.picture("Robot")) != before).any()


def test_what_is_not_there_is_answered_with_the_choices(shown: Viewer) -> None:
    with pytest.raises(WbmpcError, match=r"no tab 'Planer'; choose one of Overview, Planner"):
        shown.show_tab("Planer")
    with pytest.raises(WbmpcError, match=r"no view 'Robt'; choose one of .*Robot"):
        shown.picture("Robt")
    with pytest.raises(WbmpcError, match=r"no 9 s: the run goes from 0 to 0\.\d+ s"):
        shown.go_to(9.0)


def test_a_recording_that_was_cut_short_is_shown(recording: Path, shown: Viewer, tmp_path: Path) -> None:
    """`shown`: only where there is a viewer at all."""
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(recording.read_bytes()[:-100])
    with headless_viewer(cut, width=300, height=200) as viewer:
        viewer.go_to(0.06)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.rrd"], "no such recording: none.rrd"),
        (["none.rrd", "--out", "picture.bmp"], "unknown kind of picture; choose one of .png, .webp"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["screenshot", *arguments])
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("last_words", "message"),
    [
        ("thread 'main' panicked at 'Failed to get render context'", "install a Vulkan driver"),
        ("a first line\nthread 'main' panicked at 'port in use'\nReport bugs", "panicked at 'port in use'"),
        ("", "it said nothing"),
    ],
)
def test_a_viewer_that_ends_is_quoted(
    last_words: str, message: str, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = ["-c", f"import sys; sys.stderr.write({last_words!r})"]
    monkeypatch.setattr(module, "_command", lambda *_: [sys.executable, *script])
    with pytest.raises(WbmpcError, match=message), headless_viewer(recording, width=300, height=200):
        pytest.fail("there is no viewer")
