"""Checks of the whole body and of the feet: posture, pushes, steps, where the robot got to."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from wbmpc.checks.settings.common import CheckSettings, HoldSettings, WindowSettings, check_range
from wbmpc.strict import NonNegative, Positive, Vector2


class ComBeyondToes(HoldSettings):
    """During the hold the CoM's ground projection is at least `min` outside the feet's support polygon."""

    kind: Literal["com_beyond_toes"]
    min: float = Field(description="[m] smallest distance outside the polygon of the soles")


class TorquePeak(CheckSettings):
    """The largest applied torque, as a fraction of the joint's stall torque limit."""

    kind: Literal["torque_peak"]
    max: Positive = Field(le=1, description="largest |torque| / stall torque")


class ComHeight(CheckSettings):
    """The CoM comes within `max` of the height of every waypoint of the scenario's com_height task, about its time."""

    kind: Literal["com_height"]
    max: Positive = Field(description="[m] largest distance from a waypoint's height")
    window: NonNegative = Field(default=0.1, description="[s] half-width around the waypoint's time")


class UprightAtEnd(CheckSettings):
    """During the last `duration` the robot stands upright and still."""

    kind: Literal["upright_at_end"]
    min_torso_up: float = Field(default=0.95, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    max_com_speed: Positive = Field(default=0.05, description="[m/s] largest speed of the CoM")
    duration: Positive = Field(default=0.5, description="[s] how long at the end")


class PushRecovery(CheckSettings):
    """A push of at least `min_impulse` per kg really acted, and the CoM was captured.

    The value is the time from the push's end until the CoM speed stays below `max_com_speed` for good.
    """

    kind: Literal["push_recovery"]
    min_impulse: Positive = Field(description="[N·s/kg] per kg of robot, sum over the declared pushes' directions")
    max_time: Positive = Field(default=3.0, description="[s] longest recovery")
    max_com_speed: Positive = Field(default=0.05, description="[m/s] CoM speed below which the push is recovered from")


class Footsteps(WindowSettings):
    """Enough footsteps were made.

    A footstep is a sole that lost all contact for at least 0.1 s and then took load again.
    """

    kind: Literal["footsteps"]
    foot: Literal["any", "left", "right"] = Field(default="any", description="whose landings count")
    min_count: int = Field(ge=1, description="fewest footsteps that landed in the window")
    min_length: NonNegative = Field(
        default=0.0, description="[m] shorter displacements of the foot, from one stance to the next, do not count"
    )


class Travelled(WindowSettings):
    """The midpoint between the soles, and the feet's heading, moved as far as wanted over the window.

    Forward and left are those of the heading at the beginning of the window.
    """

    kind: Literal["travelled"]
    forward: tuple[float, float] | None = Field(default=None, description="[m] least, most; default: any")
    left: tuple[float, float] | None = Field(default=None, description="[m] least, most; default: any")
    turned: tuple[float, float] | None = Field(
        default=None, description="[rad] least, most, counter-clockwise, whole turns counted; default: any"
    )

    @model_validator(mode="after")
    def _something_in_order(self) -> Travelled:
        ranges = {"forward": self.forward, "left": self.left, "turned": self.turned}
        for name, bounds in ranges.items():
            check_range(name, bounds)
        if not any(ranges.values()):
            raise ValueError("needs at least one of 'forward', 'left' and 'turned'")
        return self


class Arrived(CheckSettings):
    """During the last `duration` the robot stands upright on both feet, their midpoint at the target."""

    kind: Literal["arrived"]
    tolerance: Positive = Field(description="[m] largest distance of the midpoint between the soles from the target")
    target: Vector2 | None = Field(default=None, description="[m] world x, y; default: that of the scenario's go task")
    min_torso_up: float = Field(default=0.9, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    duration: Positive = Field(default=0.5, description="[s] how long at the end")


class Climbed(CheckSettings):
    """Both feet stand that high above the floor, at the same time and loaded."""

    kind: Literal["climbed"]
    min: Positive | None = Field(
        default=None,
        description="height of the lower sole at its highest [m]; null: that of the highest ground, less 5 mm",
    )


class FootMoved(CheckSettings):
    """At the end the foot stands, loaded, at the target, and has come from far enough away."""

    kind: Literal["foot_moved"]
    foot: Literal["left", "right"] = Field(description="which foot moves")
    tolerance: Positive = Field(description="[m] largest distance of the sole's centre from the target")
    target: Vector2 | None = Field(
        default=None, description="[m] world x, y; default: that of the foot's last step task"
    )
    min_distance: NonNegative = Field(default=0.0, description="[m] smallest distance from where the foot began")


class ComOutsideStance(CheckSettings):
    """While one foot was in the air, the CoM's ground projection was at least `min` outside the stance sole.

    Only flights count that end with the foot down and loaded and the torso up: a fall is no step.
    """

    kind: Literal["com_outside_stance"]
    min: float = Field(description="[m] smallest distance outside the stance sole")
    min_torso_up: float = Field(
        default=0.7, gt=-1, lt=1, description="smallest cosine of the torso's tilt until 0.5 s after the landing"
    )
