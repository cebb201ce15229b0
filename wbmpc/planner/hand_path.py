"""Paths of a palm through space, as smooth functions of a parameter σ in [0, 1]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.signals import Vector

LEAD = (0.0, 0.6)  # part of σ in which the leading component moves
LAG = (0.25, 1.0)  # and the following one


def minimum_jerk(phase: float) -> tuple[float, float, float]:
    """Value, first and second derivative of the quintic from 0 to 1 that starts and ends at rest; clipped outside."""
    if phase <= 0.0:
        return 0.0, 0.0, 0.0
    if phase >= 1.0:
        return 1.0, 0.0, 0.0
    p2 = phase * phase
    return (
        p2 * phase * (10.0 - 15.0 * phase + 6.0 * p2),
        30.0 * p2 * (1.0 - 2.0 * phase + p2),
        60.0 * phase * (1.0 - 3.0 * phase + 2.0 * p2),
    )


def departing(phase: float) -> tuple[float, float, float]:
    """Value and derivatives of the quintic that is 0 and at rest at both ends but for a slope of 1 at phase 0."""
    p2 = phase * phase
    return (
        phase * (1.0 + p2 * (-6.0 + 8.0 * phase - 3.0 * p2)),
        1.0 + p2 * (-18.0 + 32.0 * phase - 15.0 * p2),
        phase * (-36.0 + 96.0 * phase - 60.0 * p2),
    )


def arriving(phase: float) -> tuple[float, float, float]:
    """The same with its slope of 1 at phase 1."""
    p2 = phase * phase
    return (
        p2 * phase * (-4.0 + 7.0 * phase - 3.0 * p2),
        p2 * (-12.0 + 28.0 * phase - 15.0 * p2),
        phase * (-24.0 + 84.0 * phase - 60.0 * p2),
    )


@dataclass(frozen=True, slots=True)
class HandPath:
    """From `start` to `end` (3,) in world [m], staying on the side that `away` points to.

    The component of the motion along the unit vector `away` (out of a surface; up for a free reach) leads when it goes
    outwards and lags when it goes inwards: the palm rises before it moves over an edge and sinks after. A path in haste
    has no time for that: with `haste` 1 it is straight. It may start and end in motion: `departure` and `arrival` (3,)
    are dp/dσ there [m], a velocity times the path's duration.
    """

    start: Vector
    end: Vector
    away: Vector
    haste: float = 0.0
    departure: Vector | None = None
    arrival: Vector | None = None

    def at(self, sigma: float) -> tuple[Vector, Vector, Vector]:
        """Position (3,) [m] and its first and second derivative with respect to σ."""
        p, dp, ddp = self.start.copy(), np.zeros(3), np.zeros(3)
        for part, begin, finish in self._parts():
            scale = 1.0 / (finish - begin)
            s, ds, dds = minimum_jerk((sigma - begin) * scale)
            p += s * part
            dp += ds * scale * part
            ddp += dds * scale**2 * part
        for slope, basis in ((self.departure, departing), (self.arrival, arriving)):
            if slope is not None:
                s, ds, dds = basis(min(max(sigma, 0.0), 1.0))
                p += s * slope
                dp += ds * slope
                ddp += dds * slope
        return p, dp, ddp

    def positions(self, sigmas: Vector) -> Vector:
        """Positions (n, 3) [m] at `sigmas` (n,)."""
        p = np.tile(self.start, (len(sigmas), 1))
        for part, begin, finish in self._parts():
            phase = np.minimum(np.maximum((sigmas - begin) / (finish - begin), 0.0), 1.0)
            p += (phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2))[:, None] * part
        phase = np.minimum(np.maximum(sigmas, 0.0), 1.0)
        for slope, basis in ((self.departure, departing), (self.arrival, arriving)):
            if slope is not None:
                p += np.array([basis(s)[0] for s in phase])[:, None] * slope
        return p

    def _parts(self) -> list[tuple[Vector, float, float]]:
        """The way in two parts (3,) [m], along `away` and across it, each with the σ at which it begins and ends."""
        way = self.end - self.start
        along = float(way @ self.away)
        outward = along * self.away
        first, second = (LEAD, LAG) if along >= 0.0 else (LAG, LEAD)
        calm = 1.0 - self.haste
        return [
            (part, calm * begin, 1.0 - calm * (1.0 - finish))
            for part, (begin, finish) in ((outward, first), (way - outward, second))
        ]
