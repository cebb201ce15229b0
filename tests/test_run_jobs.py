"""`wbmpc run --jobs`: the same results for any number of processes, and what is left after Ctrl-C or a death."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from pool_work import dying_run
from typer.testing import CliRunner

from wbmpc.cli import app

SCENARIO = """
name: {name}
duration: {duration}
seed: 2
planner: {{horizon_steps: 5}}
sensors: {{noise_scale: 1.0}}
tasks: [{{kind: stand}}]
checks: [{{kind: torque_peak, max: 0.9}}]
counterfactuals:
  heavy: {{set: {{plant.mass_scale: 2.0}}, expect: pass}}
"""


def write(folder: Path, name: str, duration: float = 0.6) -> str:
    path = folder / f"{name}.yaml"
    path.write_text(SCENARIO.format(name=name, duration=duration), encoding="utf-8")
    return str(path)


def results(folder: Path) -> dict[str, Any]:
    """What must not depend on the number of processes."""
    found = {}
    for path in sorted(folder.glob("*.json")):
        document = json.loads(path.read_text())
        found[path.name] = [document[key] for key in ("passed", "checks", "metrics", "state_sha256", "seed")]
    return found


def suites(folder: Path) -> list[str | None]:
    return [suite.get("name") for suite in ElementTree.parse(folder / "junit.xml").getroot()]


def test_the_number_of_processes_changes_no_bit(tmp_path: Path) -> None:
    files = [write(tmp_path, "short"), write(tmp_path, "long", 0.8)]
    for jobs in ("1", "2"):
        words = ["run", *files, "--counterfactuals", "--no-record", "--jobs", jobs, "--out", str(tmp_path / jobs)]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        assert suites(tmp_path / jobs) == ["short", "short.heavy", "long", "long.heavy"]
    one, two = results(tmp_path / "1"), results(tmp_path / "2")
    assert one == two
    assert len({row[3] for row in one.values()}) == 4


def test_a_dying_process_fails_its_run_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbmpc.commands.run.carry_out", dying_run)
    (tmp_path / "a.heavy.json").write_text("of an earlier run")
    files = [write(tmp_path, "a"), write(tmp_path, "b")]
    result = CliRunner().invoke(app, ["run", *files, "--counterfactuals", "--jobs", "2", "--out", str(tmp_path)])
    assert result.exit_code == 3
    reason = "its process was killed by SIGKILL (out of memory?)"
    assert result.output.splitlines()[-2:] == [f"FAIL a.heavy: {reason}", f"FAIL b.heavy: {reason}"]
    assert suites(tmp_path) == ["a", "a.heavy", "b", "b.heavy"]
    assert not (tmp_path / "a.heavy.json").exists()


def interrupted(tmp_path: Path, files: list[str], after: str) -> tuple[int, str, list[str]]:
    """Exit code, standard output and error lines of a run that gets Ctrl-C, as its whole group does, after a line."""
    words = [sys.executable, "-m", "wbmpc", "run", *files, "--no-record", "--jobs", "2", "--out", str(tmp_path)]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:  # fmt: skip
        assert process.stderr is not None
        lines: list[str] = []
        while not lines or not lines[-1].startswith(after):
            lines.append(process.stderr.readline())
            assert lines[-1], lines
        os.killpg(process.pid, signal.SIGINT)
        output, rest = process.communicate(timeout=30)
        return process.returncode, output, rest.splitlines()


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    files = [write(tmp_path, "endless", 3000.0), write(tmp_path, "short"), write(tmp_path, "long", 0.7)]
    code, output, errors = interrupted(tmp_path, files, after="runs: 2/3")
    assert code == 130
    assert errors == [f"interrupted: 2 of 3 runs finished, their results are in {tmp_path}"]
    assert "Traceback" not in output
    assert [line.split()[0] for line in output.splitlines() if "PASS" in line] == ["short", "long"]
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["long.json", "short.json"]
    assert suites(tmp_path) == ["short", "long"]


def test_ctrl_c_of_a_single_run(tmp_path: Path) -> None:
    code, output, errors = interrupted(tmp_path, [write(tmp_path, "endless", 3000.0)], after="running endless")
    assert (code, output) == (130, "")
    assert errors == [f"interrupted: 0 of 1 runs finished, their results are in {tmp_path}"]
