"""Metrics, solver statistics and junit of made-up runs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest
from synthetic import MASS, RIGHT_PALM, TABLE, SyntheticRun

from wbmpc.junit import Case, Suite, write_junit
from wbmpc.metrics import metrics_of
from wbmpc.signals import SolveStatus
from wbmpc.verdict import finite, solver_statistics, write_json


def test_metrics_of_a_braced_run() -> None:
    run = SyntheticRun(200)
    run.com[50, 2], run.com[60, 2] = 0.2, 0.3
    run.torque[10, 0], run.qvel[20, 7] = -1.0, 3.0  # stall 2.0 N·m, no-load 6.0 rad/s
    run.touch(range(80, 120), TABLE, RIGHT_PALM, [3.0, 0.0, 4.0], distance=-0.0004)
    run.plan(0.5, statuses=(SolveStatus.SOLVED, SolveStatus.SOLVED, SolveStatus.SOLVED))
    run.plan(0.6)
    metrics = metrics_of(run.context())
    expected = {
        "simulated_time": 2.0,
        "robot_mass": MASS,
        "com_height_min": 0.2,
        "com_height_max": 0.3,
        "torque_peak_fraction": 0.5,
        "speed_peak_fraction": 0.5,
        "penetration_max": 0.0004,
        "hand_force_max": 5.0,
        "hand_contacts": 1.0,
        "first_hand_contact": 0.8,
        "plans": 2.0,
        "stage3_plans": 1.0,
    }
    assert {name: metrics[name] for name in expected} == pytest.approx(expected)


def test_a_run_without_contacts_or_ticks_has_metrics() -> None:
    run = SyntheticRun(10)
    run.contacts = [[] for _ in range(10)]
    metrics = metrics_of(run.context())
    assert metrics["penetration_max"] == 0.0
    assert math.isnan(metrics["first_hand_contact"])
    assert metrics_of(SyntheticRun(0).context()) == {"simulated_time": 0.0}


def test_solver_statistics_count_only_what_ran() -> None:
    run = SyntheticRun(100)
    run.fallback[3:5] = True
    for k in range(4):
        stage3 = SolveStatus.INFEASIBLE if k == 2 else SolveStatus.NOT_RUN
        run.plan(0.1 * k, statuses=(SolveStatus.SOLVED, SolveStatus.SOLVED, stage3))
    statistics = solver_statistics(run.context().recorder)
    assert list(statistics) == ["tracker", "stage1", "stage2", "stage3", "plan"]
    assert (statistics["tracker"]["solves"], statistics["tracker"]["failures"]) == (100, 2)
    assert (statistics["stage1"]["solves"], statistics["stage3"]["solves"]) == (4, 1)
    assert statistics["stage3"]["failures"] == 1
    assert statistics["plan"]["p50"] == pytest.approx(2e-3)
    assert math.isnan(solver_statistics(SyntheticRun(10).context().recorder)["stage3"]["p99"])


def test_json_has_no_nan_and_replaces_the_old_file_whole(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text("old")
    write_json(path, finite({"a": [math.nan, {"b": -math.inf}], "c": (1.5, "nan")}))
    assert json.loads(path.read_text()) == {"a": [None, {"b": None}], "c": [1.5, "nan"]}
    with pytest.raises(ValueError, match="JSON"):
        write_json(path, {"a": math.nan})
    assert json.loads(path.read_text())["c"] == [1.5, "nan"]


def test_junit_survives_any_text(tmp_path: Path) -> None:
    path = tmp_path / "junit.xml"
    write_junit(path, [Suite("a <b>", 1.25, [Case("x & y", None), Case("z", 'said "no"\x00\x1b – ≥')])])
    suite = ElementTree.parse(path).getroot()[0]
    assert (suite.get("name"), suite.get("tests"), suite.get("failures"), suite.get("time")) == (
        "a <b>",
        "2",
        "1",
        "1.250",
    )
    failure = suite[1].find("failure")
    assert failure is not None
    assert failure.get("message") == 'said "no"?? – ≥'
