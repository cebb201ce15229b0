"""Progress: a bar on a terminal, nothing where there is none, and lines only for logs."""

from __future__ import annotations

from pathlib import Path

import pytest
from report_case import write
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.commands.progress import counted, simulated_time


def two_of_two(log: bool) -> None:
    with counted("pages", 2, log=log) as advance:
        advance("first")
        advance("second")
    with simulated_time("walk", 2.0, log=log) as on_progress:
        on_progress(1.5)


@pytest.mark.parametrize(
    ("log", "said"), [(False, ""), (True, "pages: 1/2 first\npages: 2/2 second\nrunning walk (2 s simulated)\n")]
)
def test_without_a_terminal(log: bool, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    two_of_two(log)
    assert capsys.readouterr() == ("", said)


@pytest.mark.parametrize("log", [False, True])
def test_on_a_terminal(log: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    two_of_two(log)
    output, errors = capsys.readouterr()
    assert output == ""
    assert all(words in errors for words in ("pages: second", "2/2", "walk", "75%"))
    assert "running" not in errors


def test_a_report_shows_its_progress_on_a_terminal_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, "calm")
    words = ["report", str(tmp_path), "--jobs", "1"]
    assert CliRunner().invoke(app, words).stderr == ""
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0
    assert "report: calm" in result.stderr
