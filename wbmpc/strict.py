"""The base of everything that a user writes in YAML."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """A frozen model that refuses unknown keys and non-finite numbers, so that a mistyped key never reads as a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
