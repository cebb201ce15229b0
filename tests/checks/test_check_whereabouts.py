"""travelled, arrived, foot_moved."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pydantic import ValidationError
from synthetic import LEFT_FOOT, RIGHT_FOOT, SOLES, SyntheticRun

from wbmpc.checks import settings
from wbmpc.checks.result import CheckResult
from wbmpc.checks.whereabouts import ArrivedCheck, ClimbedCheck, FootMovedCheck, TravelledCheck


def moved_run(displacement: tuple[float, float], turn: float = 0.0, heading: float = 0.0) -> SyntheticRun:
    """Both soles move by `displacement` [m] in world and turn by `turn` [rad] between 0.2 and 0.7 s."""
    run = SyntheticRun()
    run.sole_yaw[:] = heading
    for foot in (LEFT_FOOT, RIGHT_FOOT):
        run.step(foot, 20, 70, displacement, turn)
    run.contacts = SyntheticRun().contacts  # where the feet are matters here, not how they got there
    return run


def travelled(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.Travelled(kind="travelled", **values)  # type: ignore[arg-type]
    return TravelledCheck(config).evaluate(run.context(), "travelled")


@hypothesis_settings(max_examples=50, deadline=None)
@given(st.floats(-np.pi, np.pi), st.floats(-1, 1), st.floats(-1, 1), st.floats(-3 * np.pi, 3 * np.pi), st.floats(-9, 9))
def test_displacement_is_that_of_the_first_heading_and_turns_add_up(
    heading: float, forward: float, left: float, turn: float, where: float
) -> None:
    world = np.exp(1j * heading) * (forward + 1j * left)  # a rotation of the plane, in other words
    run = moved_run((world.real, world.imag), turn, heading)
    run.sole_position[..., :2] += where
    for key, value in (("forward", forward), ("left", left), ("turned", turn)):
        assert travelled(run, **{key: (-99.0, 99.0)}).value == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(
    ("wanted", "passed", "value", "threshold"),
    [
        ({"forward": (0.5, 0.7)}, True, 0.6, 0.5),
        ({"forward": (0.61, 0.7)}, False, 0.6, 0.61),
        ({"forward": (0.5, 0.59)}, False, 0.6, 0.59),
        ({"forward": (0.5, 0.7), "left": (-0.05, 0.05)}, False, 0.1, 0.05),
        ({"left": (-0.2, 0.2), "turned": (0.4, 0.6)}, False, 0.3, 0.4),
    ],
)
def test_ranges(wanted: dict[str, tuple[float, float]], passed: bool, value: float, threshold: float) -> None:
    result = travelled(moved_run((0.6, 0.1), 0.3), **wanted)
    assert result.passed == passed
    assert (result.value, result.threshold) == (pytest.approx(value), threshold)


def test_the_window_bounds_what_is_counted() -> None:
    run = moved_run((0.5, 0.0))  # 1 cm each tick from tick 20 to 70
    assert travelled(run, forward=(-1.0, 1.0), window=(0.3, 0.51)).value == pytest.approx(0.2)
    assert travelled(run, forward=(-1.0, 1.0), window=(0.0, 1.0)).value == pytest.approx(0.5)
    late = travelled(run, forward=(-1.0, 1.0), window=(0.0, 1.01))
    assert not late.passed
    assert "ended before" in late.message


def test_a_robot_that_is_nowhere_has_not_travelled() -> None:
    run = moved_run((0.5, 0.0))
    run.sole_position[-1] = np.nan
    assert not travelled(run, forward=(-99.0, 99.0)).passed


@pytest.mark.parametrize("values", [{}, {"left": (0.2, 0.1)}, {"left": (0.1, 0.2), "window": (1.0, 1.0)}])
def test_senseless_ranges_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        settings.Travelled(kind="travelled", **values)  # type: ignore[arg-type]


def arrived(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.Arrived(kind="arrived", **{"tolerance": 0.03, **values})  # type: ignore[arg-type]
    return ArrivedCheck(config).evaluate(run.context(), "arrived")


def arriving_run() -> SyntheticRun:
    run = SyntheticRun(150)
    for foot in (LEFT_FOOT, RIGHT_FOOT):
        run.step(foot, 20 + 40 * (foot == RIGHT_FOOT), 50 + 40 * (foot == RIGHT_FOOT), (0.5, 0.2))
    run.facts["go_targets"] = (np.array([0.48, 0.2]),)
    return run


def test_at_the_target_on_both_feet_is_arrived() -> None:
    result = arrived(arriving_run())
    assert result.passed
    assert result.value == pytest.approx(0.02)


def test_arrival_counts_from_the_midpoint_of_the_soles_over_the_whole_end() -> None:
    assert not arrived(arriving_run(), tolerance=0.019).passed
    assert arrived(arriving_run(), target=(0.5, 0.2)).value == pytest.approx(0.0, abs=1e-12)
    late = arrived(arriving_run(), duration=0.7)  # the right foot lands at 0.9 s, the run ends at 1.5 s
    assert not late.passed
    assert late.first_violation == pytest.approx(0.8)


def test_on_one_leg_or_leaning_is_not_arrived() -> None:
    run = arriving_run()
    run.lift(range(140, 150), LEFT_FOOT)
    result = arrived(run)
    assert not result.passed
    assert "no load" in result.message
    assert result.first_violation == pytest.approx(1.4)
    run = arriving_run()
    run.torso_up[120:] = 0.8
    assert "torso" in arrived(run).message


def test_nowhere_to_go_is_a_failure() -> None:
    run = arriving_run()
    run.facts["go_targets"] = ()
    assert "no go task" in arrived(run).message


def foot_moved(run: SyntheticRun, **values: object) -> CheckResult:
    config = settings.FootMoved(kind="foot_moved", **{"foot": "left", "tolerance": 0.02, **values})  # type: ignore[arg-type]
    return FootMovedCheck(config).evaluate(run.context(), "foot_moved")


def stepping_run() -> SyntheticRun:
    run = SyntheticRun()
    run.step(LEFT_FOOT, 20, 60, (0.0, 0.15))
    other = SOLES[1, :2]
    run.facts["step_targets"] = ((0, other), (1, other), (0, SOLES[0, :2] + [0.01, 0.15]))
    return run


def test_the_foot_stands_at_the_target_of_its_last_task() -> None:
    result = foot_moved(stepping_run(), min_distance=0.15)
    assert result.passed
    assert result.value == pytest.approx(0.01)
    assert not foot_moved(stepping_run(), tolerance=0.009).passed
    assert foot_moved(stepping_run(), foot="right").value == pytest.approx(0.0)  # it stayed where it was asked to be


def test_a_foot_that_has_not_moved_enough_fails_even_at_its_target() -> None:
    result = foot_moved(stepping_run(), min_distance=0.16)
    assert not result.passed
    assert (result.value, result.threshold) == (pytest.approx(0.15), 0.16)
    assert not foot_moved(stepping_run(), foot="right", min_distance=0.01).passed


def test_a_foot_in_the_air_over_its_target_or_without_one_fails() -> None:
    run = stepping_run()
    run.lift(range(99, 100), LEFT_FOOT)
    assert "no load" in foot_moved(run).message
    run = SyntheticRun()
    assert "no step task" in foot_moved(run).message
    assert foot_moved(run, target=(0.0, 0.05)).passed


def climbed(run: SyntheticRun, wanted: float | None = 0.1) -> CheckResult:
    return ClimbedCheck(settings.Climbed(kind="climbed", min=wanted)).evaluate(run.context(), "climbed")


def test_climbed_is_the_lower_sole_while_both_carry() -> None:
    run = SyntheticRun()
    assert not climbed(run).passed
    run.sole_position[30:60, 0, 2] += 0.25  # one foot up, the other one follows less high, then down again
    run.sole_position[40:50, 1, 2] += 0.12
    result = climbed(run)
    assert result.passed
    assert result.value == pytest.approx(0.12 + SOLES[1, 2])
    assert "t = 0.4" in result.message


def test_a_foot_in_the_air_has_not_climbed() -> None:
    run = SyntheticRun()
    run.sole_position[30:60, :, 2] += 0.12
    run.lift(range(30, 60), LEFT_FOOT)
    assert not climbed(run).passed
    run.lift(range(len(run.sole_position)), LEFT_FOOT)
    assert "never loaded" in climbed(run).message


def test_without_a_height_the_highest_ground_is_meant() -> None:
    run = SyntheticRun()
    assert "no higher ground" in climbed(run, None).message
    run.facts["highest_ground"] = 0.08
    assert not climbed(run, None).passed
    run.sole_position[30:60, :, 2] += 0.08 - SOLES[:, 2].min()
    assert climbed(run, None).passed
    assert climbed(run, None).threshold == pytest.approx(0.075)
