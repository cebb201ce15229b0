"""Paths of a palm through space, as smooth functions of a parameter σ in [0, 1]."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel, short_kernel
from wbmpc.record import record
from wbmpc.signals import Vector

LEAD = (0.0, 0.6)  # part of σ in which the leading component moves
LAG = (0.25, 1.0)  # and the following one


@short_kernel
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


@record
class HandPath:
    """From `start` to `end` (3,) in world [m], staying on the side that `away` points to.

    The component of the motion along the unit vector `away` (out of a surface; up for a free reach) leads when it goes
    outwards and lags when it goes inwards: the palm rises before it moves over an edge and sinks after.
    """

    start: Vector
    end: Vector
    away: Vector

    def at(self, sigma: float) -> tuple[Vector, Vector, Vector]:
        """Position (3,) [m] and its first and second derivative with respect to σ."""
        p, dp, ddp = _at(self.start, self.end, self.away, sigma)
        return p, dp, ddp

    def shared(self, sigma: float, motion: Vector) -> Vector:
        """What the palm at σ makes of a motion (3,) of the path's end."""
        outward = float(motion @ self.away) * self.away
        first, second = (LEAD, LAG) if float((self.end - self.start) @ self.away) >= 0.0 else (LAG, LEAD)
        value = np.zeros(3)
        for part, (begin, finish) in ((outward, first), (motion - outward, second)):
            value += minimum_jerk((sigma - begin) * (1.0 / (finish - begin)))[0] * part
        return value

    def positions(self, sigmas: Vector) -> Vector:
        """Positions (n, 3) [m] at `sigmas` (n,)."""
        return _positions(self.start, self.end, self.away, sigmas)


@kernel
def _at(start: Vector, end: Vector, away: Vector, sigma: float) -> tuple[Vector, Vector, Vector]:
    way = end - start
    along = np.dot(way, away)
    first, second = (LEAD, LAG) if along >= 0.0 else (LAG, LEAD)
    outwards, across = 1.0 / (first[1] - first[0]), 1.0 / (second[1] - second[0])  # per σ
    s, ds, dds = minimum_jerk((sigma - first[0]) * outwards)
    t, dt, ddt = minimum_jerk((sigma - second[0]) * across)
    p, dp, ddp = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        out = along * away[i]
        rest = way[i] - out
        p[i] = start[i] + s * out + t * rest
        dp[i] = ds * outwards * out + dt * across * rest
        ddp[i] = dds * outwards**2 * out + ddt * across**2 * rest
    return p, dp, ddp


@kernel
def _positions(start: Vector, end: Vector, away: Vector, sigmas: Vector) -> Vector:
    n, along = len(sigmas), 0.0
    for i in range(3):
        along += (end[i] - start[i]) * away[i]
    first, second = (LEAD, LAG) if along >= 0.0 else (LAG, LEAD)
    out = np.empty((n, 3))
    for k in range(n):
        outwards = min(max((sigmas[k] - first[0]) / (first[1] - first[0]), 0.0), 1.0)
        across = min(max((sigmas[k] - second[0]) / (second[1] - second[0]), 0.0), 1.0)
        outwards = outwards**3 * (10.0 - 15.0 * outwards + 6.0 * outwards**2)
        across = across**3 * (10.0 - 15.0 * across + 6.0 * across**2)
        for i in range(3):
            part = along * away[i]
            out[k, i] = start[i] + outwards * part + across * (end[i] - start[i] - part)
    return out


@record
class Landing:
    """The way of least ∫|a|² from a palm in motion onto a surface that it meets at a given velocity: a cubic in time.

    Made anew at every plan from the measured palm this is terminal guidance: whatever the falling body does to the
    hand on its way, it arrives in time and no faster than it should. After `duration` it goes on at `arrival`.
    """

    start: Vector  # (3,) [m] in world
    velocity: Vector  # (3,) [m/s] at the start
    end: Vector  # (3,) [m]
    arrival: Vector  # (3,) [m/s] at the end
    duration: float  # [s] > 0
    normal: Vector | None = None

    @staticmethod
    def shortest(*, way: Vector, velocity: Vector, arrival: Vector, acceleration: float) -> float:
        """Shortest duration [s] in which neither end asks for more than `acceleration` [m/s²] along the way (3,) [m].

        Along the way, a(0) T² = 6 d − (4 v₀ + 2 v₁) T and −a(T) T² = 6 d − (2 v₀ + 4 v₁) T.
        """
        d = float(np.linalg.norm(way))
        if d < 1e-9:
            return 0.0
        v0, v1 = float(velocity @ way) / d, float(arrival @ way) / d
        halves = (2.0 * v0 + v1, v0 + 2.0 * v1)
        return max(float(np.sqrt(h * h + 6.0 * d * acceleration) - h) / acceleration for h in halves)

    def at(self, time: float) -> tuple[Vector, Vector, Vector]:
        """Position (3,) [m], velocity [m/s] and acceleration [m/s²] at `time` [s]."""
        T = self.duration
        if time >= T:
            return self.end + (time - T) * self.arrival, self.arrival, np.zeros(3)
        way = (self.end - self.start) / T
        end_velocity = self.arrival
        if self.normal is not None:  # free across the normal: 1.5 way − 0.5 v₀ ends without acceleration
            free = 1.5 * way - 0.5 * self.velocity
            end_velocity = self.arrival + free - float(free @ self.normal) * self.normal
        a = (6.0 * way - 4.0 * self.velocity - 2.0 * end_velocity) / T
        jerk = 6.0 * (self.velocity + end_velocity - 2.0 * way) / T**2
        return (
            self.start + time * (self.velocity + time * (a / 2.0 + time * jerk / 6.0)),
            self.velocity + time * (a + time * jerk / 2.0),
            a + time * jerk,
        )
