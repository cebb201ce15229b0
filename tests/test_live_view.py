"""A run in a viewer: rerun's own receiver takes what is streamed; the run and its file are those without one."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from short_run import ROBOT, ROOT, new_session, stand
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.rerun_sink import RerunSink, live
from wbmpc.rerun_sink import sink as sink_module
from wbmpc.rerun_sink.live import new_viewer, shown, viewer_at
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.timing import SCHEDULE
from wbmpc.session import RunResult, run_scenario


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port: int = taken.getsockname()[1]
    return port


@contextmanager
def receiver(path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A viewer without a window, which saves what it is sent; its address."""
    port = free_port()
    command = [Path(sys.executable).with_name("rerun"), "--port", str(port), "--save", path]
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # the command is a shim that starts the viewer
    )
    try:
        give_up = monotonic() + 120.0
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
                break
            except OSError:
                assert monotonic() < give_up
                assert process.poll() is None
                sleep(0.1)
        yield f"127.0.0.1:{port}", process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60.0)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, RunResult, Path, Path]:
    """A run without a viewer, and with one; the file of the second, and what the viewer was sent."""
    folder = tmp_path_factory.mktemp("live")
    scenario, file, sent = stand(duration=1.2), folder / "file.rrd", folder / "sent.rrd"
    plain = run_scenario(scenario, name="stand")
    with receiver(sent) as (address, _):
        viewed = run_scenario(scenario, name="stand", recording=file, viewer=viewer_at(address))
    return plain, viewed, file, sent


def test_the_run_is_the_same(runs: tuple[RunResult, RunResult, Path, Path]) -> None:
    assert runs[0].verdict.state_sha256 == runs[1].verdict.state_sha256


@pytest.mark.parametrize(
    ("entity", "component"), [("/com/z", "scalars"), ("/world/bodies/torso", "translation"), (SCHEDULE, "effect_tick")]
)
def test_the_viewer_gets_what_the_file_gets(
    runs: tuple[RunResult, RunResult, Path, Path], entity: str, component: str
) -> None:
    """Each row once, though the blocks are others."""
    (file_time, file_rows), (time, rows) = (Recording(path).column(entity, component) for path in runs[2:])
    assert len(time) > 50
    np.testing.assert_array_equal(time, file_time)
    for row, expected in zip(rows, file_rows, strict=True):
        np.testing.assert_array_equal(row, expected)


def test_the_verdict_is_shown_at_the_end(runs: tuple[RunResult, RunResult, Path, Path]) -> None:
    (text,) = Recording(runs[3]).static("/verdict", "text")[-1:]
    assert "No verdict" not in text


@pytest.mark.filterwarnings("default::UserWarning")
def test_a_viewer_that_is_closed_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sink_module, "PATIENCE", 2.0)
    with receiver(tmp_path / "sent.rrd") as (address, process):
        url = viewer_at(address)

        def close(time: float = 0.0) -> None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)

        with pytest.warns(UserWarning, match="the viewer shows no more of the run"):
            result = run_scenario(stand(duration=1.5), name="stand", viewer=url, on_progress=close)
    assert result.recorder.ticks == 1500


def test_ticks_made_during_a_flush_wait_for_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop goes on while a block is written: here by two ticks, always at the same place."""
    scenario = stand(duration=0.2)
    session, recorder = new_session(scenario)
    write = sink_module.write_ticks

    def slow(*arguments: Any) -> None:
        write(*arguments)
        for _ in range(2):
            session.tick(None)

    monkeypatch.setattr(sink_module, "write_ticks", slow)
    names = {"joint_names": ROBOT.joint_names, "scenario_name": "s", "scenario_text": "", "seed": 0}
    with RerunSink(tmp_path / "s.rrd", session.plant.model, recorder, tick_rate=1000.0, rate=500.0, **names) as sink:
        for _ in range(10):
            for _ in range(5):
                session.tick(None)
            sink.flush()
        monkeypatch.undo()
    time, _ = Recording(tmp_path / "s.rrd").column("/com/z", "scalars")
    np.testing.assert_allclose(time, 2e-3 * np.arange(35), atol=1e-9)
    assert len(Recording(tmp_path / "s.rrd").column("/solver_status/tracker", "state")[0]) == 1


def test_blocks_come_while_the_loop_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "PERIOD", 0.01)
    third = Event()
    sink = SimpleNamespace(flushes=0)

    def flush() -> None:
        sink.flushes += 1
        if sink.flushes == 3:
            third.set()

    sink.flush = flush
    with shown(sink):  # type: ignore[arg-type]
        assert third.wait(30.0)
    flushes = sink.flushes
    sleep(0.05)
    assert sink.flushes == flushes


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("127.0.0.1:{free}", r"no viewer listens at 127\.0\.0\.1:\d+ \(.+\)$"),
        ("127.0.0.1:99999", "not an address; allowed: HOST, HOST:PORT"),
        ("http://127.0.0.1:1/x", "not an address"),
        ("", "not an address"),
    ],
)
def test_nobody_at_the_address(address: str, message: str) -> None:
    with pytest.raises(WbmpcError, match=message):
        viewer_at(address.format(free=free_port()))


@pytest.mark.parametrize("form", ["{}", "rerun+http://{}/proxy"])
def test_addresses_that_are_taken(form: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert viewer_at(form.format(address)) == f"rerun+http://{address}/proxy"


def test_no_display_no_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(WbmpcError, match="--view: no display here"):
        new_viewer()


@pytest.mark.parametrize("options", [["--view"], ["--view-at", "127.0.0.1:1"], ["--view", "--view-at", "127.0.0.1:1"]])
def test_one_line_before_anything_runs(options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    result = CliRunner().invoke(app, ["run", str(ROOT / "scenarios/stand.yaml"), "--out", str(tmp_path), *options])
    assert result.exit_code == 2
    assert result.stderr.startswith("--view")
    assert result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
