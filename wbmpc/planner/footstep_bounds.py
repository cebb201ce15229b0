"""Where stage 2 may move the coming footsteps: each beside the foot that stands, the present one within reach."""

from __future__ import annotations

import numpy as np

from wbmpc.planner.footstep import SIDE_SIGN, Feet, Footstep
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
        m = MAX_FOOTSTEPS
        lower, upper, places = np.zeros((m, 2)), np.zeros((m, 2)), np.zeros((m, 2))
        axes = np.tile(np.eye(2), (m, 1, 1))
        placement_lower, placement_upper = np.full((m, 2), -np.inf), np.full((m, 2), np.inf)
        for j, step in enumerate(steps):
            places[j] = step.position[:2]
            stance = 1 - step.side
            c, s = np.cos(feet.yaws[stance]), np.sin(feet.yaws[stance])
            axes[j] = [[c, s], [-s, c]]
            nominal = axes[j] @ (step.position - feet.positions[stance])[:2]
            if step.adaptable and settings.adapt_footsteps:
                narrowest = settings.narrowest + turning_room(settings, step.yaw - float(feet.yaws[stance]))
                widths = sorted((SIDE_SIGN[step.side] * narrowest, SIDE_SIGN[step.side] * settings.widest))
                low, high = np.array([-settings.longest, widths[0]]), np.array([settings.longest, widths[1]])
                placement_lower[j] = np.minimum(low, nominal) - nominal
                placement_upper[j] = np.maximum(high, nominal) - nominal
                lower[j], upper[j] = -FARTHEST, FARTHEST
            feet = feet.after(step)
        if swing is not None and swing.step.adaptable and settings.adapt_footsteps:
            reach = settings.foot_speed * left
            offset = swing.target[:2] - swing.step.position[:2]
            lower[0], upper[0] = offset - reach, offset + reach
        return cls(places, axes, placement_lower, placement_upper, lower, upper)
