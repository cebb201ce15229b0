"""Latency sweeps: which delays are run, what is said of them, and what is left behind."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from wbmpc.checks.result import CheckResult
from wbmpc.cli import app
from wbmpc.errors import ScenarioError
from wbmpc.latency import at_delay, boundary, first_failed, key_check, margin, run_delays
from wbmpc.scenario import load_scenario

STAND = Path(__file__).parents[1] / "scenarios" / "stand.yaml"


def row(delay: float, passed: bool = True, error: str | None = None, checks: Any = ()) -> dict[str, Any]:
    return {"delay": delay, "passed": passed, "error": error, "checks": list(checks)}


def check(name: str, passed: bool, value: float | None, threshold: float, at: float | None = None) -> dict[str, Any]:
    return {"name": name, "passed": passed, "value": value, "threshold": threshold, "first_violation": at, "unit": "m"}


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([row(0.0), row(0.01), row(0.02, False), row(0.03)], (0.01, 0.02)),
        ([row(0.0, False), row(0.01), row(0.02), row(0.05, False)], (0.02, 0.05)),  # too fresh is not too old
        ([row(0.0), row(0.2)], (0.2, None)),
        ([row(0.0, False), row(0.2, False)], (None, None)),
        ([row(0.0), row(0.01, False, error="broken"), row(0.02, False)], (0.0, 0.02)),
        ([row(0.03, False), row(0.01)], (0.01, 0.03)),
        ([], (None, None)),
    ],
)
def test_boundary(rows: list[dict[str, Any]], expected: tuple[float | None, float | None]) -> None:
    assert boundary(rows) == expected


@pytest.mark.parametrize(("limit", "tried"), [(47, [40, 50, 60]), (0, [10]), (300, []), (85, [60, 80, 90])])
def test_bisection_to_one_planner_period(limit: int, tried: list[int]) -> None:
    """Passes up to `limit` [ms]: nothing is run twice, and the boundary is known to 10 ms."""
    ran: list[int] = []

    def work(scenario: Any) -> dict[str, Any]:
        ran.append(round(1e3 * scenario.loop.planner_delay))
        return row(scenario.loop.planner_delay, passed=ran[-1] <= limit)

    done: list[Any] = []
    rows = run_delays(load_scenario(STAND), [0, 30, 100, 200, 100], jobs=1, on_done=done.append, work=work)
    assert sorted(ran) == sorted({0, 30, 100, 200, *tried})
    assert len(done) == len(ran)
    assert [r["delay"] for r in rows] == sorted(r["delay"] for r in rows)
    if tried:
        passes, fails = boundary(rows)
        assert passes is not None
        assert fails is not None
        assert 1e3 * passes <= limit < 1e3 * fails
        assert fails - passes == pytest.approx(0.01)


def test_delays_that_are_no_multiple_of_the_period_are_bisected_too() -> None:
    work = lambda scenario: row(scenario.loop.planner_delay, passed=scenario.loop.planner_delay < 0.02)  # noqa: E731
    rows = run_delays(load_scenario(STAND), [3, 18, 33], jobs=1, on_done=lambda r: None, work=work)
    assert [round(1e3 * r["delay"]) for r in rows] == [3, 18, 28, 33]


def test_a_run_that_breaks_the_program_is_not_asked_again() -> None:
    def work(scenario: Any) -> dict[str, Any]:
        delay = scenario.loop.planner_delay
        return row(delay, passed=delay < 0.01, error="broken" if delay == 0.02 else None)

    rows = run_delays(load_scenario(STAND), [0, 40], jobs=1, on_done=lambda r: None, work=work)
    assert [r["delay"] for r in rows] == [0.0, 0.02, 0.04]


def test_only_the_delay_changes() -> None:
    scenario = load_scenario(STAND, seed=4)
    late = at_delay(scenario, 30)
    assert late.loop.planner_delay_ticks == 30
    assert late.seed == 4
    assert at_delay(late, 10).to_document() == at_delay(scenario, 10).to_document()
    with pytest.raises(ScenarioError, match="planner_delay"):
        at_delay(scenario, 1001)


def test_words_about_checks() -> None:
    checks = [
        check("completed", False, 2.0, 5.0),
        check("reach", False, 0.05, 0.01, at=3.0),
        check("no_fall", False, 0.1, 0.3, at=2.0),
        check("count", True, 1.0, 1.0),
        check("brace", True, 0.3, 0.25),
    ]
    found = first_failed(row(0.0, False, checks=checks))
    assert found is not None
    assert found["name"] == "no_fall"
    assert first_failed(row(0.0)) is None
    assert [margin(c) for c in checks] == pytest.approx([-0.6, -1.0, -2 / 3, 0.0, 0.2])
    assert margin(check("lost", False, None, 1.0)) == -1.0
    assert margin(check("none", True, 0.0, 0.0)) == 1.0


def test_the_key_check_measures_something() -> None:
    count, metres = check("steps", True, 3.0, 3.0) | {"unit": "1"}, check("reach", True, 0.0, 0.1)
    assert key_check(row(0.0, checks=[check("completed", True, 2.0, 2.0), count, metres])) == "reach"
    assert key_check(row(0.0, checks=[count])) == "steps"


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """The command on `stand`, whose runs are made up: falls from 45 ms on, breaks the program at 500 ms."""

    def run_scenario(scenario: Any, *, name: str) -> Any:
        delay = scenario.loop.planner_delay
        if delay == 0.5:
            raise ZeroDivisionError("off by one")
        value = 1.0 - 5 * delay
        checks = [
            CheckResult("no_fall", value > 0.775, value, 0.775, "1", "", None if value > 0.775 else 1.5),
            CheckResult("upright_at_end", True, 0.99, 0.95, "1", "", None),
        ]
        passed = all(c.passed for c in checks)
        verdict = SimpleNamespace(passed=passed, checks=checks, metrics={"plans": float("nan")}, state_sha256="ab")
        return SimpleNamespace(verdict=verdict)

    monkeypatch.setattr("wbmpc.session.run_scenario", run_scenario)

    def invoke(*words: object) -> Result:
        options = ["--jobs", "1", "--out", tmp_path, *words]
        return CliRunner().invoke(app, ["latency", str(STAND), *(str(word) for word in options)])

    return invoke


def test_the_command_prints_and_writes(call: Any, tmp_path: Path) -> None:
    result = call("--seed", 3, "--set", "plant.mass_scale=1.1")
    assert result.exit_code == 0, result.output
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["delay", "[ms]", "verdict", "upright_at_end", "first", "failed", "check"] in lines
    assert ["40", "pass", "0.99"] in lines
    assert ["50", "FAIL", "0.99", "no_fall", "0.75", "against", "0.775,", "1.50", "s"] in lines
    assert "stand passes up to 40 ms and fails from 50 ms" in result.stdout
    document = json.loads((tmp_path / "stand_latency.json").read_text())
    assert (document["passes_up_to"], document["fails_from"], document["planner_period"]) == (0.04, 0.05, 0.01)
    assert (document["seed"], document["set"]) == (3, {"plant.mass_scale": 1.1})
    assert [round(1e3 * r["delay"]) for r in document["results"]] == [0, 10, 20, 40, 50, 60, 80, 100, 150, 200]
    assert document["results"][0]["metrics"] == {"plans": None}
    with Image.open(tmp_path / "stand_latency.webp") as picture:
        assert min(picture.size) > 200


def test_delays_and_format_of_the_figure(call: Any, tmp_path: Path) -> None:
    result = call("--delay", 10, "--delay", 0, "--format", "svg")
    assert result.exit_code == 0, result.output
    assert "stand passes up to 10 ms, the largest delay tried" in result.stdout
    assert (tmp_path / "stand_latency.svg").read_text().startswith("<?xml")


def test_a_run_that_breaks_the_program_is_named(call: Any) -> None:
    result = call("--delay", 10, "--delay", 500)
    assert result.exit_code == 3
    assert "ZeroDivisionError: off by one" in result.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--delay", 0.5), "--delay 0.5: not a multiple of the timestep, 1 ms"),
        (("--delay", 1001), "--delay 1001: loop.planner_delay must be ≤ 1"),
        (("--delay", "nan"), "--delay"),
        (("--delay", "inf"), "--delay inf"),
        (("--delay", -1), "--delay"),
        (("--format", "xyz"), "--format xyz"),
        (("--set", "tasks.9.kind=walk"), "--set tasks.9.kind"),
    ],
)
def test_bad_input_exits_2(call: Any, words: tuple[object, ...], message: str) -> None:
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
