"""Stage 3 by enumeration: every admissible set of contacts, most of them dismissed by a bound ([M] eq. QP2)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.contact_choice import CROSSING_GAP, KNOTS, Choice, Option
from wbmpc.planner.contact_cuts import (
    SetTable,
    collect_multipliers,
    cut_by_infeasibility,
    cut_by_optimum,
    empty_table,
)
from wbmpc.planner.contact_force import Need
from wbmpc.planner.knot_qp import (
    GRIP,
    NEED,
    empty_room,
    is_finite,
    pack_need,
    pack_patch,
    pack_prices,
    solve_knot,
    to_world,
    unpack_grips,
    unpack_need,
)
from wbmpc.planner.settings import ContactSettings
from wbmpc.qp import QpSolution
from wbmpc.signals import GRAVITY, SolveStatus, Vector

HAND, PATCH, PRICE, HELD = range(4)  # columns of an option's terms; prices are zero for what is held
TERMS = 4
TIE = 1e-10  # [cost] by which a set must promise to be better than the best
CROSSING_TOLERANCE = 1e-9  # [m] rounding of the distance between two patches


class ContactSets:
    """The problem of `ContactChoice`, exactly, by the sets of contacts that its binaries admit.

    A set is one option, or one of each hand on different patches without crossing, with all that is held: at most
    n + n²/4. For a given set the problem separates into one small QP a knot. The set with the lowest bound is solved
    next, its multipliers raise the bounds of all others (`contact_cuts`), until no bound is below the best cost.
    """

    def __init__(self, options: int, settings: ContactSettings, *, mass: float, knots: int = KNOTS) -> None:
        """For at most `options` options and needs of `knots` knots; the first instance compiles the kernels."""
        self._weight, self._prices, self._most = mass * GRAVITY, pack_prices(settings), settings.most_contacts
        self._need, self._grips = np.zeros((knots, NEED)), np.zeros((options, GRIP))
        self._terms = np.zeros((options, TERMS))
        left = np.array([0.0, 1.0])
        self._choose(0, left, np.zeros((0, knots, 3)))
        self._cost(0, left, [])

    def solve(self, need: Need, options: Sequence[Option], *, left: Vector) -> Choice:
        """See `ContactChoice.solve`; `iterations` counts the sets whose QPs were solved."""
        start, count, knots = perf_counter(), len(options), len(self._need)
        self._pack(need, options)
        x = np.zeros((3 * knots + 1) * count)
        forces = x[: 3 * knots * count].reshape(count, knots, 3)
        *members, cost, solved = self._choose(count, left, forces)
        if not cost < np.inf:
            status = SolveStatus.INFEASIBLE if cost == np.inf else SolveStatus.NUMERICAL_ERROR
            x = np.full(x.size, np.nan)
            return Choice((), forces, np.inf, QpSolution(x, status, solved, perf_counter() - start))
        taken = [i for i in members if i >= 0]
        for i in taken:
            x[forces.size + i] = 1.0
        solution = QpSolution(x, SolveStatus.SOLVED, solved, perf_counter() - start)
        return Choice(tuple(i for i in taken if not options[i].held), forces, cost, solution)

    def costs(
        self, need: Need, options: Sequence[Option], sets: Sequence[tuple[int, ...]], *, left: Vector
    ) -> list[tuple[float, Vector]]:
        """See `ContactChoice.costs`."""
        self._pack(need, options)
        costs, forces = self._cost(len(options), left, sets)
        return [(float(costs[s]), forces[s, : len(members)]) for s, members in enumerate(sets)]

    def _pack(self, need: Need, options: Sequence[Option]) -> None:
        """Write the question into the arrays that the kernels read."""
        pack_need(need, self._need)
        numbers: dict[int, int] = {}
        for i, option in enumerate(options):
            patch, held = option.patch, option.held
            pack_patch(patch, self._grips[i])
            self._terms[i] = option.hand, numbers.setdefault(id(patch), i), 0.0 if held else option.price, held

    def _choose(self, options: int, left: Vector, forces: Vector) -> tuple[int, int, float, int]:
        grips, terms = self._grips[:options], self._terms[:options]
        return choose_set(self._need, grips, terms, left, self._prices, self._weight, self._most, forces)

    def _cost(self, options: int, left: Vector, sets: Sequence[tuple[int, ...]]) -> tuple[Vector, Vector]:
        grips, terms, members = self._grips[:options], self._terms[:options], np.full((len(sets), 2), -1)
        for s, given in enumerate(sets):
            members[s, : len(given)] = given
        costs, forces = np.full(len(sets), np.inf), np.zeros((len(sets), 2, len(self._need), 3))
        cost_sets(self._need, grips, terms, left, self._prices, self._weight, members, costs, forces)
        return costs, forces


@kernel
def choose_set(
    packed_need: Vector,
    packed_grips: Vector,
    terms: Vector,
    left: Vector,
    prices: Vector,
    weight_of_robot: float,
    most: int,
    forces: Vector,
) -> tuple[int, int, float, int]:
    """The cheapest set as one or two options (-1: none), its cost, and how many sets were solved.

    No set and inf when none gives the need, no set and nan when a QP could not be solved. Writes the set's `forces`
    (options, knots, 3) [N] in world over zeros.
    """
    need, room = unpack_need(packed_need, weight_of_robot), empty_room()
    if not is_finite(need):
        return -1, -1, np.nan, 0
    grips, table = unpack_grips(packed_grips, prices, weight_of_robot), empty_table(len(terms), len(packed_need))
    sets = _list_sets(table, terms, grips.position, left, most)
    trial, best_forces = np.zeros((2, len(packed_need), 3)), np.zeros((2, len(packed_need), 3))
    best, best_cost, solved = -1, np.inf, 0
    while True:
        lowest = -1
        limit = best_cost - TIE
        for s in range(sets):
            if table.bound[s] < limit:
                lowest, limit = s, table.bound[s]
        if lowest < 0:
            break
        solved += 1
        table.bound[lowest] = np.inf
        i, j = table.first[lowest], table.second[lowest]
        cost = table.price[i] + (table.price[j] if j >= 0 else 0.0)
        constant = 0.0
        for k in range(len(packed_need)):
            value = solve_knot(room, need, k, grips, i, j, 0.0)
            if np.isnan(value):
                return -1, -1, np.nan, solved
            if value == np.inf:
                cost = np.inf
                cut_by_infeasibility(table, sets, room, need, k, grips)
                break
            cost += value
            constant += collect_multipliers(table, room, need, k, grips.slack_price)
            to_world(trial[0, k], room.qp.x[:3], grips.axes[i], weight_of_robot)
            if j >= 0:
                to_world(trial[1, k], room.qp.x[3:], grips.axes[j], weight_of_robot)
        if cost < np.inf:
            cut_by_optimum(table, sets, constant, need, grips)
        if cost < best_cost:
            best, best_cost = lowest, cost
            best_forces[:] = trial
    if best < 0:
        return -1, -1, np.inf, solved
    i, j = table.first[best], table.second[best]
    forces[i] = best_forces[0]
    if j >= 0:
        forces[j] = best_forces[1]
    return i, j, best_cost, solved


@kernel
def _list_sets(table: SetTable, terms: Vector, position: Vector, left: Vector, most: int) -> int:
    """Write the admissible sets and, as their bounds, their prices; how many there are."""
    options, kept, sets = len(terms), 0.0, 0
    for i in range(options):
        table.price[i] = terms[i, PRICE]
        kept += terms[i, HELD]
    for i in range(options):
        if kept == terms[i, HELD]:
            table.first[sets], table.second[sets], table.bound[sets] = i, -1, table.price[i]
            sets += 1
        for j in range(i + 1, options):
            all_held = kept == terms[i, HELD] + terms[j, HELD]
            if most >= 2 and all_held and _may_share(terms, position, left, i, j):
                table.first[sets], table.second[sets] = i, j
                table.bound[sets] = table.price[i] + table.price[j]
                sets += 1
    return sets


@kernel
def _may_share(terms: Vector, position: Vector, left: Vector, i: int, j: int) -> bool:
    """Whether two options are of different hands, on different patches, and no arm would have to cross the other."""
    if terms[i, HAND] == terms[j, HAND] or terms[i, PATCH] == terms[j, PATCH]:
        return False
    if terms[i, HELD] and terms[j, HELD]:  # they are where they are
        return True
    gap = 0.0  # from j's patch to i's, to the left
    for axis in range(2):
        gap += (position[i, axis] - position[j, axis]) * left[axis]
    if terms[i, HAND] > terms[j, HAND]:  # the left hand is the first
        gap = -gap
    return gap >= CROSSING_GAP - CROSSING_TOLERANCE


@kernel
def cost_sets(
    packed_need: Vector,
    packed_grips: Vector,
    terms: Vector,
    left: Vector,
    prices: Vector,
    weight_of_robot: float,
    members: NDArray[np.int64],
    costs: Vector,
    forces: Vector,
) -> None:
    """Costs (s,) and forces (s, 2, knots, 3) [N] of given sets `members` (s, 2), the second -1 where there is none.

    A set that is not admissible or cannot give the need keeps the cost that it has.
    """
    need, room = unpack_need(packed_need, weight_of_robot), empty_room()
    grips = unpack_grips(packed_grips, prices, weight_of_robot)
    if not is_finite(need):
        return
    for s in range(len(members)):
        i, j = members[s]
        if j >= 0 and not _may_share(terms, grips.position, left, i, j):
            continue
        cost = terms[i, PRICE] + (terms[j, PRICE] if j >= 0 else 0.0)
        for k in range(len(packed_need)):
            value = solve_knot(room, need, k, grips, i, j, 0.0)
            if not value < np.inf:
                break
            cost += value
            to_world(forces[s, 0, k], room.qp.x[:3], grips.axes[i], weight_of_robot)
            if j >= 0:
                to_world(forces[s, 1, k], room.qp.x[3:], grips.axes[j], weight_of_robot)
        else:
            costs[s] = cost
