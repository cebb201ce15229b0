"""The `tasks:` block: what the robot is asked to do. Nothing here says which contact to use, or when."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from wbmpc.strict import Friction, NonNegative, Positive, StrictModel, Vector2, Vector3

MAX_WALKING_SPEED = 0.3  # [m/s]


def _within_walking_speed(velocity: Vector2) -> Vector2:
    speed = math.hypot(*velocity)
    if speed > MAX_WALKING_SPEED * (1 + 1e-9):
        raise ValueError(f"too fast: {speed:g} m/s, at most {MAX_WALKING_SPEED:g} m/s")
    return velocity


WalkingVelocity = Annotated[Vector2, AfterValidator(_within_walking_speed)]


class StandTask(StrictModel):
    """Stand where the robot stands."""

    kind: Literal["stand"] = Field(description="Stand still.")

    @property
    def end(self) -> float:
        """0 [s]: standing is never over, and never keeps a run from ending."""
        return 0.0


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


class ExcursionTask(StrictModel):
    """Common to the tasks that go to a target, stay there, and come back to standing."""

    start: NonNegative = Field(default=0.5, description="When the way to the target begins [s].")
    arrive_by: Positive = Field(description="When the target shall be reached [s].")
    hold: NonNegative = Field(default=2.0, description="How long to stay at the target [s].")
    tolerance: Positive = Field(default=0.01, description="Distance from the target below which the hold counts [m].")
    patience: NonNegative = Field(default=4.0, description="Extra time at the target before the hold is given up [s].")
    withdraw: Positive = Field(default=2.5, description="How long the way back to standing takes [s].")

    @property
    def end(self) -> float:
        """When the robot stands again [s], if nothing delays it."""
        return self.arrive_by + self.hold + self.withdraw


class ReachTask(ExcursionTask):
    """Bring a palm to a target, hold it there, and come back to standing."""

    kind: Literal["reach"] = Field(description="Bring a palm to a target, hold it, come back.")
    hand: Literal["auto", "left", "right"] = Field(
        default="auto", description="Which hand; auto: the planner takes the one that is nearer to the target."
    )
    target: Vector3 = Field(description="Where the palm's centre shall be, in world [m].")


class LeanTask(ExcursionTask):
    """Bring the CoM over a point of the ground, hold it there, and come back to standing; both hands are free."""

    kind: Literal["lean"] = Field(description="Bring the CoM over a point, hold it, come back.")
    target: Vector2 = Field(description="Where the CoM's ground projection shall be: world x, y [m].")


class VelocityCommand(StrictModel):
    """One walking command; it holds until the time of the next one."""

    time: NonNegative = Field(description="From when on the command holds [s].")
    velocity: WalkingVelocity = Field(description="Forward, left, in the robot's heading frame; at most 0.3 [m/s].")
    yaw_rate: float = Field(default=0.0, ge=-1, le=1, description="Turning speed, counter-clockwise positive [rad/s].")

    @property
    def is_halt(self) -> bool:
        """Whether the command is to stand."""
        return self.velocity == (0.0, 0.0) and self.yaw_rate == 0.0


class WalkTask(StrictModel):
    """Walk at commanded velocities; where each foot lands is for the planner to decide."""

    kind: Literal["walk"] = Field(description="Follow walking velocities.")
    commands: tuple[VelocityCommand, ...] = Field(min_length=1, description="Velocity commands in the order of time.")

    @property
    def start(self) -> float:
        """Time of the first command [s]."""
        return self.commands[0].time

    @property
    def end(self) -> float:
        """Time of the last command [s], which itself holds on."""
        return self.commands[-1].time


class StepTask(StrictModel):
    """Put one foot somewhere, with whatever support it needs; the other foot stays where it is."""

    kind: Literal["step"] = Field(description="Put one foot somewhere.")
    foot: Literal["left", "right"] = Field(description="Which foot.")
    target: Vector2 = Field(description="Where the sole's centre shall be: world x, y [m].")
    yaw: float = Field(default=0.0, description="The foot's heading at the target, about the world's z axis [rad].")
    start: NonNegative = Field(default=0.5, description="When the robot begins to shift its weight [s].")
    duration: Positive = Field(default=2.0, description="How long the foot is in the air [s].")

    @property
    def end(self) -> float:
        """When the foot can be down again [s] at the earliest."""
        return self.start + self.duration


class GoTask(StrictModel):
    """Go to a place, over and through what stands in the way; footsteps and hand contacts are the planner's choice."""

    kind: Literal["go"] = Field(description="Go to a place.")
    target: Vector2 = Field(description="Where the midpoint between the soles shall be: world x, y [m].")
    start: NonNegative = Field(default=0.5, description="When the robot begins to shift its weight [s].")
    swing_time: Positive = Field(default=1.5, description="How long a foot is in the air [s], every step.")
    step_length: Positive = Field(default=0.08, description="Length of a step where nothing asks for another one [m].")
    longest_step: Positive = Field(default=0.26, description="Length of a step that clears an obstacle, at most [m].")

    @property
    def end(self) -> float:
        """When a foot can be down again [s] at the earliest; how many steps it takes is not known beforehand."""
        return self.start + self.swing_time


class LiftTask(StrictModel):
    """Take a box between both palms, by friction alone, and lift it straight up; it is carried until the run ends."""

    kind: Literal["lift"] = Field(description="Lift a box with both hands.")
    object: str = Field(min_length=1, description="Name of the object, which must have a mass.")
    height: Annotated[float, Field(gt=0, le=0.5)] = Field(description="How far up [m].")
    start: NonNegative = Field(default=0.5, description="When the hands set out [s].")
    reach_time: Positive = Field(default=2.5, description="How long the hands' way to the box takes [s].")
    raise_time: Positive = Field(default=2.5, description="How long the way up takes [s].")
    friction: Friction = Field(default=0.4, description="Friction coefficient that the grip counts on [-].")

    @property
    def end(self) -> float:
        """When the box can be up [s] at the earliest."""
        return self.start + self.reach_time + self.raise_time


FootworkTask = WalkTask | StepTask | GoTask  # the tasks that move the feet

Task = Annotated[
    StandTask | ComHeightTask | ReachTask | LeanTask | WalkTask | StepTask | GoTask | LiftTask,
    Field(discriminator="kind"),
]
