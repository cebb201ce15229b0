"""Where stage 2 may move the coming footsteps: each beside the foot that stands, the present one within reach."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.settings import GaitSettings
from wbmpc.planner.stepping import turning_room
from wbmpc.planner.support_preview import MAX_FOOTSTEPS
from wbmpc.planner.swing import Swing
from wbmpc.record import record
from wbmpc.signals import Vector

FARTHEST = 0.3  # [m] of a footstep from its reference


@record
class FootstepBounds:
    """The fields of `SupportPreview` that say where footsteps may go; unused footsteps are fixed at 0."""

    footsteps: Vector  # (MAX_FOOTSTEPS, 2) [m]
    placement_axes: Vector  # (MAX_FOOTSTEPS, 2, 2)
    placement_lower: Vector  # (MAX_FOOTSTEPS, 2) [m]
    placement_upper: Vector  # (MAX_FOOTSTEPS, 2)
    lower: Vector  # (MAX_FOOTSTEPS, 2) [m]
    upper: Vector  # (MAX_FOOTSTEPS, 2)

    @classmethod
    def of(
        cls, settings: GaitSettings, feet: Feet, steps: list[Footstep], *, swing: Swing | None, left: float
    ) -> FootstepBounds:
        """For `steps` from `feet`; the foot that is in the air has `left` [s] until it lands."""
        bounds = cls(
            *_bounds(
                *(feet.positions, feet.yaws),
                np.array([(step.side, step.yaw, step.adaptable) for step in steps]).reshape(-1, 3),
                np.array([step.position for step in steps]).reshape(-1, 3),
                settings.adapt_footsteps,
                *(settings.narrowest, settings.widest, settings.longest, settings.turning_room),
                MAX_FOOTSTEPS,
            )
        )
        if swing is not None and swing.step.adaptable and settings.adapt_footsteps:
            reach = settings.foot_speed * left
            offset = swing.target[:2] - swing.step.position[:2]
            bounds.lower[0], bounds.upper[0] = offset - reach, offset + reach
        return bounds


@kernel
def _bounds(
    positions: Vector,
    yaws: Vector,
    steps: Vector,
    places: Vector,
    adapt: bool,
    narrowest: float,
    widest: float,
    longest: float,
    room: float,
    count: int,
) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """The fields of `FootstepBounds`, `count` of each, for a swing foot that is where its step begins.

    Args:
        positions, yaws: of both soles before the first step, (2, 3) [m], (2,) [rad].
        steps: (n, 3) side, yaw [rad], 1 if adaptable; `places` (n, 3) [m].
        adapt: whether adaptable footsteps may be moved at all.
        narrowest, widest, longest: of two feet in their axes [m]; `room` as in `turning_room`.
    """
    footsteps, axes = np.zeros((count, 2)), np.zeros((count, 2, 2))
    lowest, highest = np.full((count, 2), -np.inf), np.full((count, 2), np.inf)
    lower, upper = np.zeros((count, 2)), np.zeros((count, 2))
    axes[:, 0, 0] = axes[:, 1, 1] = 1.0
    where, turned = positions.copy(), yaws.copy()
    for j in range(len(steps)):
        side, yaw = int(steps[j, 0]), steps[j, 1]
        stance, sign = 1 - side, 1.0 if side == 0 else -1.0
        footsteps[j] = places[j, :2]
        c, s = np.cos(turned[stance]), np.sin(turned[stance])
        axes[j, 0, 0], axes[j, 0, 1], axes[j, 1, 0], axes[j, 1, 1] = c, s, -s, c
        nominal = np.dot(axes[j], (places[j] - where[stance])[:2])
        if steps[j, 2] > 0.0 and adapt:
            near = sign * (narrowest + turning_room(room, yaw - turned[stance]))
            far = sign * widest
            lowest[j, 0], highest[j, 0] = min(-longest, nominal[0]) - nominal[0], max(longest, nominal[0]) - nominal[0]
            lowest[j, 1] = min(near, far, nominal[1]) - nominal[1]
            highest[j, 1] = max(near, far, nominal[1]) - nominal[1]
            lower[j], upper[j] = -FARTHEST, FARTHEST
        where[side], turned[side] = places[j], yaw
    return footsteps, axes, lowest, highest, lower, upper
