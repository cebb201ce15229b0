"""The `tasks:` block: what the robot is asked to do. Nothing here says which contact to use, or when."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from wbmpc.strict import NonNegative, Positive, StrictModel, Vector3


class StandTask(StrictModel):
    """Stand where the robot stands."""

    kind: Literal["stand"] = Field(description="Stand still.")


class HeightWaypoint(StrictModel):
    """One point of a CoM height profile."""

    time: NonNegative = Field(description="When the CoM has this height [s].")
    height: Annotated[float, Field(gt=0, le=2)] = Field(description="Height of the CoM above the floor [m].")


class ComHeightTask(StrictModel):
    """Move the CoM up and down through waypoints; the height is held after the last one."""

    kind: Literal["com_height"] = Field(description="Follow a CoM height profile.")
    waypoints: tuple[HeightWaypoint, ...] = Field(min_length=1, description="Waypoints in the order of time.")

    @property
    def end(self) -> float:
        """Time of the last waypoint [s]."""
        return self.waypoints[-1].time


class ReachTask(StrictModel):
    """Bring a palm to a target, hold it there, and come back to standing."""

    kind: Literal["reach"] = Field(description="Bring a palm to a target, hold it, come back.")
    hand: Literal["auto", "left", "right"] = Field(
        default="auto", description="Which hand; auto: the planner takes the one that is nearer to the target."
    )
    target: Vector3 = Field(description="Where the palm's centre shall be, in world [m].")
    start: NonNegative = Field(default=0.5, description="When the hand starts to move [s].")
    arrive_by: Positive = Field(description="When the palm shall be at the target [s].")
    hold: NonNegative = Field(default=2.0, description="How long the palm stays at the target [s].")
    tolerance: Positive = Field(default=0.01, description="Palm error below which the hold counts [m].")
    patience: NonNegative = Field(default=4.0, description="Extra time at the target before the hold is given up [s].")
    withdraw: Positive = Field(default=2.5, description="How long the way back to standing takes [s].")

    @property
    def end(self) -> float:
        """When the robot stands again [s], if nothing delays the reach."""
        return self.arrive_by + self.hold + self.withdraw


Task = Annotated[StandTask | ComHeightTask | ReachTask, Field(discriminator="kind")]
