"""Stage 3 with the contacts given, knot by knot: the forces of `ContactForce` without its large QP ([M] eq. neweq)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.contact_force import POLYGON_PRICE, Need
from wbmpc.planner.knot_qp import (
    GRIP,
    NEED,
    empty_room,
    is_finite,
    pack_need,
    pack_patch,
    pack_prices,
    pack_shift,
    solve_knot,
    to_world,
    unpack_grips,
    unpack_need,
)
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.qp import QpSolution
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SIDES, SolveStatus, Vector


class KnotForces:
    """The problem of `ContactForce`, exactly: nothing ties one knot to another, so it is a QP of 3 or 6 each."""

    def __init__(self, steps: int, settings: ContactSettings, *, mass: float, contacts: int) -> None:
        """For `steps` knots and up to two contacts; the first instance compiles or loads the kernels."""
        if contacts > len(SIDES):
            raise ValueError(f"at most {len(SIDES)} contacts have one QP a knot, received {contacts}")
        self._weight, self._prices = mass * GRAVITY, pack_prices(settings)
        self._softness = 1.0 / (POLYGON_PRICE * settings.shift_slack_cost)
        self._need, self._grips = np.zeros((steps, NEED)), np.zeros((contacts, GRIP))
        self._polygons: tuple[SupportPolygon, ...] | None = None  # packed last
        self._caps, self._forces = np.zeros((contacts, steps)), np.zeros((contacts, steps, 3))
        self._run()

    def solve(self, need: Need, patches: Sequence[PatchPose | None], caps: Vector) -> tuple[Vector | None, QpSolution]:
        """See `ContactForce.solve`; `iterations` counts the knots at which there was something to solve."""
        start = perf_counter()
        if need.polygons is self._polygons:  # of feet that stand, from plan to plan
            pack_shift(need, self._need)
        else:
            pack_need(need, self._need)
            self._polygons = need.polygons
        self._caps[:] = caps
        for i, patch in enumerate(patches):
            if patch is None:
                self._caps[i] = 0.0
            else:
                pack_patch(patch, self._grips[i])
        solved = self._run()
        if solved < 0:
            x, status = np.full(self._forces.size, np.nan), SolveStatus.NUMERICAL_ERROR
            return None, QpSolution(x, status, 0, perf_counter() - start)
        x = self._forces.swapaxes(0, 1).ravel()
        return self._forces.copy(), QpSolution(x, SolveStatus.SOLVED, solved, perf_counter() - start)

    def _run(self) -> int:
        return plan_forces(
            self._need, self._grips, self._caps, self._prices, self._weight, self._softness, self._forces
        )


@kernel
def plan_forces(
    packed_need: Vector,
    packed_grips: Vector,
    caps: Vector,
    prices: Vector,
    weight_of_robot: float,
    softness: float,
    forces: Vector,
) -> int:
    """Write the forces (contacts, knots, 3) [N]: zero but where a contact's cap (contacts, knots) [N] is positive.

    Returns the number of knots with any such contact, or -1 when a QP could not be solved.
    """
    need, room = unpack_need(packed_need, weight_of_robot), empty_room()
    grips = unpack_grips(packed_grips, prices, weight_of_robot)
    forces[:] = 0.0
    if not is_finite(need):
        return -1
    solved = 0
    for k in range(len(need.height)):
        first = second = -1
        for i in range(len(caps)):
            if caps[i, k] > 0.0:
                grips.cap[i] = caps[i, k] / weight_of_robot
                if first < 0:
                    first = i
                else:
                    second = i
        if first < 0:
            continue
        solved += 1
        if not solve_knot(room, need, k, grips, first, second, softness) < np.inf:
            return -1
        to_world(forces[first, k], room.qp.x[:3], grips.axes[first], weight_of_robot)
        if second >= 0:
            to_world(forces[second, k], room.qp.x[3:], grips.axes[second], weight_of_robot)
    return solved
