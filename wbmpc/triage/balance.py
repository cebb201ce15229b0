"""When a robot that fell could no longer be saved, and what a push would have asked of it."""

from __future__ import annotations

import numpy as np

from wbmpc.checks.context import TOUCH, CheckContext
from wbmpc.checks.fall import down
from wbmpc.checks.result import first_time
from wbmpc.checks.settings import NoFall
from wbmpc.signals import GRAVITY, Vector

LOOK_BACK = 3.0  # [s] before a robot is down: no topple of this size takes longer
OUTSIDE = 0.01  # [m] by which the capture point must be outside to count as lost
_ANGLES = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)
_DIRECTIONS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])  # (72, 2) of the hull's supporting lines


def time_down(context: CheckContext, config: NoFall) -> float | None:
    """When the robot was down for the first time [s]; None: never."""
    low, tilted = down(context.recorder, config)
    return first_time(context.time, low | tilted)


def capture_rate(context: CheckContext) -> Vector:
    """(n,) [1/s] ω of the linear inverted pendulum at each CoM height over the lower sole."""
    recorder = context.recorder
    height = recorder.com[:, 2] - recorder.sole_position[:, :, 2].min(axis=1)
    return np.sqrt(GRAVITY / np.maximum(height, 0.05))


def capture_point(context: CheckContext) -> Vector:
    """(n, 2) [m] where the robot would have to step, or push, to come to rest: c + ċ / ω."""
    recorder = context.recorder
    return recorder.com[:, :2] + recorder.com_velocity[:, :2] / capture_rate(context)[:, None]


def support_points(context: CheckContext, tick: int) -> Vector:
    """(k, 2) [m] contacts that carry the robot at a tick: of the soles, and of palms on anything but the ground."""
    contacts, facts = context.recorder.contacts, context.facts
    first, stop = np.searchsorted(context.recorder.contact_tick, [tick, tick + 1])
    robot_geom, other_geom, outside = (sides[first:stop] for sides in context.contact_sides)
    foot = facts.geom_foot[robot_geom] >= 0
    palm = (facts.geom_palm[robot_geom] >= 0) & ~facts.geom_walkable[other_geom]
    carries = outside & (foot | palm) & (np.linalg.norm(contacts.force[first:stop], axis=1) > TOUCH)
    return np.asarray(contacts.position[first:stop][carries, :2])


def margin(points: Vector, where: Vector, directions: Vector = _DIRECTIONS) -> float:
    """Least distance [m] from `where` (2,) to the hull of `points` (k, 2) along `directions`; negative outside."""
    if not len(points):
        return -np.inf
    return float((np.max(points @ directions.T, axis=0) - directions @ where).min())


def point_of_no_return(context: CheckContext, fallen: float) -> float:
    """The last time [s] before the robot was down, at `fallen`, at which its capture point was within its contacts."""
    capture, step = capture_point(context), context.ticks(0.01)
    last = int(np.searchsorted(context.time, fallen))
    first = int(np.searchsorted(context.time, fallen - LOOK_BACK))
    for tick in range(min(last, context.recorder.ticks - 1), first, -step):
        if margin(support_points(context, tick), capture[tick]) > -OUTSIDE:
            return float(context.time[tick])
    return float(context.time[first])
