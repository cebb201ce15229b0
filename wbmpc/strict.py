"""The base of every settings model, and the number types they share.

Settings are read from YAML, so that a mistyped key, a string for a number, `true` for 1, NaN or infinity must be
errors and never a silent default. Every field states its meaning and unit in its description, which goes to the
JSON Schema that editors show.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints


class StrictModel(BaseModel):
    """Frozen settings: unknown keys refused, no type conversions, finite numbers only, defaults validated too."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        validate_default=True,
    )


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Friction = Annotated[float, Field(gt=0, le=5)]  # Coulomb coefficient [-]
Count = Annotated[int, Field(ge=1)]
Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,63}$")]
"""A name used in dotted paths and as a MuJoCo name: letters, digits and underscores, so that it needs no quoting."""
