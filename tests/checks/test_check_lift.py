"""lifted, com_drop, com_in_band."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import FLOOR, LEFT_PALM, RIGHT_PALM, STEP, TABLE, TORSO, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.contacts import DeclaredContactsCheck
from wbmpc.checks.context import LiftedObject
from wbmpc.checks.lift import ComDropCheck, ComInBandCheck, LiftedCheck
from wbmpc.checks.result import CheckResult
from wbmpc.signals import Vector

HALF = np.array([0.04, 0.08, 0.06])
POSE = 2  # where the box's pose begins in the synthetic qpos
TICKS = 300
UP_FROM = 80  # tick from which the box is up


def lifting_run(rise: float = 0.12, *, turn: Vector | None = None) -> SyntheticRun:
    """The table stands for a box that both palms hold and raise; `turn` (4,) is its attitude when up, wxyz."""
    run = SyntheticRun(TICKS)
    run.facts["lifted_objects"] = (LiftedObject("box", frozenset({TABLE}), POSE, HALF),)
    run.qpos[:, POSE : POSE + 7] = [0.16, 0.0, HALF[2], 1.0, 0.0, 0.0, 0.0]
    run.qpos[UP_FROM:, POSE + 2] += rise
    if turn is not None:
        run.qpos[UP_FROM:, POSE + 3 : POSE + 7] = turn
    run.touch(range(50), FLOOR, TABLE, [0.0, 0.0, 2.0])
    for palm, sign in ((LEFT_PALM, 1.0), (RIGHT_PALM, -1.0)):
        run.touch(range(40, TICKS), TABLE, palm, [0.0, 5.0 * sign, -1.0])
    return run


def lifted(run: SyntheticRun, **values: float) -> CheckResult:
    config = settings.Lifted(kind="lifted", **values)  # type: ignore[arg-type]
    return LiftedCheck(config).evaluate(run.context(), "lifted")


def about(axis: int, angle: float) -> Vector:
    """Quaternion (4,) wxyz."""
    quaternion = np.zeros(4)
    quaternion[0], quaternion[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return quaternion


def test_a_box_that_is_up_and_held() -> None:
    result = lifted(lifting_run())
    assert result.passed
    assert result.value == pytest.approx(0.12)
    assert not lifted(lifting_run(0.099)).passed
    assert lifted(lifting_run(0.05), min=0.05).passed


@pytest.mark.parametrize(("axis", "extent"), [(0, HALF[1]), (1, HALF[0])])
def test_a_tilted_box_counts_by_its_lowest_corner(axis: int, extent: float) -> None:
    angle = 0.2
    lost = extent * np.sin(angle) + HALF[2] * np.cos(angle) - HALF[2]
    assert lifted(lifting_run(turn=about(axis, angle)), min=0.01).value == pytest.approx(0.12 - lost)
    assert lifted(lifting_run(turn=about(2, 1.0))).value == pytest.approx(0.12)  # turned about the vertical it is level
    tipped = lifted(lifting_run(0.3, turn=about(axis, 0.4)))
    assert not tipped.passed
    assert "tilted" in tipped.message
    assert tipped.first_violation == pytest.approx((TICKS - 201) * STEP)


def test_a_box_that_comes_down_again_or_late_is_not_lifted() -> None:
    down = lifting_run()
    down.qpos[-3:, POSE + 2] = HALF[2]
    assert lifted(down).value == pytest.approx(0.0)
    assert lifted(lifting_run(), duration=2.19).passed
    assert not lifted(lifting_run(), duration=2.25).passed


@pytest.mark.parametrize("other", [TORSO, FLOOR])
def test_a_box_that_rests_on_something_is_not_held(other: int) -> None:
    run = lifting_run()
    run.touch([250], *((TABLE, other) if other == TORSO else (other, TABLE)), [0.0, 0.0, -1.0])
    result = lifted(run)
    assert not result.passed
    assert result.first_violation == pytest.approx(2.5)


def test_one_palm_does_not_hold_a_box() -> None:
    run = lifting_run()
    run.lift(range(200, 210), LEFT_PALM)
    assert lifted(run).first_violation == pytest.approx(2.0)


def test_without_a_box_nothing_is_lifted() -> None:
    run = lifting_run()
    run.facts["lifted_objects"] = ()
    assert not lifted(run).passed


def test_palms_may_touch_what_they_lift_and_nothing_else_may() -> None:
    def undeclared(run: SyntheticRun) -> CheckResult:
        config = settings.DeclaredContacts(kind="declared_contacts")
        return DeclaredContactsCheck(config).evaluate(run.context(), "declared_contacts")

    assert undeclared(lifting_run()).passed
    touched = lifting_run()
    touched.touch([100], TABLE, TORSO, [1.0, 0.0, 0.0])
    assert not undeclared(touched).passed
    another = lifting_run()
    another.facts["lifted_objects"] = ()
    assert not undeclared(another).passed


def test_com_drop() -> None:
    run = SyntheticRun(100)
    run.com[30:60, 2] = 0.17
    config = settings.ComDrop(kind="com_drop", min=0.08)
    result = ComDropCheck(config).evaluate(run.context(), "com_drop")
    assert result.passed
    assert result.value == pytest.approx(0.09)
    run.com[30:60, 2] = 0.181
    assert not ComDropCheck(config).evaluate(run.context(), "com_drop").passed


def in_band(run: SyntheticRun, bands: dict[float, tuple[float, float]]) -> CheckResult:
    for time, band in bands.items():
        run.plan(time)
        plan: Any = run.plans[-1]
        run.plans[-1] = SimpleNamespace(**{**vars(plan), "com_height_band": np.array([band])})
    config = settings.ComInBand(kind="com_in_band", tolerance=0.005)
    return ComInBandCheck(config).evaluate(run.context(), "com_in_band")


def test_com_in_band_goes_by_the_newest_plan() -> None:
    run = SyntheticRun(100)
    run.com[50:, 2] = 0.20
    assert in_band(run, {0.0: (0.16, 0.27), 0.5: (0.16, 0.21)}).passed
    result = in_band(SyntheticRun(100), {0.0: (0.16, 0.27), 0.5: (0.16, 0.21)})
    assert result.value == pytest.approx(0.05)
    assert result.first_violation == pytest.approx(0.5)
    assert in_band(SyntheticRun(100), {0.0: (0.263, 0.27)}).value == pytest.approx(0.003)
    assert not in_band(SyntheticRun(100), {}).passed
