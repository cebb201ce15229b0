"""What several checks share: a name of their own, a hold, a window of time."""

from __future__ import annotations

from pydantic import Field, model_validator

from wbmpc.strict import NonNegative, Positive, StrictModel, Vector3


class CheckSettings(StrictModel):
    """Common to the checks that a scenario lists."""

    name: str | None = Field(default=None, min_length=1, description="name in the results; default: the kind")


class HoldSettings(CheckSettings):
    """Common to the checks of a hold: which stretch of time is judged.

    With a target, or in a scenario with a reach task, the hold is the window of length `hold`, and the hand, with the
    smallest largest palm-to-target distance. Without either it is the window in which the CoM's ground projection
    stays farthest outside the support polygon of the feet, judged by its smallest distance in the window.
    """

    hold: Positive = Field(description="[s] how long")
    target: Vector3 | None = Field(
        default=None, description="[m] in world; default: the target of the scenario's reach task, if it has one"
    )


class WindowSettings(CheckSettings):
    """Common to the checks of a stretch of time."""

    window: tuple[NonNegative, NonNegative] | None = Field(
        default=None, description="[s] from, to; default: the whole run"
    )

    @model_validator(mode="after")
    def _window_in_order(self) -> WindowSettings:
        if self.window is not None and self.window[0] >= self.window[1]:
            raise ValueError(f"'window' needs its beginning first, got [{self.window[0]:g}, {self.window[1]:g}]")
        return self


def check_range(name: str, bounds: tuple[float, float] | None) -> None:
    """Raise ValueError unless `bounds`, if given, are in order."""
    if bounds is not None and bounds[0] > bounds[1]:
        raise ValueError(f"'{name}' needs its lower bound first, got [{bounds[0]:g}, {bounds[1]:g}]")
