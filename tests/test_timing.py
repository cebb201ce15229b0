"""The loop's clock: what it counts, what of it is in the verdict and in the file, and schedules of plans."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import small_run
from short_run import finished, stand
from test_rerun_sink import open_sink

from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import checksums, recorded_run
from wbmpc.timing import LoopTiming, Schedule

RESULTS = Path(__file__).parents[1] / "docs" / "results.md"


def test_summary_counts_and_percentiles() -> None:
    timing = LoopTiming(expected_ticks=2)  # it grows
    timing.begin(timestep=1e-3, realtime=True)
    for k in range(101):
        timing.tick(1e-5 * k, 2e-5 * k)
    timing.plan(snapshot=10, effect=14, ready=12)
    timing.plan(snapshot=20, effect=32, ready=32)
    timing.late_plans, timing.wall_time, timing.simulated_time = 1, 0.202, 0.101
    summary = timing.summary()
    np.testing.assert_allclose([summary[f"tick_late_{p}"] for p in ("p50", "p99", "max")], [5e-4, 9.9e-4, 1e-3])
    np.testing.assert_allclose([summary[f"tick_time_{p}"] for p in ("p50", "p99", "max")], [1e-3, 1.98e-3, 2e-3])
    np.testing.assert_allclose([summary["plan_latency_p50"], summary["plan_latency_max"]], [8e-3, 12e-3])
    np.testing.assert_allclose([summary["plan_ready_p50"], summary["plan_ready_max"]], [7e-3, 12e-3])
    assert (summary["ticks"], summary["plans"], summary["late_plans"]) == (101, 2, 1)
    assert summary["real_time_factor"] == pytest.approx(0.5)
    assert summary["drift"] == pytest.approx(0.101)
    assert summary["planner_rate"] == pytest.approx(2 / 0.202)


def test_nothing_is_late_where_there_is_no_clock() -> None:
    timing, _ = finished(stand(duration=0.05))
    summary = timing.summary()
    assert timing.ticks == 50
    assert timing.tick_time.min() > 0.0
    assert [key for key, value in summary.items() if np.isnan(value)] == [
        "drift", "tick_late_p50", "tick_late_p99", "tick_late_max", "planner_rate",
        "plan_ready_p50", "plan_ready_p99", "plan_ready_max"
    ]  # fmt: skip


def test_an_empty_loop_has_a_summary() -> None:
    assert LoopTiming(expected_ticks=1).summary()["real_time_factor"] == 0.0


def test_every_key_is_documented() -> None:
    text = RESULTS.read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `timing.")]
    documented = set()
    for row in rows:
        first, *rest = (name.strip().strip("`") for name in row.split(","))
        stem = first.removesuffix("_p50")
        documented |= {first.removeprefix("timing."), *(f"{stem}{suffix}".removeprefix("timing.") for suffix in rest)}
    assert documented == set(LoopTiming(expected_ticks=1).summary())


def test_a_constant_schedule() -> None:
    assert Schedule.constant(period=10, delay=3, ticks=31) == Schedule({10: 13, 20: 23, 30: 33}, 31)


def test_the_first_plan_alone_holds_the_robot_up() -> None:
    """The tail of a plan whose successors never come: it holds still."""
    timing, recorder = finished(stand(duration=0.5), schedule=Schedule({}, 500))
    assert recorder.ticks == 500
    assert len(recorder.plans) == 1
    assert recorder.torso_up.min() > 0.99
    assert len(timing.plan_latency) == 0


def test_what_is_in_the_file(tmp_path: Path) -> None:
    """Thinned curves hide no slow tick; schedule, hash and checksums are whole, whatever the blocks."""
    path, recorder = tmp_path / "small.rrd", small_run.new_recorder()
    with open_sink(path, recorder, block=0.0, replay={"made": "up", "third": 1 / 3}) as sink:
        for count in (7, 60, 33):
            small_run.append_ticks(recorder, count)
            sink.flush(recorder.time[-1])
    recording = Recording(path)
    for name, at, worst in (("tick_time", 4, 6.0), ("tick_start_late", 5, 4.0)):
        time, values = recording.column(f"/timing/{name}", "scalars")
        np.testing.assert_allclose(time, np.arange(0, 0.1, 0.01), atol=1e-9)
        assert np.argmax(values) == at  # the sample after the tick
        assert values[at][0] == pytest.approx(worst)
    time, latency = recording.column("/timing/plan_latency", "scalars")
    np.testing.assert_allclose(np.concatenate(latency), 1e3 * recorder.timing.plan_latency)
    np.testing.assert_allclose(time, np.array(recorder.timing.effects) * 1e-3)
    run = recorded_run(recording)
    assert run.document == {"made": "up", "third": 1 / 3}
    assert run.schedule == Schedule({k: k + 4 + k % 3 for k in range(0, 100, 10)}, 100)
    assert run.state_sha256 == recorder.state_sha256
    np.testing.assert_array_equal(run.checksums, checksums(recorder))
    assert len(set(run.checksums)) == 100
