"""Settings of the planner: the three stages and the contact's life around them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.strict import Count, Positive, StrictModel


class PlannerSettings(StrictModel):
    """The scenario's `planner:` block."""

    formulation: Literal["paper", "exact"] = Field(
        default="exact", description="Whether ΔZ follows the paper's formula or the exact one, free of its phantom ΔZ."
    )
    horizon_steps: Count = Field(default=16, le=200, description="Number of knots N of the horizon [-].")
    horizon_step: Positive = Field(default=0.1, le=1.0, description="Time between two knots T [s].")
    contact_stage: bool = Field(default=True, description="Whether stage 3 may choose a contact at all.")
