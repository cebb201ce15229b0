"""The `initial:`, `loop:` and `recording:` blocks: where a run starts, its rates, and what is written down."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from wbmpc.strict import NonNegative, StrictModel

Rate = Annotated[int, Field(ge=1, le=100_000)]


class InitialState(StrictModel):
    """The posture at time 0; the robot is at rest and its feet are on the floor."""

    keyframe: str = Field(default="home", min_length=1, description="Keyframe of the robot model.")
    joints: dict[str, float] = Field(
        default={}, description="Joint angles that differ from the keyframe, by joint name [rad]."
    )


class LoopSettings(StrictModel):
    """The rates of the lockstep loop; the tracker runs at every physics step."""

    physics_rate: Rate = Field(default=1000, description="Physics and tracker ticks per second [Hz].")
    planner_rate: Rate = Field(default=100, description="Plans per second; must divide `physics_rate` [Hz].")
    planner_delay: NonNegative = Field(
        default=0.01,
        le=1,
        description="Simulated time from a plan's snapshot until it takes effect; a multiple of the physics step [s].",
    )
    realtime_planner: Literal["process", "thread"] = Field(
        default="process",
        description="Where the planner of a real-time run is: in a process of its own, or a thread beside the ticks.",
    )

    @property
    def timestep(self) -> float:
        """Physics step [s]."""
        return 1 / self.physics_rate

    @property
    def planner_period_ticks(self) -> int:
        """Physics steps between two plans."""
        return self.physics_rate // self.planner_rate

    @property
    def planner_delay_ticks(self) -> int:
        """Physics steps from a snapshot until its plan takes effect."""
        return round(self.planner_delay * self.physics_rate)


class RecordingSettings(StrictModel):
    """What goes to the recording; checks always see every tick."""

    rate: Rate = Field(default=100, description="Rows per second; must divide `loop.physics_rate` [Hz].")
