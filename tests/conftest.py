"""Before any test: MuJoCo's off-screen OpenGL, which it chooses once at its import, and Hypothesis' profile."""

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

import wbmpc.render  # noqa: F401

# The same examples at every run of CI: a red build then means that the change broke something.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)  # how long an example takes says nothing about it
settings.load_profile("ci" if os.environ.get("CI") else "local")


@pytest.fixture(autouse=True, scope="session")
def nobody_comes_first() -> Iterator[None]:
    """No real-time priority: tests run side by side, and one that spins at it would starve the planner of another."""

    def refused(*_: object) -> None:
        raise PermissionError

    with pytest.MonkeyPatch.context() as patch:
        if hasattr(os, "sched_setscheduler"):
            patch.setattr(os, "sched_setscheduler", refused)
        yield
