"""`wbmpc explain`: recorded plans made again to the bit, taken apart, and changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_replay import ROOT, pushed, without_a_schedule
from typer.testing import CliRunner

from wbmpc.cli import app
from wbmpc.explain.changes import OF_A_PLAN, OF_A_RUN, change_of
from wbmpc.explain.explanation import explain
from wbmpc.explain.past import Past, open_past
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.snapshots import digest
from wbmpc.scenario import load_scenario
from wbmpc.session import run_scenario

FIRING = 2.4  # [s] of stage 3 in `reach`
RUNS = {"reach": 2.5, "walk": 2.0, "box_lift": 1.5}  # [s] made of each; half seconds, as the loop asks whether to end


class Recorded:
    """Recordings of the short runs, each made when it is asked for first."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._made: dict[str, tuple[Path, Recorder]] = {}

    def __call__(self, name: str, *, realtime: bool = False) -> tuple[Path, Recorder]:
        if name not in self._made:
            path = self._folder / f"{name}.rrd"
            scenario = pushed() if name == "threaded" else load_scenario(ROOT / "scenarios" / f"{name}.yaml")
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("wbmpc.session.FallWatch", lambda recorder, *_, **__: enough(recorder, RUNS.get(name)))
                self._made[name] = path, run_scenario(scenario, name=name, recording=path, realtime=realtime).recorder
        return self._made[name]


def enough(recorder: Recorder, duration: float | None) -> Callable[[], str | None]:
    """Ends a run early, as a fall would."""
    return lambda: "enough" if duration and recorder.ticks >= 1000 * duration else None


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(tmp_path_factory.mktemp("explained"))


@pytest.fixture
def call() -> Callable[..., Any]:
    return lambda *words: CliRunner().invoke(app, ["explain", *(str(word) for word in words)])


@pytest.mark.parametrize("name", RUNS)
def test_the_snapshots_of_all_plans_are_in_the_file_to_the_bit(recorded: Recorded, name: str) -> None:
    path, recorder = recorded(name)
    past, ticks = open_past(path), recorder.timing.snapshots
    assert [plan.state.time for plan in past.plans] == list(recorder.time[ticks])
    assert recorder.stride == 10  # as many snapshots as samples of the controller's signals
    samples = np.searchsorted(recorder.sample_ticks, ticks)
    for column in ("q", "v", "sole_wrench_in_world", "palm_force_in_world", "mass_scale"):
        np.testing.assert_array_equal(
            [getattr(plan.state, column) for plan in past.plans], recorder.column(f"state_{column}")[samples]
        )
    assert [plan.digest for plan in past.plans] == [digest(report) for report in recorder.plans[1:]]


@pytest.mark.parametrize(("name", "at"), [("reach", FIRING), ("walk", 1.9), ("box_lift", 1.2)])
def test_a_plan_and_all_before_it_are_the_recorded_ones(recorded: Recorded, name: str, at: float) -> None:
    path, recorder = recorded(name)
    past = open_past(path)
    index = past.index_at(at)
    answer = explain(past, index)
    assert answer.time == pytest.approx(at)
    assert answer.identical
    assert answer.parted is None
    report = recorder.plans[1 + index]
    for field in ("com", "zmp", "delta_z", "contact_force", "hand_reference"):
        np.testing.assert_array_equal(getattr(answer.recorded.report, field), getattr(report, field))
    for stage in answer.recorded.stages:
        assert stage.optimum is not None
        assert stage.optimum.residual < 1e-6, stage.stage


def test_snapshots_that_a_planner_skipped_are_not_in_the_way(recorded: Recorded) -> None:
    path, recorder = recorded("threaded", realtime=True)
    past = open_past(path)
    answer = explain(past, len(past.plans) - 1)
    assert len(past.plans) == len(recorder.timing.snapshots)
    assert answer.identical
    assert answer.parted is None


def test_a_digest_tells_plans_apart_and_knows_no_wall_time(recorded: Recorded) -> None:
    report = recorded("reach")[1].plans[10]
    slower = replace(report, plan_time=9.9, stage2=replace(report.stage2, solve_time=9.9))
    assert digest(slower) == digest(report)
    bent = report.com.copy()
    bent[3, 1] = np.nextafter(bent[3, 1], 1.0)
    for other in (
        replace(report, com=bent),
        replace(report, stage2=replace(report.stage2, iterations=report.stage2.iterations + 1)),
        replace(report, contact_patch=("", "x")),
        replace(report, events=("x",)),
    ):
        assert digest(other) != digest(report)


def test_another_bit_of_one_snapshot_is_noticed(recorded: Recorded) -> None:
    past = open_past(recorded("reach")[0])
    plans = list(past.plans)
    bent = plans[30].state.q.copy()
    bent[2] += 1e-4
    plans[30] = replace(plans[30], state=replace(plans[30].state, q=bent))
    answer = explain(Past(past.recording, past.run, plans), 60)
    assert not answer.identical
    assert answer.parted == 30
    assert 0.0 < answer.differences["com"] < 1e-2


def test_a_forbidden_contact_another_price_and_another_friction(recorded: Recorded) -> None:
    past = open_past(recorded("reach")[0])
    index, scenario = past.index_at(FIRING), past.run.scenario

    def with_change(**overrides: Any) -> Any:
        change = change_of(scenario, {key.replace("__", "."): v for key, v in overrides.items()}, allowed=OF_A_PLAN)
        return explain(past, index, change)

    forbidden = with_change(forbid="table_right_1")
    assert forbidden.identical
    chosen = [[c.patch for c in v.candidates if c.chosen] for v in (forbidden.recorded, forbidden.changed)]
    assert chosen[0] == ["table_right_1"]
    assert len(chosen[1]) == 1
    assert chosen[1] != chosen[0]
    for variant in (forbidden.recorded, forbidden.changed):
        for candidate in variant.candidates:
            if np.isfinite(candidate.cost):
                parts = candidate.way_cost + candidate.force_cost + candidate.shift_cost
                assert parts == pytest.approx(candidate.cost, rel=1e-9)
        (stage,) = [stage for stage in variant.stages if stage.stage == "choice"]
        assert stage.objective == pytest.approx(variant.candidates[0].cost, rel=1e-9)
    dearer = with_change(planner__contact__distance_cost=0.8)
    way = [next(c.way_cost for c in v.candidates if c.chosen) for v in (dearer.recorded, dearer.changed)]
    assert way[1] == pytest.approx(2.0 * way[0])
    slippery = with_change(patches__table_right_1__friction=0.02).changed
    assert next(c for c in slippery.candidates if (c.patch, c.hand) == ("table_right_1", 1)).cost > 0.17


def test_the_command_prints_and_writes_it(call: Any, recorded: Recorded, tmp_path: Path) -> None:
    path = recorded("reach")[0]
    listed = call(path)
    assert listed.exit_code == 0, listed.output
    assert "stage 3 fired" in listed.stdout
    target = tmp_path / "new" / "answer.json"
    result = call(path, "--at", FIRING + 0.004, "--set", "forbid=table_right_1", "--json", target)
    assert result.exit_code == 0, result.output
    assert "bit for bit, and so are the 239 before it" in result.stdout
    for words in (
        "stage 1: CoM height",
        "active constraint",
        "table_right_2, right hand",
        "forbidden",
        "tangential",
        "bound by",
    ):
        assert words in result.stdout
    document = json.loads(target.read_text(encoding="utf-8"))
    assert document["identical"] is True
    assert document["changes"] == ["forbid table_right_1"]
    assert [stage["stage"] for stage in document["recorded"]["stages"]] == ["height", "need", "choice", "motion"]
    for stage in document["recorded"]["stages"]:
        assert stage["objective"] == pytest.approx(sum(stage["terms"].values()))
    printed = call(path, "--at", FIRING, "--json", "-")
    assert json.loads(printed.stdout)["recorded"] == document["recorded"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "9"], "outside the recording"),
        (["--at", "0"], "plans from 0.01 s"),
        (["--at", "nan"], "outside the recording"),
        (["--set", "forbid=table_right_1"], "--at"),
        (["--at", "1", "--set", "forbid=table_rigt_1"], "did you mean 'table_right_1'"),
        (["--at", "1", "--set", "forbid={a: 1}"], "unknown patch"),
        (["--at", "1", "--set", "planner.horizon_steps=8"], "in the middle of a run"),
        (["--at", "1", "--set", "world.floor.friction=0.3"], "in the middle of a run"),
        (["--at", "1", "--set", "planner.contact.distence_cost=1"], "distance_cost"),
        (["--at", "1", "--set", "planner.contact.distance_cost=-1"], "distance_cost"),
        (["--at", "1", "--set", "patches.nowhere.friction=0.3"], "nowhere"),
    ],
)
def test_what_cannot_be_explained_is_one_line(call: Any, recorded: Recorded, words: list[str], message: str) -> None:
    result = call(recorded("reach")[0], *words)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_other_files_are_one_line(
    call: Any, recorded: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_a_schedule(tmp_path / "none.rrd")
    result = call(tmp_path / "none.rrd", "--at", 1)
    assert (result.exit_code, len(result.stderr.splitlines())) == (2, 1)
    monkeypatch.setattr("wbmpc.explain.past.recorded_plans", lambda recording: [])
    result = call(recorded("reach")[0], "--at", 1)
    assert result.exit_code == 2
    assert "holds no plan's snapshot" in result.stderr


def test_a_run_may_change_where_a_plan_may_not(recorded: Recorded) -> None:
    scenario = open_past(recorded("reach")[0]).run.scenario
    change = change_of(scenario, {"world.floor.friction": 0.3}, allowed=OF_A_RUN)
    assert list(change.words) == ["world.floor.friction: 0.8 -> 0.3"]
    assert change.scenario.world.floor.friction == 0.3
