"""When a run may end early: only after a fall that lasted, so that no verdict turns from fail to pass."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import STEP, SyntheticRun

from wbmpc.checks.fall import FallWatch
from wbmpc.checks.posture import NoFallCheck
from wbmpc.checks.settings import NoFall


def reason(run: SyntheticRun, **config: float | None) -> str | None:
    return FallWatch(run.context().recorder, NoFall(**config), timestep=STEP)()


@pytest.mark.parametrize("column", ["torso_up", "com"])
def test_a_fall_ends_the_run_after_the_stated_time(column: str) -> None:
    for ticks, ends in ((49, False), (50, True), (80, True)):
        run = SyntheticRun(100)
        getattr(run, column)[100 - ticks :] = 0.05
        assert (reason(run, stop_after=0.5) is not None) == ends, ticks
    assert reason(run, stop_after=0.5) == "the robot has been down for 0.5 s"
    assert reason(run, stop_after=None) is None


def test_a_run_shorter_than_the_time_goes_on() -> None:
    run = SyntheticRun(30)
    run.torso_up[:] = 0.0
    assert reason(run, stop_after=0.5) is None


@settings(max_examples=50, deadline=None)
@given(st.lists(st.booleans(), min_size=20, max_size=40))
def test_the_run_ends_exactly_when_the_last_stretch_has_no_standing_tick(standing: list[bool]) -> None:
    run = SyntheticRun(len(standing))
    run.torso_up[:] = np.where(standing, 1.0, -0.1)
    ended = reason(run, stop_after=0.1) is not None
    assert ended == (True not in standing[-10:])
    if ended:
        assert not NoFallCheck(NoFall()).evaluate(run.context(), "no_fall").passed
