"""Checks of a lift: what a box must do, and how the CoM height goes with it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.checks.settings.common import CheckSettings
from wbmpc.strict import NonNegative, Positive


class Lifted(CheckSettings):
    """In the last stretch of the run the box of the lift task is up, level enough, and held by the palms alone."""

    kind: Literal["lifted"]
    min: Positive = Field(default=0.10, description="Least rise of the box's lowest point since the start [m].")
    max_tilt: Positive = Field(default=0.35, description="Largest tilt of the box [rad].")
    duration: Positive = Field(default=2.0, description="Length of the stretch at the end of the run [s].")


class ComDrop(CheckSettings):
    """The CoM goes down by so much, at its lowest."""

    kind: Literal["com_drop"]
    min: Positive = Field(default=0.08, description="Least drop of the CoM below its height at the start [m].")


class ComInBand(CheckSettings):
    """The CoM height stays in the admissible band that stage 1 was given."""

    kind: Literal["com_in_band"]
    tolerance: NonNegative = Field(default=0.005, description="Largest distance outside the band [m].")
