"""`wbmpc compare`: the first tick and the signals at which two runs part, metrics and checks beside each other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_run
from test_rerun_sink import VERDICT, open_sink
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.comparison import Tolerance, compare_results
from wbmpc.errors import WbmpcError

RUN = {"scenario": {"loop": {"physics_rate": 1000}}, "realtime": True}


def record(path: Path, *, ticks: int = 300, change: Any = None, metrics: dict[str, float] | None = None) -> Path:
    """A made-up run; `change(recorder)` alters it before it is written."""
    recorder = small_run.new_recorder()
    small_run.append_ticks(recorder, ticks)
    if change is not None:
        change({name: table.rows[name] for name, table in recorder._tables.items()})
    with open_sink(path, recorder, replay=RUN) as sink:
        sink.finish(VERDICT | {"metrics": metrics or VERDICT["metrics"]})
    return path


def nudge(column: str, tick: int, size: float, item: Any = ...) -> Any:
    def change(table: dict[str, np.ndarray]) -> None:
        cell = table[column][tick]
        table[column][tick] = cell + size if item is ... else np.where(np.arange(cell.size) == item, cell + size, cell)

    return change


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("plain") / "a.rrd")


def test_a_run_and_its_repetition_are_the_same(plain: Path, tmp_path: Path) -> None:
    comparison = compare_results(plain, record(tmp_path / "b.rrd"), Tolerance())
    assert comparison.same
    assert comparison.first_tick is None
    assert comparison.signals == ()


def test_the_first_tick_is_exact_between_the_samples(plain: Path, tmp_path: Path) -> None:
    other = record(tmp_path / "b.rrd", change=nudge("qvel", 123, 1e-12, 4))
    comparison = compare_results(plain, other, Tolerance())
    assert (comparison.first_tick, comparison.same) == (123, False)
    assert comparison.signals == ()  # no sample of the file is touched
    assert compare_results(plain, other, Tolerance(atol=1e-9)).same


def test_a_signal_says_since_when_and_how_much(plain: Path, tmp_path: Path) -> None:
    def change(table: dict[str, np.ndarray]) -> None:
        table["torque"][140, 1] += 0.25
        table["torque"][200, 1] -= 2.0
        table["com"][250, 2] += 1e-3

    other = record(tmp_path / "b.rrd", change=change)
    comparison = compare_results(plain, other, Tolerance())
    assert comparison.first_tick is None  # the state is the same
    assert not comparison.same
    torque = next(row for row in comparison.signals if row.name == "/joints/torque right_shoulder")
    assert (torque.time, torque.largest, torque.largest_time) == pytest.approx((0.14, 2.0, 0.2))
    assert [row.time for row in comparison.signals] == sorted(row.time for row in comparison.signals)
    assert not any(row.name.startswith(("/solvers/tracker", "/timing/tick")) for row in comparison.signals)
    loose = compare_results(plain, other, Tolerance(atol=0.5))
    assert {row.time for row in loose.signals if row.name.startswith("/joints/torque ")} == {0.2}
    assert any(row.name.startswith("/com/z") for row in compare_results(plain, other, Tolerance(rtol=1e-4)).signals)
    assert not any(row.name.startswith("/com/z") for row in compare_results(plain, other, Tolerance(rtol=1e-2)).signals)


def test_words_and_numbers_that_are_none(plain: Path, tmp_path: Path) -> None:
    def change(table: dict[str, np.ndarray]) -> None:
        table["command_status"][211] = 1
        table["zmp"][220] = np.nan

    comparison = compare_results(plain, record(tmp_path / "b.rrd", change=change), Tolerance())
    names = {row.name: row for row in comparison.signals}
    assert names["/solver_status/tracker"].time == pytest.approx(0.211)
    assert names["/solver_status/tracker"].b == "INFEASIBLE"
    assert names["/zmp/x/measured"].b == "nan"


def test_a_run_that_ends_sooner_differs_where_it_ends(plain: Path, tmp_path: Path) -> None:
    comparison = compare_results(plain, record(tmp_path / "b.rrd", ticks=210), Tolerance(atol=1e9))
    assert (comparison.first_tick, comparison.ticks, comparison.same) == (210, (300, 210), False)
    assert comparison.signals[0].b == "no sample"


def test_metrics_and_checks_of_verdicts(plain: Path, tmp_path: Path) -> None:
    document = json.loads(json.dumps(VERDICT)) | {"state_sha256": "ab"}
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    first.write_text(json.dumps(document))
    document["metrics"] = {"com_height_min": 0.26, "new": None}
    document["state_sha256"] = "cd"
    second.write_text(json.dumps(document))
    comparison = compare_results(first, second, Tolerance(atol=0.02))
    assert {row.name: row.differs for row in comparison.numbers} == {
        "metrics.com_height_min": False, "metrics.new": True, "checks.no_fall": False,
    }  # fmt: skip
    assert not comparison.same
    assert compare_results(first, first, Tolerance()).same
    assert compare_results(first, plain, Tolerance(atol=1.0)).same  # a verdict and a recording of one run


def test_the_command_and_its_exit_codes(plain: Path, tmp_path: Path) -> None:
    other = record(tmp_path / "b.rrd", change=nudge("torque", 200, 1.0), metrics={"com_height_min": 0.3})
    same = CliRunner().invoke(app, ["compare", str(plain), str(plain)])
    assert (same.exit_code, same.output.splitlines()[-1]) == (0, "same")
    result = CliRunner().invoke(app, ["compare", str(plain), str(other), "--all"])
    assert result.exit_code == 1
    assert "/joints/torque left_shoulder" in result.output
    assert "+0.05" in result.output
    assert CliRunner().invoke(app, ["compare", str(plain), str(other), "--atol", "1e6"]).exit_code == 0
    for bad in (tmp_path / "none.rrd", tmp_path / "x.txt", tmp_path / "empty.json"):
        (tmp_path / "empty.json").write_text("{}")
        wrong = CliRunner().invoke(app, ["compare", str(plain), str(bad)])
        assert wrong.exit_code == 2
        assert len(wrong.stderr.strip().splitlines()) == 1
    with pytest.raises(WbmpcError, match="not the verdict"):
        compare_results(plain, tmp_path / "empty.json", Tolerance())
