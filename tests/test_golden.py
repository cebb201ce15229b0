"""Golden results: made, kept, compared within their tolerances, and what is no golden result."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_cli import check, recorder_of, verdict, write
from typer.testing import CliRunner, Result

import wbmpc.session
from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.golden import BY_METRIC, Entry, against_golden, read_golden, write_golden
from wbmpc.scenario import load_scenario

ROOT = Path(__file__).parents[1]
GOLDEN = ROOT / "scenarios" / "golden"


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """What a faked run measures."""
    metrics = {"com_height_min": 0.2, "first_hand_contact": float("nan"), "hand_contacts": 2.0}

    def run_scenario(scenario: Any, *, name: str, **_: Any) -> Any:
        reach = check("reach", value=metrics.get("reach", 0.1), passed=metrics.get("reach", 0.1) < 1.0)
        result = verdict(name, [check("upright_at_end"), reach], scenario.seed)
        result = replace(result, metrics={k: v for k, v in metrics.items() if k != "reach"})
        return SimpleNamespace(verdict=result, recorder=recorder_of(1.0), wall_time=0.1)

    monkeypatch.setattr(wbmpc.session, "run_scenario", run_scenario)
    return metrics


def run(folder: Path, *words: str) -> Result:
    path = write(folder, "calm")
    return CliRunner().invoke(app, ["run", str(path), "--out", str(folder / "out"), *words])


def test_a_run_against_its_own_golden_result_passes(measured: dict[str, float], tmp_path: Path) -> None:
    golden = tmp_path / "golden"
    assert run(tmp_path, "--write-golden", str(golden)).exit_code == 0
    result = run(tmp_path, "--golden", str(golden))
    assert result.exit_code == 0, result.output
    document = json.loads((tmp_path / "out" / "calm.json").read_text())
    assert document["golden"] == {"file": str(golden / "calm.json"), "passed": True, "deviations": []}


def test_a_metric_off_its_tolerance_fails_the_run_everywhere(measured: dict[str, float], tmp_path: Path) -> None:
    golden = tmp_path / "golden"
    run(tmp_path, "--write-golden", str(golden))
    measured["com_height_min"], measured["reach"] = 0.25, 0.1005
    result = run(tmp_path, "--golden", str(golden))
    assert result.exit_code == 1
    assert "metrics.com_height_min 0.25 (± 0.0003 of 0.2)" in result.output.splitlines()[-1]
    assert "reach" not in result.output.splitlines()[-1]  # 0.5 mm of 10 cm
    document = json.loads((tmp_path / "out" / "calm.json").read_text())
    assert document["passed"] is True  # its checks did
    assert [row["name"] for row in document["golden"]["deviations"]] == ["metrics.com_height_min"]
    (case,) = [
        c for c in ElementTree.parse(tmp_path / "out" / "junit.xml").iter("testcase") if c.get("name") == "golden"
    ]
    assert case.find("failure") is not None


def test_what_could_not_be_measured_is_no_number(measured: dict[str, float], tmp_path: Path) -> None:
    golden = tmp_path / "golden"
    run(tmp_path, "--write-golden", str(golden))
    measured["first_hand_contact"] = 1.0
    assert run(tmp_path, "--golden", str(golden)).exit_code == 1
    del measured["first_hand_contact"]
    assert run(tmp_path, "--golden", str(golden)).exit_code == 0  # null, or nothing at all: neither is a number


def test_edited_tolerances_are_kept_and_values_are_new(measured: dict[str, float], tmp_path: Path) -> None:
    folder = tmp_path / "golden"
    run(tmp_path, "--write-golden", str(folder))
    document = json.loads((folder / "calm.json").read_text())
    document["metrics"]["com_height_min"]["atol"] = 0.5
    (folder / "calm.json").write_text(json.dumps(document))
    measured["com_height_min"] = 0.3
    run(tmp_path, "--write-golden", str(folder))
    entry = read_golden(folder / "calm.json").metrics["com_height_min"]
    assert (entry.value, entry.atol) == (0.3, 0.5)


def test_a_run_that_fails_makes_no_golden_result(measured: dict[str, float], tmp_path: Path) -> None:
    golden = tmp_path / "golden"
    measured["reach"] = 2.0
    assert run(tmp_path, "--write-golden", str(golden)).exit_code == 1
    assert not (golden / "calm.json").exists()


def test_another_seed_is_another_run(measured: dict[str, float], tmp_path: Path) -> None:
    assert run(tmp_path, "--write-golden", str(tmp_path / "golden"), "--seed", "3").exit_code == 0
    result = run(tmp_path, "--golden", str(tmp_path / "golden"))
    assert result.exit_code == 2
    assert "of seed 3, this run has seed 0" in result.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [(None, "no golden result"), ("{", "not a golden result"), ('{"scenario": "calm"}', "not a golden result: seed")],
)
def test_bad_golden_results_are_one_line(
    text: str | None, words: str, measured: dict[str, float], tmp_path: Path
) -> None:
    if text is not None:
        (tmp_path / "calm.json").write_text(text)
    result = run(tmp_path, "--golden", str(tmp_path))
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert words in result.stderr


@given(st.floats(-10, 10), st.floats(0, 1), st.floats(0, 1), st.floats(-1, 1))
def test_the_tolerance_is_absolute_plus_relative(value: float, atol: float, rtol: float, share: float) -> None:
    entry = Entry(value=value, atol=atol, rtol=rtol)
    allowed = atol + rtol * abs(value)
    assert entry.accepts(value + 0.999 * share * allowed)
    assert not entry.accepts(value + allowed * 1.001 + 1e-9)
    assert not entry.accepts(None)


def test_every_metric_of_a_run_has_its_tolerance() -> None:
    for path in GOLDEN.glob("*.json"):
        assert set(read_golden(path).metrics) == set(BY_METRIC)


def test_every_shipped_scenario_has_its_golden_result() -> None:
    scenarios = {path.stem: load_scenario(path) for path in (ROOT / "scenarios").glob("*.yaml")}
    assert {path.stem for path in GOLDEN.glob("*.json")} == set(scenarios)
    for name, scenario in scenarios.items():
        golden = read_golden(GOLDEN / f"{name}.json")
        assert (golden.scenario, golden.seed) == (name, scenario.seed)
        kinds = {check.name or check.kind for check in scenario.checks}
        assert kinds <= set(golden.checks), f"{name}: made before its checks were changed"


def test_files_read_back(tmp_path: Path) -> None:
    document = verdict("calm", [check("reach")]).as_dict()
    write_golden(tmp_path / "calm.json", document)
    golden = read_golden(tmp_path / "calm.json")
    assert against_golden(tmp_path / "calm.json", golden, document).deviations == ()
    with pytest.raises(WbmpcError, match="no golden result"):
        read_golden(tmp_path / "none.json")
