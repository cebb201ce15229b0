"""Completed, no_fall, upright_at_end, withdrawn, com_height: one run that passes, and one for every way to fail."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import FLOOR, RIGHT_PALM, TABLE, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.posture import (
    ComHeightCheck,
    CompletedCheck,
    NoFallCheck,
    UprightAtEndCheck,
    WithdrawnCheck,
)


def test_completed_run_passes_and_tells_how_long_it_ran() -> None:
    result = CompletedCheck(settings.Completed()).evaluate(SyntheticRun(100).context(), "completed")
    assert result.passed
    assert result.value == pytest.approx(1.0)
    assert result.first_violation is None


def test_a_run_that_stops_early_is_not_completed() -> None:
    result = CompletedCheck(settings.Completed()).evaluate(SyntheticRun(80, duration=1.0).context(), "completed")
    assert not result.passed
    assert result.first_violation == pytest.approx(0.8)


@pytest.mark.parametrize("column", ["qpos", "qvel", "torque", "com", "com_velocity"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_non_finite_state_is_named_with_its_time(column: str, value: float) -> None:
    run = SyntheticRun(100)
    getattr(run, column)[37, 1] = value
    result = CompletedCheck(settings.Completed()).evaluate(run.context(), "completed")
    assert not result.passed
    assert result.first_violation == pytest.approx(0.37)
    assert "non-finite" in result.message


def test_standing_is_no_fall() -> None:
    result = NoFallCheck(settings.NoFall()).evaluate(SyntheticRun().context(), "no_fall")
    assert result.passed
    assert (result.value, result.unit) == (1.0, "1")


def test_a_tilted_torso_is_a_fall() -> None:
    run = SyntheticRun()
    run.torso_up[40:] = np.linspace(1.0, -0.2, 60)
    result = NoFallCheck(settings.NoFall(min_torso_up=0.5)).evaluate(run.context(), "no_fall")
    assert not result.passed
    assert result.value == pytest.approx(-0.2)
    # 1 - 1.2 k / 59 < 0.5 first at k = 25
    assert result.first_violation == pytest.approx(0.65)


def test_a_sunken_com_is_a_fall_even_with_the_torso_up_and_on_a_step() -> None:
    run = SyntheticRun()
    run.sole_position[:, 0, 2] = 0.2  # one foot on a step: the height counts from the lower sole
    run.com[50:, 2] = 0.1
    result = NoFallCheck(settings.NoFall()).evaluate(run.context(), "no_fall")
    assert not result.passed
    assert (result.value, result.threshold, result.unit) == (pytest.approx(0.1), 0.12, "m")
    assert result.first_violation == pytest.approx(0.5)


def test_a_nan_is_a_fall() -> None:
    run = SyntheticRun()
    run.torso_up[10] = np.nan
    assert not NoFallCheck(settings.NoFall()).evaluate(run.context(), "no_fall").passed


def test_upright_at_end_looks_at_the_end_only() -> None:
    run = SyntheticRun()
    run.torso_up[:40], run.com_velocity[:40, 0] = 0.5, 1.0
    check = UprightAtEndCheck(settings.UprightAtEnd(kind="upright_at_end", duration=0.5))
    assert check.evaluate(run.context(), "upright").passed


@pytest.mark.parametrize(("column", "value", "unit"), [("torso_up", 0.9, "1"), ("com_velocity", 0.06, "m/s")])
def test_leaning_or_moving_at_the_end_is_not_upright(column: str, value: float, unit: str) -> None:
    run = SyntheticRun()
    getattr(run, column)[90:] = value
    result = UprightAtEndCheck(settings.UprightAtEnd(kind="upright_at_end")).evaluate(run.context(), "upright")
    assert not result.passed
    assert result.unit == unit
    assert result.first_violation == pytest.approx(0.9)


def withdrawn(run: SyntheticRun) -> settings.Withdrawn:
    return WithdrawnCheck(settings.Withdrawn(kind="withdrawn", com_tolerance=0.02)).evaluate(run.context(), "withdrawn")


def test_back_at_the_start_with_free_hands_is_withdrawn() -> None:
    run = SyntheticRun()
    run.com[20:45, 0] = 0.2
    run.com[50:] += [0.009, 0.012, 0.0]  # 15 mm
    run.touch(range(20, 45), TABLE, RIGHT_PALM, [0.0, 0.0, 5.0])
    result = withdrawn(run)
    assert result.passed
    assert result.value == pytest.approx(0.015)


def test_a_com_that_stays_away_is_not_withdrawn() -> None:
    run = SyntheticRun()
    run.com[60:, 1] = 0.021
    assert withdrawn(run).first_violation == pytest.approx(0.6)


def test_a_hand_that_stays_on_the_table_is_not_withdrawn() -> None:
    run = SyntheticRun()
    run.touch(range(90, 100), TABLE, RIGHT_PALM, [0.0, 0.0, 1.0])
    result = withdrawn(run)
    assert not result.passed
    assert "hand" in result.message
    assert result.first_violation == pytest.approx(0.9)


def test_a_bent_torso_is_not_withdrawn() -> None:
    run = SyntheticRun()
    run.torso_up[80:] = 0.7
    assert "torso" in withdrawn(run).message


def height_run(heights: tuple[tuple[float, float], ...]) -> SyntheticRun:
    run = SyntheticRun(201)
    run.com[:, 2] = 0.26 - 0.06 * np.sin(np.pi * run.time / 2.0)  # lowest, 0.20, at 1 s; back at 2 s
    run.facts["com_heights"] = heights
    return run


def test_com_height_passes_through_its_waypoints() -> None:
    run = height_run(((1.0, 0.195), (2.0, 0.26)))
    result = ComHeightCheck(settings.ComHeight(kind="com_height", max=0.006)).evaluate(run.context(), "height")
    assert result.passed
    assert result.value == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("heights", "words"),
    [(((1.0, 0.18),), "t = 1 s"), (((0.0, 0.26), (5.0, 0.26)), "ended before t = 5 s"), ((), "no com_height task")],
)
def test_com_height_fails_when_it_misses_a_waypoint_or_has_none(
    heights: tuple[tuple[float, float], ...], words: str
) -> None:
    check = ComHeightCheck(settings.ComHeight(kind="com_height", max=0.006))
    result = check.evaluate(height_run(heights).context(), "height")
    assert not result.passed
    assert words in result.message


def test_the_synthetic_floor_is_not_a_hand() -> None:
    run = SyntheticRun()
    assert not run.context().palm_force.any()
    assert run.context().sole_force[:, :, 2] == pytest.approx(9.81)
    assert {contact[0] for contact in run.contacts[0]} == {FLOOR}
