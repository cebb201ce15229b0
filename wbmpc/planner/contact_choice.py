"""Stage 3: which of the available contacts to take, one or several, a mixed-integer QP ([M] eq. QP2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbmpc.planner.contact_force import (
    Need,
    cone_rows,
    force_price,
    polygon_bound,
    polygon_rows,
    shift_bound,
    shift_rows,
)
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import MAX_EDGES
from wbmpc.qp import QpSolution, QuadraticProgram, make_mip_workspace
from wbmpc.record import record
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SIDES, SolveStatus, Vector

KNOTS = 2  # at which stage 3 asks for a choice
CROSSING_GAP = 0.05  # [m] by which the left hand's contact is to the left of the right hand's


@record
class Option:
    """One hand on one patch."""

    patch: PatchPose  # its position: where the force acts, of a palm that touches its own (`HandContact.grip`)
    hand: int  # side index
    price: float = 0.0  # [cost] w_i of taking it
    held: bool = False  # taken already: H_i = 1


@record
class Choice:
    """Stage 3's answer when it fires."""

    winners: tuple[int, ...]  # indices of the options taken, held ones left out
    forces: Vector  # (options, knots, 3) [N] in world; zero for an option that is not taken
    objective: float  # inf when no admissible set of contacts can give what is needed
    solution: QpSolution


class ContactChoice:
    """minimise  Σ_i w_i H_i + w_f Σ|f|²/(mg)² + w_s |Σ_i G f_i − h|²   over forces f_i of every option, binaries H_i

    subject to  n_i·f_i ≤ f_max H_i  (big-M: the force cap),  f_i in its friction cone,
                Σ_i P f_i ≤ q          the feet's ZMP inside the support polygon,
                1 ≤ Σ_i H_i ≤ most,    H_i = 1 for a contact that is held,
                Σ H_i ≤ 1              over the options of one hand, and over those of one patch,
                y_i ≥ y_j + gap        when H_i = H_j = 1, i of the left hand, j of the right, y to the left (big-M):
                                       arms that cross would run into each other; two that are held are where they
                                       are, and no contact is lost for it.

    The paper takes ΣH = 1; here several contacts share what is needed, and one that is held can be joined by another.
    A further contact pays its own w_i: it is taken when those before it cannot give what is needed, or when sharing the
    load saves more than it costs. The shift equalities are softened because x and y share one force: a brace that gives
    ΔZ_x gives a ΔZ_y too, and the polygon says how much of it the feet can take. The sums couple the options; the
    problem stays exact.
    """

    def __init__(
        self, options: int, settings: ContactSettings, *, mass: float, backend: str, knots: int = KNOTS
    ) -> None:
        """For at most `options` options at a time and needs of `knots` knots; `backend` is a key of MIQP_BACKENDS."""
        self._settings, self._mass, self._knots = settings, mass, knots
        self._forces = 3 * knots * options
        self._knot_rows = 2 + MAX_EDGES
        self._sums = knots * (self._knot_rows + 5 * options)  # first row of: count, crossing, hands, patches
        rows = self._sums + 2 + len(SIDES) + options // 2
        soft = np.zeros(rows)
        for knot in range(knots):
            # the equality is in N m; the slack's price is per metre of shift
            soft[knot * self._knot_rows : knot * self._knot_rows + 2] = (
                settings.shift_slack_cost / (mass * GRAVITY) ** 2
            )
        binary = range(self._forces, self._forces + options)
        self.problem = QuadraticProgram(self._forces + options, rows, soft_weight=soft, binary=binary)
        self._workspace = make_mip_workspace(backend, self.problem)

    def solve(self, need: Need, options: Sequence[Option], *, left: Vector) -> Choice:
        """Choose among `options` (at most as many as built for) for a need of as many knots as built for.

        Args:
            left: (2,) unit vector to the robot's left.
        """
        self.pose(need, options, left=left)
        return self._answer(options)

    def _answer(self, options: Sequence[Option]) -> Choice:
        solution, forces, knots = self._workspace.solve(), self._forces, self._knots
        if solution.status != SolveStatus.SOLVED:
            return Choice((), np.zeros((len(options), knots, 3)), np.inf, solution)
        x = solution.x
        taken = x[forces : forces + len(options)] > 0.5
        return Choice(
            winners=tuple(i for i, option in enumerate(options) if taken[i] and not option.held),
            forces=x[:forces].reshape(-1, knots, 3)[: len(options)].copy(),
            objective=self.problem.objective(x),
            solution=solution,
        )

    def pose(self, need: Need, options: Sequence[Option], *, left: Vector) -> None:
        """Write `problem`, as `solve` does before it solves."""
        qp, forces = self.problem, self._forces
        qp.matrix[:] = 0.0
        qp.gradient[:] = 0.0
        qp.lower[:], qp.upper[:] = -np.inf, 0.0
        qp.x_lower[:forces], qp.x_upper[:forces] = -np.inf, np.inf
        qp.x_lower[forces:], qp.x_upper[forces:] = 0.0, 1.0
        # solvers want strict convexity; unused slots and binaries have no curvature of their own
        qp.hessian[:] = 1e-6 * np.eye(qp.variables)
        h, q = shift_bound(need), polygon_bound(need)
        for knot in range(self._knots):
            first = knot * self._knot_rows
            qp.lower[first : first + 2] = qp.upper[first : first + 2] = h[knot]
            qp.upper[first + 2 : first + self._knot_rows] = q[knot]
        for i, option in enumerate(options):
            self._fill(i, option, need)
        unused = 3 * self._knots * len(options)
        qp.x_lower[unused:forces] = qp.x_upper[unused:forces] = 0.0
        qp.x_upper[forces + len(options) :] = 0.0
        self._fill_sums(options, left)

    def costs(
        self, need: Need, options: Sequence[Option], sets: Sequence[tuple[int, ...]], *, left: Vector
    ) -> list[tuple[float, Vector]]:
        """Stage 3's objective with exactly these `sets` of options and no other, and their forces.

        Returns:
            For every set, its cost with the prices of those that are not held, inf when it is not admissible or cannot
            give what is needed; and forces (members, knots, 3) [N] in world, in the order of the members.
        """
        answers = []
        for members in sets:
            chosen = [options[i] for i in members]
            self.pose(need, chosen, left=left)
            self.problem.x_lower[self._forces : self._forces + len(chosen)] = 1.0
            choice = self._answer(chosen)
            answers.append((choice.objective, choice.forces))
        return answers

    def _fill(self, i: int, option: Option, need: Need) -> None:
        """Costs, cone and cap of option `i`, and its share of the sums over the forces."""
        qp, binary, patch = self.problem, self._forces + i, option.patch
        qp.gradient[binary] = 0.0 if option.held else option.price
        qp.x_lower[binary] = 1.0 if option.held else 0.0
        cone, price = cone_rows(patch), force_price(patch, self._settings, self._mass)
        G, P = shift_rows(need, patch.position), polygon_rows(need, patch.position)
        for knot in range(self._knots):
            columns = slice(3 * (self._knots * i + knot), 3 * (self._knots * i + knot) + 3)
            first = knot * self._knot_rows
            row = self._knots * self._knot_rows + 5 * (self._knots * i + knot)
            qp.hessian[columns, columns] = price
            qp.matrix[first : first + 2, columns] = G[knot]
            qp.matrix[first + 2 : first + self._knot_rows, columns] = P[knot]
            qp.matrix[row : row + 4, columns] = cone
            qp.matrix[row + 4, columns] = patch.normal
            qp.matrix[row + 4, binary] = -patch.force_cap

    def _fill_sums(self, options: Sequence[Option], left: Vector) -> None:
        """Rows over the binaries: how many contacts, arms that do not cross, one patch a hand, one hand a patch."""
        qp, first, binaries = self.problem, self._sums, slice(self._forces, self._forces + len(options))
        qp.matrix[first, binaries] = 1.0
        qp.lower[first], qp.upper[first] = 1.0, self._settings.most_contacts
        if sum(option.held for option in options) < len(SIDES):
            # Σ_left (y − M) H − Σ_right (y + M) H ≥ gap − 2 M says nothing unless both hands are taken
            across = np.array([option.patch.position[:2] @ left for option in options])
            big = float(np.abs(across).max(initial=0.0)) + CROSSING_GAP
            signs = np.array([1.0 if option.hand == 0 else -1.0 for option in options])
            qp.matrix[first + 1, binaries] = signs * across - big
            qp.lower[first + 1], qp.upper[first + 1] = CROSSING_GAP - 2.0 * big, np.inf
        of_hand = [[option.hand == side for option in options] for side in range(len(SIDES))]
        patches = {id(option.patch): option.patch for option in options}.values()
        of_patch = [[option.patch is patch for option in options] for patch in patches]
        groups = of_hand + [members for members in of_patch if sum(members) > 1]
        for row, members in enumerate(groups, start=first + 2):
            qp.matrix[row, binaries] = members
            qp.upper[row] = 1.0
