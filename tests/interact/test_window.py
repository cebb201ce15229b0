"""MuJoCo's viewer itself, on a virtual display, in processes of their own; and the force of a drag without one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from time import sleep

import mujoco
import numpy as np
import pytest
from display import virtual_display
from numpy.testing import assert_allclose
from short_run import ROOT, new_session, stand
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.interact.exchange import Inputs
from wbmpc.interact.operator import Operator
from wbmpc.interact.window import WindowProcess, push_of

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def somebodys_run(tmp_path_factory: pytest.TempPathFactory) -> dict:  # type: ignore[type-arg]
    out = tmp_path_factory.mktemp("run") / "answer.json"
    with virtual_display() as environment:
        process = subprocess.run(
            [sys.executable, str(HERE / "somebody.py"), str(out)],
            cwd=ROOT,
            env={**environment, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=500,
        )
    assert process.returncode == 0, f"{process.returncode}: {process.stderr[-2000:]}"
    answer: dict = json.loads(out.read_text())  # type: ignore[type-arg]
    return answer


def test_somebody_pulls_the_robot(somebodys_run: dict) -> None:  # type: ignore[type-arg]
    assert 0 < somebodys_run["pushed"] < somebodys_run["ticks"]
    assert somebodys_run["forwards"]
    assert 0.1 < somebodys_run["largest"] < 50.0
    assert somebodys_run["balance"]
    texts = somebodys_run["events"]
    assert sum(text.startswith("pull by mouse begins: torso") for text in texts) == 1
    assert sum(text.startswith("pull by mouse ends: ") for text in texts) == 1


def test_somebody_moves_the_target(somebodys_run: dict) -> None:  # type: ignore[type-arg]
    assert "reach left: target moved to (0.190, 0.130, 0.300) m" in somebodys_run["events"]
    assert somebodys_run["goal"] == pytest.approx(0.19, abs=0.005)
    assert somebodys_run["drawn"] > 10


def test_somebody_closes_the_window(somebodys_run: dict) -> None:  # type: ignore[type-arg]
    assert 1500 <= somebodys_run["ticks"] < 20000
    assert somebodys_run["events"][-2:] == ["the window was closed", "ended by the operator"]


def test_the_window_in_its_own_process(monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_display() as environment:
        monkeypatch.setenv("DISPLAY", environment["DISPLAY"])
        monkeypatch.delenv("MUJOCO_GL", raising=False)
        session, _ = new_session(scenario := stand(duration=1.0))
        window = WindowProcess(scenario)
        try:
            frame = Operator(window, scenario)._frame(session)
            answers = []
            for _ in range(400):
                answers.append(window.exchange(frame))
                if len([a for a in answers if a is not None]) >= 5:
                    break
                sleep(0.05)
            assert [a for a in answers if a is not None] == [Inputs()] * 5
            window._worker.process.kill()
            window._worker.process.join()
            gone = [window.exchange(frame) for _ in range(3)]
            assert any(a is not None and "killed by SIGKILL" in a.closed for a in gone)
            assert gone[-1] is not None
            assert gone[-1].closed
        finally:
            window.close()


def test_without_a_display_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    result = CliRunner().invoke(app, ["interact", str(ROOT / "scenarios/stand.yaml"), "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert result.stderr.startswith("no display here")
    assert result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="X11 only")
def test_a_display_that_nobody_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4711")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(WbmpcError, match=r"no display here: :4711 cannot be opened"):
        WindowProcess(stand())


def test_a_drag_is_a_spring_at_the_grabbed_point() -> None:
    """f = k m (place of the mouse - grabbed point) of a body at rest, k the model's perturbation stiffness."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='b' pos='0 0 1'><freejoint/>"
        "<geom size='.1 .1 .1' type='box' mass='2'/></body></worldbody></mujoco>"
    )
    data, perturb = mujoco.MjData(model), mujoco.MjvPerturb()
    mujoco.mj_forward(model, data)
    assert push_of(model, data, perturb) is None
    perturb.select, perturb.localmass = 1, 2.0
    perturb.localpos[:] = [0.1, 0.0, 0.05]
    offset = np.array([0.03, -0.02, 0.01])
    perturb.refselpos[:] = np.add([0.1, 0.0, 1.05], offset)
    assert push_of(model, data, perturb) is None  # grabbed, not pulled
    perturb.active = mujoco.mjtPertBit.mjPERT_ROTATE
    assert push_of(model, data, perturb) is None
    perturb.active = mujoco.mjtPertBit.mjPERT_TRANSLATE
    push = push_of(model, data, perturb)
    assert push is not None
    assert push.body == 1
    assert_allclose(push.point, [0.1, 0.0, 0.05], atol=1e-12)
    assert_allclose(push.force, model.vis.map.stiffness * 2.0 * offset, rtol=1e-6)
    assert not data.xfrc_applied.any()
