"""One phase of the horizon: which feet carry, and where between them the ZMP may be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbmpc.planner.footstep import Feet, Footstep
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.signals import Vector


class Transfer(NamedTuple):
    """The load goes from foot to foot: shares of left and right go linearly from `before` to `after`."""

    begin: float  # [s from now]
    before: tuple[float, float]
    after: tuple[float, float]

    @classmethod
    def before_step(cls, step: Footstep, feet: Feet, end: float) -> Transfer | None:
        """To the foot that stays, before a walking `step` from `feet` that lifts at `end` [s]; None for a stride."""
        if not step.adaptable:
            return None
        shares = ((1.0, 0.0), (0.0, 1.0))
        before = (0.5, 0.5) if feet.last < 0 else shares[1 - feet.last]
        return cls(end - step.double_support, before, shares[1 - step.side])


class Interval(NamedTuple):
    """Until `end` the robot stands on `feet`, but for a foot that swings.

    In a double support between two walking steps the ZMP may be in w_L P_L ⊕ w_R P_R, a sole that slides from one foot
    to the other with the shares w of the transfer (Scianca et al. 2020). That is less than the hull of both feet, and
    asks of a knot the same from whichever plan it is seen: with the hull, a knot next to a lift-off would promise the
    plans before it more room than the plans after it find. It moves with the footsteps exactly as S (F − F_ref) says,
    but for soles at different heights: those are projected, with a factor near 1.
    """

    end: float  # [s from now]
    feet: Feet
    swing: int  # side of the foot in the air, -1: none
    moved: tuple[int, int]  # number of the footstep that each foot stands on; -1: it stands there already
    transfer: Transfer | None = None

    @property
    def standing(self) -> list[int]:
        """Sides of the feet that stand."""
        return [side for side in range(2) if side != self.swing]

    def weights(self, time: float) -> tuple[float, float] | None:
        """Shares of left and right at `time` [s from now] in a transfer; None when they are free."""
        transfer = self.transfer
        if transfer is None:
            return None
        share = min(max((time - transfer.begin) / max(self.end - transfer.begin, 1e-6), 0.0), 1.0)
        left, right = (a + share * (b - a) for a, b in zip(transfer.before, transfer.after, strict=True))
        return left, right

    def polygon(
        self, time: float, *, half_extents: Vector, margin: float, onto: tuple[float, Vector] | None = None
    ) -> SupportPolygon:
        """Where the ZMP may be at `time` [s from now]; soles of `half_extents` (2,) [m], inset by `margin` [m].

        `onto`: height of a plane [m] and where the CoM (3,) is [m]. Without angular momentum a force goes through the
        CoM, and meets the plane where the line from its point of contact does (Caron et al. 2017); None: each sole seen
        from above, on the plane of their mean height.
        """
        positions, yaws = self.feet.positions, self.feet.yaws
        corners = [
            foot_corners(position=p, yaw=float(y), half_extents=half_extents)
            for p, y in zip(positions, yaws, strict=True)
        ]
        if onto is not None:
            plane, com = onto
            for side, sole in enumerate(corners):
                sole[:] = com[:2] + (sole - com[:2]) * (com[2] - plane) / (com[2] - positions[side][2])
        weights = self.weights(time)
        if weights is None:
            points = np.vstack([corners[side] for side in self.standing])
        else:
            left, right = (weight * sole for weight, sole in zip(weights, corners, strict=True))
            points = (left[:, None] + right[None]).reshape(-1, 2)
        plane = float(positions[self.standing, 2].mean()) if onto is None else onto[0]
        return SupportPolygon.of_corners(points, margin=margin, plane_height=plane)

    def shares(self, time: float, count: int) -> Vector:
        """(count,) share of each footstep's displacement by which the polygon at `time` [s from now] moves."""
        weights = self.weights(time)
        shares = np.zeros(count)
        for side in self.standing:
            if self.moved[side] >= 0:
                shares[self.moved[side]] += 1.0 / len(self.standing) if weights is None else weights[side]
        return shares
