"""Firings of stage 3 in the file: what is drawn, when it goes, and the numbers behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
import small_run
from numpy.testing import assert_allclose

from wbmpc.rerun_sink.firings import FiringLog
from wbmpc.rerun_sink.palette import METRES_PER_NEWTON
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.scene import Patch
from wbmpc.rerun_sink.stream import Stream
from wbmpc.signals import ContactPhase, PlanReport

TABLE = Patch("table_1", small_run.PATCHES["table_1"], np.array([0.0, 0.0, 1.0]), friction=0.4)
WALL = Patch(
    "wall", np.array([[0.1, 0.3, 0.2], [0.1, 0.3, 0.3], [0.3, 0.3, 0.3], [0.3, 0.3, 0.2]]), np.array([0.0, -1, 0])
)
PLAN = small_run.made_up_plan(50, np.random.default_rng(0))
NONE, APPROACHING, LOADED = ContactPhase.NONE, ContactPhase.APPROACHING, ContactPhase.LOADED


def plan(time: float, phase: ContactPhase, *, fired: bool = False) -> PlanReport:
    firing = PLAN.firing if fired else None
    return replace(PLAN, time=time, firing=firing, contact_phase=np.array([phase, NONE]))


def written(tmp_path: Path, *blocks: Sequence[PlanReport]) -> Recording:
    path = tmp_path / "a.rrd"
    recording = rr.RecordingStream("test")
    recording.save(path)
    recording.log("/model", rr.AnyValues(mjb=b"a model"), static=True)  # of ours
    log = FiringLog(Stream(recording), {patch.name: patch for patch in (TABLE, WALL)})
    log.describe()
    for block in blocks:
        log.write(block)
    recording.disconnect()
    return Recording(path)


@pytest.fixture
def recorded(tmp_path: Path) -> Recording:
    plans = [plan(0.0, NONE), plan(0.5, NONE, fired=True), plan(0.6, APPROACHING)]
    return written(tmp_path, plans, [plan(1.9, APPROACHING), plan(2.0, LOADED), plan(2.1, LOADED)])


def test_it_is_drawn_until_the_palm_is_there(recorded: Recording) -> None:
    for fate in ("chosen", "rejected"):
        for name, component in (("patch", "centers"), ("palm", "centers"), ("force", "vectors"), ("cone", "strips")):
            time, rows = recorded.column(f"/world/stage_3/{fate}/{name}", component)
            assert_allclose(time, [0.0, 0.5, 2.0])
            drawn = [len(row) for row in rows]
            assert drawn[0] == drawn[2] == 0
            assert (drawn[1] > 0) == (fate == "chosen" or name in ("patch", "palm"))  # the wall cannot give a force


def test_a_firing_without_a_winner_is_drawn_for_a_second(tmp_path: Path) -> None:
    recording = written(tmp_path, [plan(0.0, NONE, fired=True), plan(0.9, NONE), plan(1.0, NONE), plan(1.5, NONE)])
    time, _ = recording.column("/world/stage_3/chosen/patch", "centers")
    assert_allclose(time, [0.0, 1.0])


def test_the_lane_says_what_is_drawn_across_blocks(recorded: Recording) -> None:
    time, states = recorded.column("/contact_phase/stage_3", "state")
    assert_allclose(time, [0.0, 0.5, 2.0])
    assert [str(state[0]) for state in states] == ["waits", "fired: table_1, |ΔZ| 4 / 50 mm", "waits"]


def at_firing(recording: Recording, entity: str, component: str) -> np.ndarray:
    _, rows = recording.column(f"/world/stage_3/{entity}", component)
    return np.array(rows[1], dtype=float)


def test_shapes_are_where_the_contacts_would_be(recorded: Recording) -> None:
    assert_allclose(at_firing(recorded, "chosen/patch", "centers"), [[0.3, 0.0, 0.2]], atol=1e-6)
    half, quaternion = (at_firing(recorded, "rejected/patch", name)[0] for name in ("half_sizes", "quaternions"))
    x, y, z, w = quaternion
    normal = 2 * np.array([x * z + w * y, y * z - w * x, 0.5 - x * x - y * y])  # third axis of the plate
    assert_allclose(normal, WALL.normal, atol=1e-6)
    first = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    assert_allclose(half[0] * first, 0.5 * (WALL.corners[1] - WALL.corners[0]), atol=1e-6)
    assert_allclose(half[1:], [0.1, 0.0005], atol=1e-6)
    assert_allclose(at_firing(recorded, "chosen/palm", "half_sizes"), [[0.02] * 3], atol=1e-6)  # 2 cm over the patch
    forces = at_firing(recorded, "chosen/force", "vectors") / METRES_PER_NEWTON
    assert_allclose(forces, [[0, 0, 6], [0, 1, 9]], atol=1e-5)
    assert_allclose(at_firing(recorded, "chosen/force", "origins"), [[0.3, 0.0, 0.22]] * 2, atol=1e-6)


def test_the_cone_has_the_patchs_friction(recorded: Recording) -> None:
    _, rows = recorded.column("/world/stage_3/chosen/cone", "strips")
    strips = np.array(rows[1])  # spokes with their part of the rim
    assert_allclose(strips[:, 0], np.tile(TABLE.centre, (len(strips), 1)), atol=1e-6)
    rim = strips[:, 1:].reshape(-1, 3) - TABLE.centre
    height = rim @ TABLE.normal
    assert_allclose(height, METRES_PER_NEWTON * 9.0, rtol=1e-5)  # as high as the larger force
    assert_allclose(np.linalg.norm(rim[:, :2], axis=1), 0.4 * height, rtol=1e-4)
    around = np.unwrap(np.arctan2(rim[:, 1], rim[:, 0]))
    assert around[-1] - around[0] == pytest.approx(np.sign(around[-1] - around[0]) * 2 * np.pi, rel=1e-4)  # closed


def test_the_numbers_are_in_the_file(recorded: Recording) -> None:
    def values(name: str) -> list[Any]:
        time, rows = recorded.column("/planner/stage_3", name)
        assert_allclose(time, [0.5])
        return list(rows[0])

    assert values("patch") == ["table_1", "wall"]
    assert values("hand") == ["left", "right"]
    assert values("chosen") == [True, False]
    assert_allclose(values("cost"), [1.5, np.inf])
    parts = [values(f"{name}_cost")[0] for name in ("way", "force", "shift")]
    assert sum(parts) == pytest.approx(1.5)
    assert_allclose(values("delta_z"), [-0.004, 0.001, -0.05, 0.0])
    assert_allclose(values("knot_time"), [0.45, np.inf])
    assert_allclose(np.reshape(values("forces"), (2, 2, 3))[0], [[0, 0, 6], [0, 1, 9]])
    assert values("reason")[1] == "unreachable by 20.0 cm"
