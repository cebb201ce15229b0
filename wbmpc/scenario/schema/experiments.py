"""The `counterfactuals:` and `sweep:` blocks: the same scenario under changed values."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, JsonValue, model_validator

from wbmpc.checks.settings import ScenarioCheck
from wbmpc.strict import StrictModel

DottedPath = Annotated[str, Field(min_length=1, description="Dotted path of a scenario key; list items by index.")]


class Counterfactual(StrictModel):
    """A change to the scenario together with what it must lead to: the proof that a part matters."""

    description: str = Field(default="", description="What this shows.")
    set: dict[DottedPath, JsonValue] = Field(min_length=1, description="New values by dotted path.")
    expect: Literal["pass", "fail"] = Field(description="The expected verdict.")
    failing: tuple[str, ...] = Field(
        default=(), description="Checks that must be among the failed ones, by name; only with `expect: fail`."
    )
    checks: tuple[ScenarioCheck, ...] = Field(default=(), description="Checks besides the scenario's own.")


class Variation(StrictModel):
    """One value that a sweep draws at random: exactly one of `uniform` and `choice`."""

    key: DottedPath
    uniform: tuple[float, float] | None = Field(
        default=None, description="Draw evenly between these two numbers, in the key's own unit."
    )
    choice: tuple[JsonValue, ...] | None = Field(default=None, min_length=1, description="Draw one of these values.")

    @model_validator(mode="after")
    def _one_distribution(self) -> Variation:
        if (self.uniform is None) == (self.choice is None):
            raise ValueError("needs exactly one of 'uniform' and 'choice'")
        if self.uniform is not None and self.uniform[0] >= self.uniform[1]:
            raise ValueError(f"'uniform' needs its lower bound first, got [{self.uniform[0]:g}, {self.uniform[1]:g}]")
        return self

    @property
    def extremes(self) -> tuple[JsonValue, ...]:
        """The values that bound what may be drawn: the two ends, or every choice."""
        return self.uniform if self.uniform is not None else self.choice or ()


class Sweep(StrictModel):
    """The ranges over which `wbmpc sweep` draws; the seed of each run is drawn as well."""

    variations: tuple[Variation, ...] = Field(min_length=1, description="Values drawn independently for every run.")
    checks: tuple[ScenarioCheck, ...] | None = Field(
        default=None, min_length=1, description="Checks in place of the scenario's own; null: the scenario's own."
    )
