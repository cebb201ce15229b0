"""Sweeps: draws that depend on seed and index alone, a journal that survives kills, a summary that hides nothing."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta
from sweep_work import breaking_row, fake_row, forbidden
from typer.testing import CliRunner

import wbmpc.commands.sweep as command
from wbmpc.cli import app
from wbmpc.errors import WbmpcError
from wbmpc.scenario import Variation, load_scenario
from wbmpc.sweep import Draw, draw_values, header_of, run_draws, scenario_of, severity
from wbmpc.sweep_journal import Journal
from wbmpc.versions import source_hash

SCENARIO = """
name: calm
duration: 2.0
tasks: [{kind: stand}]
checks: [{kind: upright_at_end}]
sweep:
  variations:
    - {key: plant.mass_scale, uniform: [0.9, 1.1]}
    - {key: world.floor.friction, choice: [0.4, 0.8]}
  checks: [{kind: torque_peak, max: 0.5}]
"""
VARIATIONS = (Variation(key="a.b", uniform=(-2.0, 3.0)), Variation(key="c", choice=("left", [1, 2], None)))
HEADER = {"format": 1, "seed": 3}


@given(st.integers(0, 2**63 - 1), st.integers(0, 10**6))
def test_a_draw_is_a_function_of_seed_and_index_within_its_range(seed: int, index: int) -> None:
    values, run_seed = draw_values(VARIATIONS, seed=seed, index=index)
    assert (values, run_seed) == draw_values(VARIATIONS, seed=seed, index=index)
    number = values["a.b"]
    assert isinstance(number, float)
    assert -2.0 <= number <= 3.0
    assert float(f"{number:.6g}") == number  # what the reproduce command shows is what ran
    assert values["c"] in ("left", [1, 2], None)
    assert 0 <= run_seed < 2**31


def test_draws_differ_and_fill_their_range() -> None:
    draws = [draw_values(VARIATIONS, seed=1, index=k) for k in range(400)]
    numbers = [float(values["a.b"]) for values, _ in draws]  # type: ignore[arg-type]
    assert len(set(numbers)) == len({seed for _, seed in draws}) == 400
    # Mean of a uniform: 0.5 ± 1.44/sqrt(400); six standard errors never fail by chance.
    assert abs(sum(numbers) / 400 - 0.5) < 6 * 5 / math.sqrt(12 * 400)
    assert min(sum(values["c"] == choice for values, _ in draws) for choice in ("left", [1, 2], None)) > 80
    assert draw_values(VARIATIONS, seed=2, index=0) != draws[0]


def draws_of(path: Path, count: int) -> list[Draw]:
    variations = load_scenario(path).sweep.variations  # type: ignore[union-attr]
    found = []
    for index in range(count):
        values, seed = draw_values(variations, seed=5, index=index)
        found.append(Draw(index, str(path), seed, values, {}))
    return found


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "calm.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    return path


def test_a_draw_changes_the_scenario_and_takes_the_checks_of_the_sweep(scenario: Path) -> None:
    draw = Draw(0, str(scenario), 77, {"plant.mass_scale": 1.05, "world.floor.friction": 0.4}, {})
    changed = scenario_of(load_scenario(scenario), draw)
    assert (changed.plant.mass_scale, changed.world.floor.friction, changed.seed) == (1.05, 0.4, 77)
    assert [check.kind for check in changed.checks] == ["torque_peak"]


def test_every_finished_draw_is_in_the_journal_and_reported(scenario: Path, tmp_path: Path) -> None:
    draws = draws_of(scenario, 6)
    journal = Journal(tmp_path / "j.jsonl", HEADER)
    seen: list[int] = []
    rows = run_draws(draws, journal, jobs=1, on_done=lambda row: seen.append(row["draw"]), work=fake_row)
    assert rows == Journal(journal.path, HEADER).rows == [fake_row(draw) for draw in draws]
    assert seen == list(range(6))


def test_finished_draws_are_not_run_again(scenario: Path, tmp_path: Path) -> None:
    draws = draws_of(scenario, 3)
    journal = Journal(tmp_path / "j.jsonl", HEADER)
    for draw in reversed(draws):
        journal.append(fake_row(draw))
    resumed = Journal(journal.path, HEADER)
    rows = run_draws(draws, resumed, jobs=1, on_done=lambda row: pytest.fail("nothing is new"), work=forbidden)
    assert rows == [fake_row(draw) for draw in draws]


@settings(max_examples=30)
@given(st.data())
def test_a_journal_cut_anywhere_keeps_its_complete_lines(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("journal") / "j.jsonl"
    journal = Journal(path, HEADER)
    rows = [{"draw": k, "text": "ä\n" * k} for k in range(4)]
    for row in rows:
        journal.append(row)
    whole = path.read_bytes()
    cut = data.draw(st.integers(0, len(whole)))
    path.write_bytes(whole[:cut])
    complete = max(0, whole[:cut].count(b"\n") - 1)  # the first line is the header
    resumed = Journal(path, HEADER)
    assert resumed.rows == rows[:complete]
    for row in rows[complete:]:
        resumed.append(row)
    assert path.read_bytes() == whole


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"sweep": {"format": 1, "seed": 4}}\n', "its seed differ"),
        ('{"sweep": {"format": 1}}\n', "its seed differ"),
        ("hello\n", "not the journal of a sweep"),
        ("[1]\n", "not the journal of a sweep"),
        ('{"draw": 1}\n', "not the journal of a sweep"),
    ],
)
def test_a_foreign_journal_is_refused_and_left_alone(content: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    path.write_text(content)
    with pytest.raises(WbmpcError, match=words):
        Journal(path, HEADER)
    assert path.read_text() == content


def test_the_header_changes_with_everything_that_changes_a_result(scenario: Path, tmp_path: Path) -> None:
    robot = tmp_path / "robot.xml"
    robot.write_text("<mujoco/>")

    def header(**changes: Any) -> dict[str, Any]:
        return header_of(scenario, **{"seed": 1, "overrides": {}, "robot": robot, **changes})

    first = header()
    assert first == header()
    assert first != header(seed=2)
    assert first != header(overrides={"duration": 3})
    robot.write_text("<mujoco model='other'/>")
    second = header()
    assert first != second
    scenario.write_text(SCENARIO + "\n# a comment\n")
    assert second != header()


def test_the_source_hash_sees_names_and_contents(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("x = 1")
    first = source_hash(tmp_path)
    (tmp_path / "a.py").write_text("x = 2")
    second = source_hash(tmp_path)
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    assert len({first, second, source_hash(tmp_path)}) == 3


def row_of(*checks: tuple[str, bool, float | None, float], error: str | None = None) -> dict[str, Any]:
    return {
        "error": error,
        "checks": [{"name": n, "passed": p, "value": v, "threshold": t} for n, p, v, t in checks],
    }


def test_worse_draws_come_first() -> None:
    ordered = [
        row_of(error="broke"),
        row_of(("reach", False, None, 0.01), ("fall", False, 0.1, 0.3)),
        row_of(("reach", False, None, 0.01), ("fall", True, 1.0, 0.3)),
        row_of(("reach", False, 0.03, 0.01)),
        row_of(("reach", False, 0.011, 0.01)),
        row_of(("reach", True, 0.0099, 0.01), ("fall", True, 0.3, 0.3)),
        row_of(("reach", True, 0.002, 0.01), ("fall", True, 0.3, 0.3)),
    ]
    assert sorted(reversed(ordered), key=lambda row: severity(row, ["fall"]), reverse=True) == ordered


def test_the_interval_is_clopper_pearson() -> None:
    rows = [{"passed": k != 7, "error": None} for k in range(40)]
    document = command.summary("x", 1, rows, {"set": {}, "scenario_sha256": "ab"})
    assert (document["passed"], document["pass_rate"]) == (39, 0.975)
    assert document["interval"]["low"] == pytest.approx(beta.ppf(0.025, 39, 2), abs=1e-9)
    assert document["interval"]["high"] == pytest.approx(beta.ppf(0.975, 40, 1), abs=1e-9)


def sweep(scenario: Path, out: Path, *words: object) -> Any:
    arguments = ["sweep", scenario, "--out", out, "--draws", 8, "--seed", 5, "--jobs", 1, *words]
    return CliRunner().invoke(app, [str(word) for word in arguments])


def use(monkeypatch: pytest.MonkeyPatch, work: Any) -> None:
    def with_work(*args: Any, **options: Any) -> Any:
        return run_draws(*args, **options, work=work)

    monkeypatch.setattr(command, "run_draws", with_work)


def test_the_command_writes_the_same_file_for_any_number_of_jobs(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, fake_row)
    expected = sum(fake_row(draw)["passed"] for draw in draws_of(scenario, 8))
    assert 0 < expected < 8
    files = []
    for jobs in (1, 2):
        result = sweep(scenario, tmp_path / str(jobs), "--jobs", jobs)
        assert result.exit_code == 1, result.output
        assert f"FAIL calm: {expected} of 8 draws passed" in result.output
        files.append((tmp_path / str(jobs) / "calm.sweep.json").read_bytes())
        assert not (tmp_path / str(jobs) / "calm.sweep.jsonl").exists()
    assert files[0] == files[1]
    assert [row["draw"] for row in json.loads(files[0])["results"]] == list(range(8))
    assert sweep(scenario, tmp_path, "--min-rate", 0.1).exit_code == 0


def test_the_reproduce_command_makes_the_same_run(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, fake_row)
    output = sweep(scenario, tmp_path, "--set", "duration=1.75").output
    lines = [shlex.split(line) for line in output.splitlines() if line.startswith("  wbmpc run")]
    assert len(lines) == command.WORST_SHOWN
    worst = min(draws_of(scenario, 8), key=lambda draw: float(draw.values["plant.mass_scale"]))  # type: ignore[arg-type]
    seen: list[Any] = []
    monkeypatch.setattr("wbmpc.commands.run.run", lambda paths, options: seen.append((paths, options)) or 0)
    assert CliRunner().invoke(app, lines[0][1:]).exit_code == 0
    paths, options = seen[0]
    again = load_scenario(paths[0], options.overrides, options.seed)
    expected = scenario_of(load_scenario(scenario, {"duration": 1.75}), worst)
    assert again.plant == expected.plant
    assert again.world == expected.world
    assert (again.seed, again.duration) == (expected.seed, 1.75)


def test_a_draw_that_breaks_the_program_is_an_internal_error(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, breaking_row)
    result = sweep(scenario, tmp_path)
    assert result.exit_code == 3
    assert "IndexError: off by one" in result.output


def test_a_sweep_without_variations_or_with_a_foreign_journal_is_bad_input(scenario: Path, tmp_path: Path) -> None:
    (tmp_path / "calm.sweep.jsonl").write_text("hello\n")
    result = sweep(scenario, tmp_path)
    assert result.exit_code == 2
    assert "not the journal of a sweep" in result.output
    scenario.write_text(SCENARIO[: SCENARIO.index("sweep:")])
    result = sweep(scenario, tmp_path)
    assert result.exit_code == 2
    assert "declares no sweep" in result.output
