"""`wbmpc plot` on a real recording: the curves are the recorder's, and the files are there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from short_run import stand
from typer.testing import CliRunner

import wbmpc.render as pictures  # isort: skip  (before mujoco: it chooses the off-screen OpenGL)
from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.figures.trace import Trace, trace_of
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.reading import Recording
from wbmpc.session import run_scenario

PUSH = {"kind": "impulse", "body": "torso", "time": 0.2, "duration": 0.1, "impulse": [0.5, 0.3, 0.0]}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Recorder, Trace]:
    path = tmp_path_factory.mktemp("plot") / "pushed.rrd"
    scenario = stand(duration=0.6, disturbances=[PUSH], planner__horizon_steps=5)
    recorder = run_scenario(scenario, name="pushed", recording=path).recorder
    recording = Recording(path)
    return path, recorder, trace_of(recording, recording.footage())


def test_the_trace_is_what_the_recorder_saw(run: Any) -> None:
    _, recorder, trace = run
    rows = np.searchsorted(recorder.time, trace.time - 1e-6)
    np.testing.assert_allclose(recorder.time[rows], trace.time, atol=1e-9)
    np.testing.assert_allclose(trace.com, recorder.com[rows], atol=1e-6)
    np.testing.assert_allclose(trace.zmp, recorder.zmp[rows], atol=1e-6)
    np.testing.assert_allclose(trace.sole.mean(axis=2), recorder.sole_position[rows], atol=1e-6)
    np.testing.assert_allclose(trace.palm, recorder.palm_position[rows], atol=1e-6)
    np.testing.assert_allclose(trace.push, recorder.external_force[rows], atol=1e-4)
    assert np.any(trace.push != 0, axis=1).sum() == pytest.approx(0.1 * 100, abs=1)
    np.testing.assert_allclose(trace.com_velocity[1:-1], recorder.com_velocity[rows][1:-1], atol=0.02)
    assert trace.hand_contacts == ()
    assert trace.feet_travel < 0.01


def test_files_are_written_beside_the_recording_or_in_a_folder(run: Any, tmp_path: Path) -> None:
    path, *_ = run
    result = CliRunner().invoke(app, ["plot", str(path), "--frames", "0", "--format", "png"])
    assert result.exit_code == 0, result.output
    assert result.output == f"{path.with_name('pushed_plot.png')}\n"
    result = CliRunner().invoke(app, ["plot", str(path), "--out", str(tmp_path), "--frames", "3", "--width", "100"])
    if "no off-screen OpenGL" in result.output:
        pytest.skip(result.output)
    assert result.exit_code == 0, result.output
    with Image.open(tmp_path / "pushed_strip.webp") as strip:
        assert strip.size == (3 * 100 + 2 * 2, 270)
        assert len(strip.getcolors(10**6) or ()) > 1000  # something is to be seen
    assert (tmp_path / "pushed_plot.webp").exists()


def test_what_stands_before_the_robot_is_looked_past(run: Any) -> None:
    """The same robot with a screen on one side: from there nothing is seen, so another side is chosen."""
    from dataclasses import replace

    from wbmpc.figures.strip import best_azimuth
    from wbmpc.scenario import build_world, load_scenario, robot_path

    path, _, trace = run
    footage = Recording(path).footage()
    screen = {"kind": "box", "size": [1.0, 0.02, 0.8], "position": [0.0, -0.35]}
    scenario = load_scenario(Path(__file__).parents[2] / "scenarios" / "stand.yaml", {"world.objects.screen": screen})
    hidden = replace(footage, model=build_world(scenario, robot_path(scenario)))
    camera = pictures.Camera(follow=True)
    times = [0.0, 0.5]
    try:
        free = best_azimuth(footage, trace, times, camera)
    except WbmpcError as error:
        pytest.skip(str(error))
    assert np.sin(np.radians(free)) > 0.6  # looks along +y, from the robot's right, where the screen will be
    assert np.sin(np.radians(best_azimuth(hidden, trace, times, camera))) < 0.6


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["absent.rrd"], "no such recording: absent.rrd"),
        (["a/x.rrd", "b/x.rrd", "--out", "c"], "two recordings are named 'x'"),
        (["x.rrd", "--format", "bmp"], "--format bmp: choose one of png, webp, pdf, svg"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(words: list[str], message: str) -> None:
    result = CliRunner().invoke(app, ["plot", *words])
    assert result.exit_code == 2
    assert result.output.startswith(message)
    assert result.output.count("\n") == 1
