"""What is in the file is what was in the recorder, also after a kill."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import small_run
from rerun.chunk import RrdReader

from wbmpc.errors import WbmpcError
from wbmpc.footage import Footage
from wbmpc.recorder import Recorder
from wbmpc.rerun_sink import Patch, RerunSink
from wbmpc.rerun_sink.documents import Table, firing_document, parts_of, verdict_document
from wbmpc.rerun_sink.glyphs import drawable
from wbmpc.rerun_sink.palette import METRES_PER_NEWTON
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.ticks import CONTACT_GEOMS

VERDICT = {
    "scenario": "small",
    "passed": False,
    "checks": [{"name": "no_fall", "passed": False, "value": 0.1, "threshold": 0.3, "unit": "m", "message": "a|b"}],
    "metrics": {"com_height_min": 0.25},
}


def open_sink(path: Path, recorder: Recorder, **options: Any) -> RerunSink:
    patches = [Patch(name, corners, np.array([0.0, 0, 1])) for name, corners in small_run.PATCHES.items()]
    defaults: dict[str, Any] = {
        "joint_names": small_run.JOINT_NAMES,
        "scenario_name": "small",
        "scenario_text": "name: small",
        "seed": 3,
        "tick_rate": 1000.0,
        "patches": patches,
        "versions": {"mujoco": mujoco.__version__},
    }
    return RerunSink(path, small_run.compile_model(), recorder, **(defaults | options))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recorder, Recording]:
    """A run written in blocks that are no multiple of the stride, and read back."""
    path = tmp_path_factory.mktemp("recorded") / "new folder" / "small.rrd"
    recorder = small_run.new_recorder()
    with open_sink(path, recorder, block=0.0) as sink:
        for count in (1, 36, 3, 80, 7, 173):
            small_run.append_ticks(recorder, count)
            sink.flush(recorder.time[-1])
        recorder.event(0.123, "something happened")
        sink.finish(VERDICT)
    return recorder, Recording(path)


@pytest.mark.parametrize("name", ["qpos", "qvel"])
def test_every_tenth_tick_is_in_the_file_bit_by_bit(recorded: tuple[Recorder, Recording], name: str) -> None:
    recorder, recording = recorded
    time, values = recording.column(f"/state/{name}", "scalars")
    np.testing.assert_allclose(time, np.arange(0, 300, 10) * 1e-3, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(values, recorder.column(name)[::10])


def test_curves_hold_what_their_names_say(recorded: tuple[Recorder, Recording]) -> None:
    recorder, recording = recorded
    for axis in range(3):
        _, values = recording.column(f"/com/{'xyz'[axis]}", "scalars")
        expected = np.column_stack([recorder.com[::10, axis], recorder.setpoint_com_position[::10, axis]])
        np.testing.assert_array_equal(values, expected)
        assert recording.static(f"/com/{'xyz'[axis]}", "names") == ["CoM measured", "CoM planned"]
    _, torque = recording.column("/joints/torque", "scalars")
    np.testing.assert_array_equal(torque, recorder.torque[::10])
    assert tuple(recording.static("/joints/torque", "names")) == small_run.JOINT_NAMES
    _, share = recording.column("/joints/torque_share", "scalars")
    np.testing.assert_allclose(share, np.abs(recorder.torque[::10]) / 2.5)
    _, error = recording.column("/tracking/palm_error", "scalars")
    np.testing.assert_allclose(np.array(error)[:, 0], 10.0)  # the made-up reference is 10 mm ahead
    assert np.isnan(np.array(error)[:, 1]).all()  # the right hand follows nothing


def test_body_poses_agree_with_mujocos_kinematics(recorded: tuple[Recorder, Recording]) -> None:
    recorder, recording = recorded
    model = small_run.compile_model()
    data = mujoco.MjData(model)
    path = r"/world/bodies/left\ arm"
    _, positions = recording.column(path, "translation")
    _, quaternions = recording.column(path, "quaternion")
    for k in (0, 7, 29):
        data.qpos[:] = recorder.qpos[10 * k]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(np.ravel(positions[k]), data.body("left arm").xpos, atol=1e-6)
        x, y, z, w = np.ravel(quaternions[k])
        np.testing.assert_allclose([w, x, y, z], data.body("left arm").xquat, atol=1e-6)


def test_thinning_hides_neither_a_slow_nor_a_failed_solve(recorded: tuple[Recorder, Recording]) -> None:
    _, recording = recorded  # tick 33 took 5 ms and failed; ticks 30 and 40 are in the file
    time, worst = recording.column("/solvers/tracker", "scalars")
    slow = np.ravel(worst) > 4.0
    np.testing.assert_allclose(time[slow], [0.04])
    stamps, states = recording.column("/solver_status/tracker", "state")
    assert [str(s[0]) for s in states] == ["SOLVED", "INFEASIBLE, fallback", "SOLVED"]
    np.testing.assert_allclose(stamps, [0.0, 0.033, 0.034])


def test_contacts_come_and_go(recorded: tuple[Recorder, Recording]) -> None:
    recorder, recording = recorded
    _, vectors = recording.column("/world/contacts", "vectors")
    assert [len(v) for v in vectors] == list(recorder.contact_count[::10])
    forces = np.concatenate([v for v in vectors if len(v)]) / METRES_PER_NEWTON
    np.testing.assert_allclose(forces, np.tile([1.0, 0.0, 8.0], (len(forces), 1)), rtol=1e-6)


def test_plans_candidates_and_events(recorded: tuple[Recorder, Recording]) -> None:
    recorder, recording = recorded
    time, horizons = recording.column("/world/com/horizon", "strips")
    np.testing.assert_allclose(time, [plan.time for plan in recorder.plans])
    np.testing.assert_allclose(np.squeeze(horizons), [plan.com for plan in recorder.plans], atol=1e-6)
    # A plan's first knot speaks of one knot period later.
    time, zmp = recording.column("/zmp/x/planned", "scalars")
    np.testing.assert_allclose(time, [plan.time + 0.1 for plan in recorder.plans])
    np.testing.assert_array_equal(np.ravel(zmp), [plan.zmp[0, 0] for plan in recorder.plans])
    fired, tables = recording.column("/planner/candidates", "text")
    np.testing.assert_allclose(fired, [0.05])
    assert "unreachable by 20.0 cm" in str(tables[0])
    stamps, phases = recording.column("/contact_phase/left", "state")
    assert [str(p[0]) for p in phases] == ["none", "chosen (table_1)"]
    np.testing.assert_allclose(stamps, [0.0, 0.05])
    stamps, events = recording.column("/log/events", "text")
    assert [str(e[0]) for e in events] == ["contact left table_1: needed -> chosen", "something happened"]
    np.testing.assert_allclose(stamps, [0.05, 0.123])


def test_properties_and_verdict(recorded: tuple[Recorder, Recording]) -> None:
    _, recording = recorded
    assert recording.static("/__properties/run", "scenario") == ["small"]
    assert recording.static("/__properties/run", "seed") == [3]
    assert recording.static("/__properties/versions", "mujoco") == [mujoco.__version__]
    assert recording.static("/__properties/verdict", "passed") == [False]
    assert recording.static("/__properties/metrics", "com_height_min") == [0.25]
    assert "name: small" in recording.static("/scenario", "text")[0]
    assert "FAIL" in recording.static("/verdict", "text")[0]


def test_who_touches_whom_has_a_row_for_every_sample(recorded: tuple[Recorder, Recording]) -> None:
    """Also where nothing is touched in a whole block, as in the first one."""
    recorder, recording = recorded
    times, pairs = recording.column(CONTACT_GEOMS, "geoms")
    np.testing.assert_array_equal(times, recording.column("/state/qpos", "scalars")[0])
    assert [len(pair) // 2 for pair in pairs] == recorder.contact_count[::10].tolist()
    assert not len(pairs[0])


def test_visible_geoms_are_drawn_and_collision_geoms_are_not(recorded: tuple[Recorder, Recording]) -> None:
    _, recording = recorded
    trunk = "/world/bodies/trunk"
    assert recording.static(rf"{trunk}/collision\ only", "half_sizes") == []
    np.testing.assert_allclose(recording.static(f"{trunk}/box_2", "half_sizes"), [[0.04, 0.06, 0.08]])
    assert recording.static(f"{trunk}/box_2", "colors") == [0x334DB2FF]
    np.testing.assert_allclose(recording.static("/world/static/table", "translation"), [[0.3, 0, 0.1]])


def test_footage_from_the_file_is_footage_from_the_recorder(recorded: tuple[Recorder, Recording]) -> None:
    recorder, recording = recorded
    read, direct = recording.footage(), Footage.from_recorder(small_run.compile_model(), recorder, stride=10)
    assert read.model.ngeom == direct.model.ngeom
    np.testing.assert_allclose(read.time, direct.time, atol=1e-12)
    np.testing.assert_array_equal(read.qpos, direct.qpos)
    np.testing.assert_allclose(read.com, direct.com, atol=1e-6)
    for name in ("contact_position", "contact_force"):
        for a, b in zip(getattr(read, name), getattr(direct, name), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)
    for a, b in zip(read.support_polygon, direct.support_polygon, strict=True):
        np.testing.assert_allclose(a[:4], b, atol=1e-6)  # in the file the outline is closed


def test_recording_changes_nothing_in_the_recorder(recorded: tuple[Recorder, Recording]) -> None:
    recorder, _ = recorded
    unrecorded = small_run.new_recorder()
    small_run.append_ticks(unrecorded, 300)
    assert recorder.state_sha256 == unrecorded.state_sha256


def test_flush_waits_for_a_block(tmp_path: Path) -> None:
    recorder = small_run.new_recorder()
    with open_sink(tmp_path / "a.rrd", recorder, block=0.1) as sink:
        small_run.append_ticks(recorder, 95)
        sink.flush(recorder.time[-1])
        with pytest.raises(WbmpcError, match="no samples"):
            Recording(tmp_path / "a.rrd").footage()
        small_run.append_ticks(recorder, 10)
        sink.flush(recorder.time[-1])
        assert len(Recording(tmp_path / "a.rrd").footage().time) == 11


def test_full_rate(tmp_path: Path) -> None:
    recorder = small_run.new_recorder()
    with open_sink(tmp_path / "a.rrd", recorder, rate=1000.0) as sink:
        small_run.append_ticks(recorder, 25)
        sink.close()
        sink.close()  # harmless
    time, qpos = Recording(tmp_path / "a.rrd").column("/state/qpos", "scalars")
    np.testing.assert_allclose(time, recorder.time, atol=1e-12)
    np.testing.assert_array_equal(qpos, recorder.qpos)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
import small_run, test_rerun_sink
recorder = small_run.new_recorder()
sink = test_rerun_sink.open_sink(Path(sys.argv[1]), recorder, block=0.0)
for _ in range(3):
    small_run.append_ticks(recorder, 50)
    sink.flush(recorder.time[-1])
small_run.append_ticks(recorder, 50)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_run_leaves_everything_flushed_before(tmp_path: Path) -> None:
    path = tmp_path / "killed.rrd"
    script = KILLED.format(tests=str(Path(__file__).parent))
    run = subprocess.run([sys.executable, "-c", script, str(path)], cwd=Path(__file__).parents[1], check=False)
    assert run.returncode == -signal.SIGKILL
    same = small_run.new_recorder()
    small_run.append_ticks(same, 150)
    footage = Recording(path).footage()
    np.testing.assert_array_equal(footage.qpos, same.qpos[::10])
    assert "did not end" in Recording(path).static("/verdict", "text")[0]


def test_a_message_cut_in_two_costs_only_itself(tmp_path: Path) -> None:
    recorder = small_run.new_recorder()
    with open_sink(tmp_path / "a.rrd", recorder, block=0.0) as sink:
        small_run.append_ticks(recorder, 100)
        sink.flush(recorder.time[-1])
        first_block = (tmp_path / "a.rrd").stat().st_size
        small_run.append_ticks(recorder, 100)
        sink.flush(recorder.time[-1])
    content = (tmp_path / "a.rrd").read_bytes()
    for end in (first_block, first_block + 1, first_block + 20, first_block + 200):
        (tmp_path / "cut.rrd").write_bytes(content[:end])
        np.testing.assert_array_equal(Recording(tmp_path / "cut.rrd").footage().qpos, recorder.qpos[:100:10])
    with pytest.warns(Warning, match="footer"), pytest.raises(RuntimeError):
        RrdReader(tmp_path / "cut.rrd").stream()  # rerun's own reader is strict: if it is no longer, drop our repair


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no such recording"), (b"", "not a readable"), (b"hello, world", "not a readable"), (b"RRF2", "readable")],
)
def test_what_is_no_recording_is_named(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "a.rrd"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WbmpcError, match=message) as caught:
        Recording(path)
    assert "\n" not in str(caught.value)
    assert "a.rrd" in str(caught.value)


@pytest.mark.parametrize("stride", [2, 10])
def test_a_recorder_that_samples_the_controller_gives_the_same_file(
    tmp_path: Path, recorded: tuple[Recorder, Recording], stride: int
) -> None:
    recorder = small_run.new_recorder(stride=stride)
    with open_sink(tmp_path / "sampled.rrd", recorder, block=0.0) as sink:
        for count in (17, 83, 200):
            small_run.append_ticks(recorder, count)
            sink.flush(recorder.time[-1])
    sampled, whole = Recording(tmp_path / "sampled.rrd"), recorded[1]
    paths = ["/tracking/com_error", "/tracking/palm_error", "/joints/velocity", "/joints/posture_error", "/com/x"]
    paths += [f"/contacts/{side}_{end}" for side in ("left", "right") for end in ("hand", "foot")]
    for path in paths:
        (time, values), (expected_time, expected) = (file.column(path, "scalars") for file in (sampled, whole))
        np.testing.assert_array_equal(time, expected_time)
        np.testing.assert_array_equal(values, expected)


def test_a_recorder_that_samples_too_seldom_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WbmpcError, match="keeps only every 4th tick"):
        open_sink(tmp_path / "a.rrd", small_run.new_recorder(stride=4))


def test_rates_must_divide(tmp_path: Path) -> None:
    for rate in (300.0, 2000.0):
        with pytest.raises(WbmpcError, match="does not divide"):
            open_sink(tmp_path / "a.rrd", small_run.new_recorder(), rate=rate)


def test_unwritable_path_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "a.rrd", tmp_path):
        with pytest.raises(WbmpcError, match="cannot write "):
            open_sink(path, small_run.new_recorder())


def test_every_text_in_the_file_is_drawable(tmp_path: Path) -> None:
    """The viewer ends itself on a character it has no glyph for, wherever that comes from."""
    nasty = "naïve ✘ 机器人 🤖\t\u200b ΔZ"
    recorder = small_run.new_recorder()
    small_run.append_ticks(recorder, 30)
    plan = small_run.made_up_plan(50, np.random.default_rng(0))
    bad = tuple(replace(c, patch=nasty, reason=nasty, beside=(nasty,)) for c in plan.candidates)
    assert plan.firing is not None
    firing = replace(plan.firing, candidates=bad, held=(nasty,))
    recorder.append_plan(replace(plan, firing=firing, contact_patch=(nasty, nasty), events=(nasty,)))
    path = tmp_path / "a.rrd"
    patch = Patch(nasty, small_run.PATCHES["table_1"], np.array([0.0, 0, 1]))
    texts = {"scenario_name": nasty, "scenario_text": f"name: {nasty}", "joint_names": (nasty, "b")}
    with open_sink(path, recorder, patches=[patch], versions={"x": nasty}, **texts) as sink:
        sink.finish({**VERDICT, "scenario": nasty})
    found = 0
    for chunk in RrdReader(path).stream().to_chunks():
        assert chunk.entity_path.isascii() or "ΔZ" in chunk.entity_path
        batch = chunk.to_record_batch()
        for field, column in zip(batch.schema, batch.columns, strict=True):
            if str(field.type) == "list<item: string>":
                for text in (t for row in column.to_pylist() for t in row or []):
                    assert not set("✘机器人🤖\t\u200b") & set(text), text
                    found += "ΔZ" in text
    assert found >= 10  # names, texts, labels, log, states, properties


def test_drawable_keeps_what_the_viewer_has() -> None:
    assert drawable("CoM ≤ 0.3 m/s², Δẑ ✓ ×\n–µ") == "CoM ≤ 0.3 m/s², Δ? ✓ ×\n–µ"
    assert drawable("e\u0301") == "é"  # composed: the mark alone has no glyph


def test_documents() -> None:
    plan = small_run.made_up_plan(50, np.random.default_rng(0))
    text = firing_document(plan)
    assert text.startswith("### Stage 3 fired at 0.05 s: **table_1** for the left hand\n")
    assert "| at 0.45 s | -4.0 | +1.0 | +60.0 | +0.0 |\n| at task's end | -50.0 | +0.0 |" in text
    assert "| **table_1** | left | 1.5000 | 0.2000 | 1.0000 | 0.3000 | chosen |" in text
    assert "| **table_1** | left | 0.0, 0.0, 6.0 | 0.0, 1.0, 9.0 | 0.80 | +20 (palm) |" in text
    assert "| wall | right | -200 (palm) | unreachable by 20.0 cm |" in text
    assert firing_document(replace(plan, firing=None)) == "Stage 3 did not fire."
    text = verdict_document(VERDICT)
    assert text.startswith("## small: FAIL")
    assert r"| × | no_fall | 0.1 | 0.3 | m | a\|b |" in text
    assert verdict_document({}).endswith("no verdict")


def test_a_documents_parts_are_what_it_was_made_of() -> None:
    text = verdict_document(VERDICT)
    title, (checks, metrics) = parts_of(text)
    assert title == "small: FAIL"
    assert isinstance(checks, Table)
    assert list(checks.head) == ["", "check", "value", "threshold", "unit", "message"]
    assert checks.rows == [["×", "no_fall", "0.1", "0.3", "m", "a|b"]]
    assert metrics == Table(["metric", "value"], [["com_height_min", "0.25"]])
    assert parts_of("one\n\ntwo") == ("", ["one", "two"])
    assert parts_of("") == ("", [])
