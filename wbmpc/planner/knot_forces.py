"""Stage 3 with the contacts given, knot by knot: the forces of `ContactForce` without its large QP ([M] eq. neweq)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.contact_force import POLYGON_PRICE, Need
from wbmpc.planner.knot_qp import Grips, KnotNeeds, KnotRoom, set_axes, solve_knot, to_world
from wbmpc.planner.settings import ContactSettings
from wbmpc.qp import QpSolution
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SIDES, SolveStatus, Vector


class KnotForces:
    """The problem of `ContactForce`, exactly: nothing ties one knot to another, so it is a QP of 3 or 6 each."""

    def __init__(self, steps: int, settings: ContactSettings, *, mass: float, contacts: int) -> None:
        """For `steps` knots and up to two contacts; the first instance compiles or loads the kernels."""
        if contacts > len(SIDES):
            raise ValueError(f"at most {len(SIDES)} contacts have one QP a knot, received {contacts}")
        self._mass = mass
        self._grips, self._room = Grips.room_for(contacts, settings), KnotRoom.empty()
        self._needs, self._caps = KnotNeeds.room_for(steps), np.zeros((steps, contacts))
        self._there = np.zeros(contacts, dtype=np.bool_)
        self._forces = np.zeros((contacts, steps, 3))
        self._softness = 1.0 / (POLYGON_PRICE * settings.shift_slack_cost)
        self._run()

    def solve(self, need: Need, patches: Sequence[PatchPose | None], caps: Vector) -> tuple[Vector | None, QpSolution]:
        """See `ContactForce.solve`; `iterations` counts the knots at which there was something to solve."""
        start, unit = perf_counter(), self._mass * GRAVITY
        self._needs.fill(need, mass=self._mass)
        self._grips.fill(patches, mass=self._mass)
        self._there[:] = [patch is not None for patch in patches]
        np.divide(caps.T, unit, out=self._caps)
        solved = self._run() if self._needs.finite() else -1
        if solved < 0:
            x, status = np.full(self._forces.size, np.nan), SolveStatus.NUMERICAL_ERROR
            return None, QpSolution(x, status, 0, perf_counter() - start)
        forces = unit * self._forces
        x = forces.swapaxes(0, 1).ravel()
        return forces, QpSolution(x, SolveStatus.SOLVED, solved, perf_counter() - start)

    def _run(self) -> int:
        return plan_forces(self._room, self._needs, self._grips, self._there, self._caps, self._softness, self._forces)


@kernel
def plan_forces(
    room: KnotRoom,
    need: KnotNeeds,
    grips: Grips,
    there: NDArray[np.bool_],
    caps: Vector,
    softness: float,
    forces: Vector,
) -> int:
    """Write the forces (contacts, knots, 3): zero but for contacts that are `there`, with `caps` (knots, contacts) > 0.

    Returns the number of knots with any such contact, or -1 when a QP could not be solved.
    """
    solved = 0
    forces[:] = 0.0
    for i in range(len(there)):
        if there[i]:
            set_axes(grips.axes[i])
    for k in range(len(need.height)):
        first = second = -1
        for i in range(len(there)):
            if there[i] and caps[k, i] > 0.0:
                if first < 0:
                    first = i
                else:
                    second = i
        if first < 0:
            continue
        solved += 1
        cost = solve_knot(room, need, k, grips, first, second, caps[k], softness)
        if not cost < np.inf:
            return -1
        to_world(forces[first, k], room.qp.x[:3], grips.axes[first])
        if second >= 0:
            to_world(forces[second, k], room.qp.x[3:], grips.axes[second])
    return solved
