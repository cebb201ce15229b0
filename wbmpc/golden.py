"""Golden results: what a scenario's run gave once, how far a later one may be from it, and whether it is.

A hash tells whether two runs are the same to the bit, which they are on one machine only. What a change of the
controller alters, and another processor's rounding does not, are the metrics and the values of the checks, within
tolerances that go with the kind of quantity. They stand in the file, entry by entry, and may be edited there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from wbmpc.errors import WbmpcError
from wbmpc.strict import NonNegative, StrictModel
from wbmpc.verdict import finite, write_json

# (absolute, relative) by unit, of a check's value or a metric. Rounding moves most by a ten-thousandth of that
# (docs/results.md); the rest is room for a touch or a decision that falls on another tick.
BY_UNIT: dict[str, tuple[float, float]] = {
    "m": (0.0002, 0.005),
    "s": (0.02, 0.0),
    "N": (0.1, 0.02),
    "rad": (0.002, 0.005),
    "kg": (0.0, 1e-6),
    "m/s": (0.001, 0.005),
    "1": (0.004, 0.01),
}
EXACT = (0.0, 0.0)
# Metrics: those of a kind that its unit does not tell, and the units of the others.
BY_METRIC: dict[str, tuple[float, float]] = {
    "simulated_time": (1e-6, 0.0),
    "robot_mass": BY_UNIT["kg"],
    "com_height_min": (0.0003, 0.0),
    "com_height_max": (0.0003, 0.0),
    "com_speed_max": BY_UNIT["m/s"],
    "torso_up_min": (0.001, 0.0),
    "torque_peak_fraction": BY_UNIT["1"],
    "speed_peak_fraction": BY_UNIT["1"],
    "penetration_max": (5e-5, 0.1),
    "hand_force_max": BY_UNIT["N"],
    "hand_contacts": EXACT,
    "first_hand_contact": BY_UNIT["s"],
    "plans": EXACT,
    "stage3_plans": (2.0, 0.01),
}


class Entry(StrictModel):
    """One number of a golden result."""

    value: float | None = Field(description="null: could not be measured")
    atol: NonNegative = Field(description="absolute tolerance")
    rtol: NonNegative = Field(description="relative tolerance, of the value's size")

    @property
    def allowed(self) -> float:
        """By how much a run may be off."""
        return self.atol + self.rtol * abs(self.value or 0.0)

    def accepts(self, value: float | None) -> bool:
        """Whether a run's value is near enough; what could not be measured is near nothing else."""
        if value is None or self.value is None:
            return value is self.value
        return abs(value - self.value) <= self.allowed


class Golden(StrictModel):
    """A golden result: DIR/NAME.json."""

    scenario: str
    seed: int
    metrics: dict[str, Entry]
    checks: dict[str, Entry]
    versions: dict[str, str] = Field(description="of the programs that made it; not compared")
    state_sha256: str = Field(description="on the machine that made it; not compared")


@dataclass(frozen=True, slots=True)
class Deviation:
    """A number that is too far off."""

    name: str
    golden: float | None
    value: float | None
    allowed: float


@dataclass(frozen=True, slots=True)
class GoldenResult:
    """How a run compares with its golden result."""

    file: str
    deviations: tuple[Deviation, ...]

    def as_dict(self) -> dict[str, Any]:
        """`golden` of NAME.json."""
        rows = [{"name": d.name, "golden": d.golden, "value": d.value, "allowed": d.allowed} for d in self.deviations]
        return {"file": self.file, "passed": not rows, "deviations": rows}


def read_golden(path: Path) -> Golden:
    """A golden result.

    Raises:
        WbmpcError: no such file, or not a golden result; says which key.
    """
    try:
        return Golden.model_validate_json(path.read_bytes())
    except OSError as error:
        raise WbmpcError(f"no golden result {path} ({error.strerror}); make it with --write-golden") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise WbmpcError(f"{path}: not a golden result: {where}: {first['msg']}") from None


def write_golden(path: Path, document: Mapping[str, Any]) -> None:
    """Make a golden result of a verdict (the content of NAME.json); tolerances that the file has already are kept."""
    old = read_golden(path) if path.is_file() else None
    units = {check["name"]: check["unit"] for check in document["checks"]}
    golden = Golden(
        scenario=document["scenario"],
        seed=document["seed"],
        metrics={
            name: _entry(value, BY_METRIC.get(name, BY_UNIT["1"]), old.metrics.get(name) if old else None)
            for name, value in finite(document["metrics"]).items()
        },
        checks={
            check["name"]: _entry(
                check["value"],
                BY_UNIT.get(units[check["name"]], BY_UNIT["1"]),
                old.checks.get(check["name"]) if old else None,
            )
            for check in finite(document["checks"])
        },
        versions=document["versions"],
        state_sha256=document["state_sha256"],
    )
    write_json(path, json.loads(golden.model_dump_json()))


def _entry(value: float | None, tolerances: tuple[float, float], old: Entry | None) -> Entry:
    atol, rtol = (old.atol, old.rtol) if old else tolerances
    return Entry(value=None if value is None else float(value), atol=atol, rtol=rtol)


def against_golden(path: Path, golden: Golden, document: Mapping[str, Any]) -> GoldenResult:
    """Compare a verdict (the content of NAME.json). What the golden result does not have is not compared."""
    plain = finite(dict(document))
    values = {("metrics", name): value for name, value in plain["metrics"].items()}
    values |= {("checks", check["name"]): check["value"] for check in plain["checks"]}
    entries = {(kind, name): entry for kind in ("metrics", "checks") for name, entry in getattr(golden, kind).items()}
    deviations = [
        Deviation(f"{kind}.{name}", entry.value, values.get((kind, name)), entry.allowed)
        for (kind, name), entry in entries.items()
        if not entry.accepts(values.get((kind, name)))
    ]
    return GoldenResult(str(path), tuple(deviations))
