"""Settings of the tracker: gains, weights and limits of its one QP per tick."""

from __future__ import annotations

from pydantic import Field

from wbmpc.strict import Positive, StrictModel


class TrackerSettings(StrictModel):
    """The scenario's `tracker:` block."""

    joint_velocity_limit: Positive = Field(default=5.0, description="Bound on every joint's speed [rad/s].")
