"""The two postures of a lift: the palms on the box, and where they bring it."""

from __future__ import annotations

import numpy as np

from wbmpc.kinematics import Kinematics
from wbmpc.planner.bands import UNBOUNDED
from wbmpc.planner.footstep import Feet
from wbmpc.planner.lift import Lift
from wbmpc.planner.posture import PalmTarget, Posture
from wbmpc.signals import Vector

COM_COST = 10.0  # [cost / m²] how hard they keep the CoM over the feet
TILT_COST = 0.03  # [cost / rad²] how hard they keep the torso up: knees bend, not the back
SLACK = 0.01  # [m] of d of the hands that lift


class LiftPostures:
    """Low and high: the box where it is taken and where it is held; on the way, before a stride and after it."""

    def __init__(self, kinematics: Kinematics, *, nominal: Vector) -> None:
        """`nominal` (nq,): the posture to deviate from as little as possible."""
        self.low, self.high = (
            Posture(kinematics, nominal=nominal, com_cost=COM_COST, tilt_cost=TILT_COST) for _ in range(2)
        )

    def iterate(self, iterations: int, lift: Lift, *, before: Feet, after: Feet, centre: Vector) -> None:
        """Improve both for the feet now and after the stride (the same without one); `centre` (2,) [m] of the CoM.

        What is not held any more leaves one posture to go on with: low, on the feet after the stride.
        """
        stages = ((self.low, after if lift.lost else before, lift.grasp), (self.high, after, lift.top))
        for posture, feet, end in stages[: 1 if lift.lost else 2]:
            if lift.carry is not None:  # to the millimetre: targets that creep along would never be reached
                com = np.array([*centre, round(float(posture.com[2]), 3)])
                end = lift.carry.beside(com, feet.heading)
            palms: list[PalmTarget | None] = [
                PalmTarget(palm, normal) for palm, normal in zip(end, lift.normals, strict=True)
            ]
            posture.iterate(iterations, soles=feet.positions, yaws=feet.yaws, palms=palms, centre=centre)

    def distance(self, lift: Lift) -> Vector:
        """d (2, 3) [m] of the palms: the larger distance from the CoM of the two, along the world's axes."""
        if lift.carry is not None:
            return np.full((2, 3), UNBOUNDED)  # they go along with it
        low, high = lift.grasp - self.low.com, lift.top - self.high.com
        return np.maximum(np.abs(low), np.abs(high)) + SLACK
