"""`wbmpc run` in GitHub Actions: annotations at the right lines, properly escaped, and a summary in markdown."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typer.testing import CliRunner

from wbmpc.checks.result import CheckResult
from wbmpc.cli import app
from wbmpc.commands.annotations import Annotation
from wbmpc.commands.ci import COLUMNS, Entry, annotations_of, entry_of, markdown
from wbmpc.commands.exits import ExitCode
from wbmpc.commands.one_run import Job, Outcome
from wbmpc.junit import Suite
from wbmpc.scenario import counterfactual, load_scenario

SCENARIO = """\
# a comment

name: calm
duration: 2.0
universal:
  penetration: {max: 0.001}
tasks: [{kind: stand}]
checks:
  - {kind: upright_at_end}
  - kind: torque_peak
    max: 0.9
counterfactuals:
  weak:
    set: {seed: 5}
    expect: fail
"""
UNIVERSAL = ("completed", "no_fall", "declared_contacts", "penetration", "torque_limit", "speed_limit")
UNIVERSAL += ("solver_failures", "momentum_balance")
COMMAND = re.compile(r"::error (?P<properties>[^:]*)::(?P<message>.*)")


def read(command: str) -> dict[str, str]:
    """As the runner reads it: properties end at the first ::, are split at commas, then unescaped; one line."""
    found = COMMAND.fullmatch(command)
    assert found, command
    properties = dict(item.split("=", 1) for item in found["properties"].split(",") if item)
    return {key: unquote(value) for key, value in {**properties, "message": found["message"]}.items()}


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY", "GITHUB_WORKSPACE"):
        monkeypatch.delenv(name, raising=False)
    Path("calm.yaml").write_text(SCENARIO)
    return Path("calm.yaml")


def job_of(path: Path, variant: str = "") -> Job:
    scenario = load_scenario(path)
    declared = scenario.counterfactuals[variant] if variant else None
    return Job(counterfactual(scenario, variant) if variant else scenario, variant, declared, Path("out"), True, False)


def outcome_of(failing: tuple[str, ...], line: str = "FAIL calm: so") -> Outcome:
    names = (*UNIVERSAL, "upright_at_end", "torque_peak")
    checks = [
        CheckResult(n, n not in failing, 1.5, 1.0, "m", "at a | b", 0.25 if n in failing else None) for n in names
    ]
    code = ExitCode.FAILED if line.startswith("FAIL") else ExitCode.PASSED
    return Outcome(code, line, Suite("calm", 0.1, []), tuple(checks), simulated_time=2.0, wall_time=0.1)


@given(st.text(), st.text())
@example("50%2C", "100%0Aof %25")
def test_any_text_comes_through(title: str, message: str) -> None:
    """Whatever stands in it, a command is one line, from which the runner's rules give the text back."""
    command = str(Annotation(f"t{title}", message, "a.yaml", 3, 1))
    assert "\n" not in command
    assert "\r" not in command
    # The runner undoes these escapes and no others, the percent sign last.
    found = re.fullmatch(r"::error file=a\.yaml,line=3,col=1,title=([^,:]*)::(.*)", command, re.DOTALL)
    assert found
    for escaped, text in ((found[1], f"t{title}"), (found[2], message)):
        for code, character in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
            escaped = escaped.replace(code, character)
        assert escaped == text


@pytest.mark.parametrize(
    ("check", "line", "column"),
    [
        ("torque_peak", 10, 5),  # its own item of `checks:`
        ("upright_at_end", 9, 5),
        ("penetration", 6, 3),  # set under `universal:`
        ("no_fall", 5, 1),  # universal, not set: the block where it could be
    ],
)
def test_a_failed_check_is_annotated_at_its_line(scenario: Path, check: str, line: int, column: int) -> None:
    (note,) = annotations_of(job_of(scenario), outcome_of((check,)))
    got = read(str(note))
    assert (got["file"], got["line"], got["col"]) == ("calm.yaml", str(line), str(column))
    assert got["title"] == f"calm: {check}"
    assert got["message"] == f"{check} 1.5 m against 1 m: at a | b (first at t = 0.250 s)"


def test_other_failures_are_annotated_where_they_belong(scenario: Path) -> None:
    (note,) = annotations_of(job_of(scenario, "weak"), outcome_of((), "FAIL calm.weak: expected to fail, but passed"))
    assert (note.line, note.column, note.message) == (15, 5, "expected to fail, but passed")
    scenario.write_text(SCENARIO.replace("universal:\n  penetration: {max: 0.001}\n", ""))
    (note,) = annotations_of(job_of(scenario), outcome_of(("no_fall",)))
    assert note.line == 3  # the first line that says something
    broken = Outcome(ExitCode.INTERNAL_ERROR, "FAIL calm: killed", Suite("calm", 0, []))
    (note,) = annotations_of(job_of(scenario), broken)
    assert (note.line, note.message) == (3, "killed")
    job = job_of(scenario)
    scenario.unlink()
    assert [note.file for note in annotations_of(job, broken)] == ["calm.yaml"]
    assert annotations_of(job, outcome_of((), "PASS calm")) == []


def test_paths_are_the_repositorys(scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path.parent))
    assert read(str(Annotation("t", "m", "calm.yaml")))["file"] == f"{tmp_path.name}/calm.yaml"
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path / "elsewhere"))
    assert read(str(Annotation("t", "m", "calm.yaml")))["file"] == "calm.yaml"


def test_the_summary_is_a_table_with_the_failures_first(scenario: Path) -> None:
    good, bad = outcome_of((), "PASS calm"), outcome_of(("torque_peak",), "FAIL calm: torque_peak 1.5 | x")
    text = markdown([entry_of(job_of(scenario), good), entry_of(job_of(scenario, "weak"), bad)])
    lines = text.splitlines()
    assert lines[0] == "### wbmpc: 1 of 2 runs ended as declared"
    rows = [line for line in lines if line.startswith("|")]
    cells = [re.split(r"(?<!\\)\|", row)[1:-1] for row in rows]
    assert {len(row) for row in cells} == {len(COLUMNS)}  # a | of a message does not end its cell
    assert [row[0].strip() for row in cells[2:]] == ["❌", "✅"]
    assert "```sh\nwbmpc run calm.yaml --set seed=5\n```" in text


def test_line_breaks_do_not_end_a_row() -> None:
    text = markdown([Entry(tuple("a\nb" for _ in COLUMNS))])
    assert "| a b | a b |" in text


@pytest.fixture
def ended(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """`wbmpc run` whose run fails a check."""
    monkeypatch.setattr("wbmpc.commands.run.carry_out", lambda job, on_progress: outcome_of(("torque_peak",)))
    return scenario


def run(*words: Any) -> str:
    return CliRunner().invoke(app, ["run", *(str(word) for word in words)]).output


def test_only_where_the_environment_asks(ended: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "::error" not in run(ended)
    monkeypatch.setenv("GITHUB_ACTIONS", "false")
    assert "::error" not in run(ended)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    assert "\n::error file=calm.yaml,line=10,col=5,title=calm%3A torque_peak::" in run(ended)
    Path("summary.md").write_text("of an earlier step\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    run(ended)
    assert Path("summary.md").read_text().startswith("of an earlier step\n### wbmpc: 0 of 1")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "/dev/null/summary.md")
    assert "no summary: GITHUB_STEP_SUMMARY=/dev/null/summary.md: Not a directory" in run(ended)


def test_mistakes_are_annotated(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario.write_text(SCENARIO.replace("duration:", "durations:"))
    assert "::error" not in run(scenario)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    for command in ("run", "validate"):
        output = CliRunner().invoke(app, [command, str(scenario)]).output
        (line,) = [line for line in output.splitlines() if line.startswith("::error")]
        got = read(line)
        assert (got["file"], got["line"], got["col"]) == ("calm.yaml", "4", "1")
        assert got["message"] == "durations: unknown key, did you mean 'duration'?"
    scenario.write_text(SCENARIO)
    assert "::error title=scenario is not valid::--set durations: unknown key" in run(scenario, "--set", "durations=1")
