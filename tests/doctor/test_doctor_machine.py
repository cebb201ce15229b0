"""Checks of the machine: each judges numbers that are given here; and the command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

import wbmpc.commands.doctor as command
from wbmpc.cli import app
from wbmpc.doctor.check import Finding, Status
from wbmpc.doctor.machine import cores, graphics, software
from wbmpc.doctor.machine.checks import CHECKS, examine_machine
from wbmpc.doctor.robot.checks import CHECKS as ROBOT_CHECKS

OK, WARN, FAIL = Status.OK, Status.WARN, Status.FAIL


def test_packages_against_what_is_declared() -> None:
    here = software.compared([Requirement("numpy>=1")])
    assert (here.status, here.text) == (OK, f"numpy {np.__version__}")
    texts = ["numpy>=999", "no-such-package>=1", "no-such-package; python_version < '3'", "numpy; extra == 'x'"]
    wrong = software.compared([Requirement(text) for text in texts])
    assert wrong.status is FAIL
    assert wrong.failures == [
        f"numpy {np.__version__}, >=999 needed",
        "no-such-package is not installed, >=1 needed",
    ]


def test_pinned_and_newer_versions_are_those_of_pyproject() -> None:
    assert software.packages().status in (OK, WARN)  # WARN: only on the path


def test_threads() -> None:
    assert software.threads_of({}).status is OK
    assert software.threads_of({"OMP_NUM_THREADS": "1"}).status is OK
    assert software.threads_of({"OMP_NUM_THREADS": "8"}).text.startswith("OMP_NUM_THREADS=8: ")


@pytest.mark.parametrize(("free", "status"), [(5e10, OK), (1e9, WARN), (1e7, FAIL)])
def test_disk(free: float, status: Status) -> None:
    assert software.space(free).status is status


def test_the_users_own_variables_are_seen_behind_the_programs() -> None:
    """`wbmpc` sets them for itself before any command runs."""
    program = "from wbmpc.cli import app; app(['doctor', '--json'])"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "OMP_NUM_THREADS": "3", "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    found = {row["name"]: row for row in json.loads(done.stdout)["machine"]}
    assert found["threads"]["status"] == "warn"
    assert "OMP_NUM_THREADS=3" in found["threads"]["found"]
    assert "plain Python" in found["hot loops"]["found"]


def test_kernels_that_are_not_kept_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbmpc.jit.uncached", lambda: 3)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    answer = software.kernels()
    assert answer.status is WARN
    assert answer.text.endswith("the others at the first run: about a minute")


@pytest.mark.parametrize(
    ("files", "quota"),
    [
        ({}, None),
        ({"cpu.max": "max 100000\n"}, None),
        ({"cpu.max": "150000 100000\n"}, 1.5),
        ({"cpu.cfs_quota_us": "-1\n", "cpu.cfs_period_us": "100000\n"}, None),
        ({"cpu.cfs_quota_us": "50000\n", "cpu.cfs_period_us": "100000\n"}, 0.5),
    ],
)
def test_quota_of_a_control_group(files: dict[str, str], quota: float | None) -> None:
    assert cores.cgroup_quota(files) == quota


def test_one_core_is_few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "available_cores", lambda: 4)
    monkeypatch.setattr(cores, "_cgroup_files", dict)
    assert cores.cores().status is OK
    monkeypatch.setattr(cores, "_cgroup_files", lambda: {"cpu.max": "150000 100000"})
    assert cores.cores().status is WARN
    assert "quota of 1.5" in cores.cores().text


def test_shares_of_the_cores() -> None:
    before = "cpu  100 0 0 100 0 0 0 0 0 0\ncpu0 ..."

    def after(user: int, idle: int, steal: int) -> str:
        return f"cpu  {100 + user} 0 0 {100 + idle} 0 0 0 {steal} 0 0\n"

    assert cores.shared(before, after(10, 90, 0), False).text == "10% busy, 0% stolen"
    assert cores.shared(before, after(10, 90, 0), False).status is OK
    assert cores.shared(before, after(80, 20, 0), False).text == "80% busy, 0% stolen: other programs are at work"
    stolen = cores.shared(before, after(40, 30, 30), True)
    assert stolen.text.startswith("40% busy, 30% stolen (a virtual machine): another guest")
    assert cores.shared(before, before, False).status is OK  # no clock tick between them


def test_punctuality() -> None:
    late = np.full(100, 60e-6)
    assert cores.punctual(late).status is OK
    late[:5] = 4e-3
    assert cores.punctual(late).status is WARN
    assert "p50 60, p99 4000, at most 4000 µs" in cores.punctual(late).text


def test_opengl() -> None:
    good, bad = (True, "llvmpipe"), (False, "ImportError: no library")
    assert graphics.judged({"egl": good, "osmesa": bad}, "").text == "egl: llvmpipe"
    assert graphics.judged({"egl": good, "osmesa": bad}, "egl").status is OK
    assert graphics.judged({"egl": bad, "osmesa": good}, "egl").text.startswith("MUJOCO_GL=egl does not work here: Imp")
    assert graphics.judged({"egl": bad, "osmesa": bad}, "").status is WARN
    assert graphics.judged({"egl": bad, "osmesa": bad, "glfw": good}, "").status is WARN  # a screen is not off-screen


def test_an_opengl_that_breaks_is_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphics, "environment_at_start", dict)  # with one that is wanted, only that one is spoken of
    monkeypatch.setattr(graphics, "_PICTURE", "import os; os.abort()")
    assert graphics.opengl().status is WARN
    monkeypatch.setattr(graphics, "_PICTURE", "raise ImportError('no library')")
    assert "egl: ImportError: no library" in graphics.opengl().text
    monkeypatch.setattr(graphics, "_PICTURE", "print('a card')")
    assert "egl: a card" in graphics.opengl().text


def test_every_check_answers_here() -> None:
    findings = examine_machine()
    assert [finding.name for finding in findings] == [check.name for check in CHECKS]
    assert [f for f in findings if f.status in (Status.FAIL, Status.SKIPPED)] == []
    assert all(finding.found and finding.hint for finding in findings)


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The command with findings that are given."""

    def with_findings(*statuses: Status) -> Any:
        found = [Finding(f"check {k}", status, f"found {k} [x]", f"hint {k}") for k, status in enumerate(statuses)]
        monkeypatch.setattr(command, "examine_machine", lambda on_done: found[:1])
        monkeypatch.setattr(command, "examine_robot", lambda path, on_done: found[1:])
        return lambda *words: CliRunner().invoke(app, ["doctor", *words])

    return with_findings


def test_table_exit_code_and_json(call: Any) -> None:
    result = call(OK, WARN)()
    assert result.exit_code == 0
    assert "→ hint 1" in result.output
    assert "hint 0" not in result.output
    assert "found 1 [x]" in result.output
    assert result.output.splitlines()[-1] == "1 of 2 checks ok; to know: check 1"
    result = call(OK, FAIL, Status.SKIPPED)("--json")
    assert result.exit_code == 1
    document = json.loads(result.output)
    assert document["passed"] is False
    assert document["machine"] == [{"name": "check 0", "status": "ok", "found": "found 0 [x]", "hint": "hint 0"}]
    assert [row["status"] for row in document["robot"]["checks"]] == ["fail", "skipped"]
    assert document["robot"]["path"].endswith("surena_mini.xml")


def test_robots_by_name_and_by_file(call: Any, tmp_path: Path) -> None:
    run = call(OK, OK)
    for robot in ("nobody", str(tmp_path / "nobody.xml")):
        result = run("--robot", robot)
        assert result.exit_code == 2
        assert len(result.output.splitlines()) == 1
        assert robot in result.output
    path = tmp_path / "some.mjcf"
    path.write_text("")
    assert run("--robot", str(path)).exit_code == 0
    assert run("--robot", "surena_mini").exit_code == 0


def test_the_page_names_every_check() -> None:
    page = (Path(__file__).parents[2] / "docs" / "doctor.md").read_text(encoding="utf-8")
    assert [check.name for check in ROBOT_CHECKS if f"`{check.name}`" not in page] == []
    assert f"\n{len(ROBOT_CHECKS)} checks of any MJCF" in page
    assert f"\n{len(CHECKS)} checks." in page
    shown = {line.split("  ")[0].strip() for line in page.splitlines() if line.startswith(" ")}
    assert {check.name for check in (*CHECKS, *ROBOT_CHECKS)} <= shown
