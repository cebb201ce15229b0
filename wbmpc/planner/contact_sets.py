"""Stage 3 by enumeration: every admissible set of contacts, most of them dismissed by a bound ([M] eq. QP2)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel
from wbmpc.planner.contact_choice import CROSSING_GAP, KNOTS, Choice, Option
from wbmpc.planner.contact_cuts import SetTable, collect_multipliers, cut_by_infeasibility, cut_by_optimum
from wbmpc.planner.contact_force import Need
from wbmpc.planner.knot_qp import Grips, KnotNeeds, KnotRoom, set_axes, solve_knot, to_world
from wbmpc.planner.settings import ContactSettings
from wbmpc.qp import QpSolution
from wbmpc.signals import GRAVITY, SolveStatus, Vector

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
        self._settings, self._mass, self._knots = settings, mass, knots
        self._needs, self._grips = KnotNeeds.room_for(knots), Grips.room_for(options, settings)
        self._room, self._table = KnotRoom.empty(), SetTable.of_size(options, knots)
        self._prices, self._across = np.zeros(options), np.zeros(options)  # [cost], [m] to the left
        self._hand, self._patch = np.zeros(options, dtype=np.int64), np.zeros(options, dtype=np.int64)
        self._held = np.zeros(options, dtype=np.bool_)
        self._forces, self._trial = np.zeros((2, knots, 3)), np.zeros((2, knots, 3))
        self._choose(0)
        self._cost([])

    def solve(self, need: Need, options: Sequence[Option], *, left: Vector) -> Choice:
        """See `ContactChoice.solve`; `iterations` counts the sets whose QPs were solved."""
        start, count = perf_counter(), len(options)
        self._take_over(need, options, left)
        forces, binaries = np.zeros((count, self._knots, 3)), np.zeros(count)
        best, cost, solved = self._choose(count) if self._needs.finite() else (-1, np.nan, 0)
        if best < 0:
            status = SolveStatus.INFEASIBLE if cost == np.inf else SolveStatus.NUMERICAL_ERROR
            x = np.full(forces.size + count, np.nan)
            return Choice((), forces, np.inf, QpSolution(x, status, solved, perf_counter() - start))
        taken = [int(i) for i in (self._table.first[best], self._table.second[best]) if i >= 0]
        forces[taken] = self._mass * GRAVITY * self._forces[: len(taken)]
        binaries[taken] = 1.0
        x = np.concatenate([forces.ravel(), binaries])
        solution = QpSolution(x, SolveStatus.SOLVED, solved, perf_counter() - start)
        return Choice(tuple(i for i in taken if not options[i].held), forces, cost, solution)

    def costs(
        self, need: Need, options: Sequence[Option], sets: Sequence[tuple[int, ...]], *, left: Vector
    ) -> list[tuple[float, Vector]]:
        """See `ContactChoice.costs`."""
        self._take_over(need, options, left)
        if not self._needs.finite():
            return [(np.inf, np.zeros((len(members), self._knots, 3))) for members in sets]
        costs, forces = self._cost(sets)
        forces *= self._mass * GRAVITY
        return [(float(costs[s]), forces[s, : len(members)]) for s, members in enumerate(sets)]

    def _take_over(self, need: Need, options: Sequence[Option], left: Vector) -> None:
        """Copy the problem into the kernels' arrays."""
        self._needs.fill(need, mass=self._mass)
        self._grips.fill([option.patch for option in options], mass=self._mass)
        numbers: dict[int, int] = {}
        for i, option in enumerate(options):
            self._hand[i] = option.hand
            self._held[i] = option.held
            self._prices[i] = 0.0 if option.held else option.price
            self._patch[i] = numbers.setdefault(id(option.patch), i)
        np.dot(self._grips.position[:, :2], left, out=self._across)

    def _choose(self, options: int) -> tuple[int, float, int]:
        sets = list_sets(
            self._table, self._hand, self._patch, self._across, self._held, self._prices,
            options, self._settings.most_contacts,
        )  # fmt: skip
        return choose_set(
            self._room, self._table, sets, self._needs, self._grips, self._prices, options, self._forces, self._trial
        )

    def _cost(self, sets: Sequence[tuple[int, ...]]) -> tuple[Vector, Vector]:
        members = np.full((len(sets), 2), -1)
        for s, given in enumerate(sets):
            members[s, : len(given)] = given
        costs, forces = np.full(len(sets), np.inf), np.zeros((len(sets), 2, self._knots, 3))
        cost_sets(
            self._room, members, self._needs, self._grips, self._prices, self._hand, self._patch, self._across,
            costs, forces,
        )  # fmt: skip
        return costs, forces


@kernel
def list_sets(
    table: SetTable,
    hand: NDArray[np.int64],
    patch: NDArray[np.int64],
    across: Vector,
    held: NDArray[np.bool_],
    prices: Vector,
    options: int,
    most: int,
) -> int:
    """Write the admissible sets and, as their bounds, their prices; how many there are."""
    kept = 0
    for i in range(options):
        kept += held[i]
    sets = 0
    for i in range(options):
        if kept - held[i] == 0:
            table.first[sets], table.second[sets], table.bound[sets] = i, -1, prices[i]
            sets += 1
        for j in range(i + 1, options):
            if most >= 2 and kept - held[i] - held[j] == 0 and _may_share(hand, patch, across, i, j):
                table.first[sets], table.second[sets], table.bound[sets] = i, j, prices[i] + prices[j]
                sets += 1
    return sets


@kernel
def _may_share(hand: NDArray[np.int64], patch: NDArray[np.int64], across: Vector, i: int, j: int) -> bool:
    """Whether two options are of different hands, on different patches, and arms would not cross."""
    if hand[i] == hand[j] or patch[i] == patch[j]:
        return False
    gap = across[i] - across[j] if hand[i] < hand[j] else across[j] - across[i]  # the left hand's first
    return gap >= CROSSING_GAP - CROSSING_TOLERANCE


@kernel
def choose_set(
    room: KnotRoom,
    table: SetTable,
    sets: int,
    need: KnotNeeds,
    grips: Grips,
    prices: Vector,
    options: int,
    forces: Vector,
    trial: Vector,
) -> tuple[int, float, int]:
    """The cheapest set, its cost and how many were solved; -1 and inf when none gives the need, -1 and nan on failure.

    Writes the `forces` (2, knots, 3) of its contacts, in world, in the force unit of `grips`.
    """
    best, best_cost, solved = -1, np.inf, 0
    for i in range(options):
        set_axes(grips.axes[i])
    while True:
        lowest = -1
        limit = best_cost - TIE
        for s in range(sets):
            if table.bound[s] < limit:
                lowest, limit = s, table.bound[s]
        if lowest < 0:
            return best, best_cost, solved
        solved += 1
        table.bound[lowest] = np.inf
        i, j = table.first[lowest], table.second[lowest]
        cost = prices[i] + (prices[j] if j >= 0 else 0.0)
        constant = 0.0
        for k in range(len(need.height)):
            value = solve_knot(room, need, k, grips, i, j, grips.cap, 0.0)
            if not value < np.inf:
                cost = value
                break
            cost += value
            constant += collect_multipliers(table, room, need, k, grips.slack_price)
            to_world(trial[0, k], room.qp.x[:3], grips.axes[i])
            if j >= 0:
                to_world(trial[1, k], room.qp.x[3:], grips.axes[j])
        if np.isnan(cost):
            return -1, np.nan, solved
        if cost == np.inf:
            cut_by_infeasibility(table, sets, room, need, k, grips, options)
            continue
        cut_by_optimum(table, sets, constant, need, grips, prices, options)
        if cost < best_cost:
            best, best_cost = lowest, cost
            forces[:] = trial


@kernel
def cost_sets(
    room: KnotRoom,
    members: NDArray[np.int64],
    need: KnotNeeds,
    grips: Grips,
    prices: Vector,
    hand: NDArray[np.int64],
    patch: NDArray[np.int64],
    across: Vector,
    costs: Vector,
    forces: Vector,
) -> None:
    """Costs (s,) and forces (s, 2, knots, 3) of given sets `members` (s, 2), the second -1 where there is none.

    A set that is not admissible or cannot give the need costs inf.
    """
    for i in range(len(hand)):
        set_axes(grips.axes[i])
    for s in range(len(members)):
        i, j = members[s]
        if j >= 0 and not _may_share(hand, patch, across, i, j):
            continue
        cost = prices[i] + (prices[j] if j >= 0 else 0.0)
        for k in range(len(need.height)):
            value = solve_knot(room, need, k, grips, i, j, grips.cap, 0.0)
            cost = cost + value if value < np.inf else np.inf
            if cost == np.inf:
                break
            to_world(forces[s, 0, k], room.qp.x[:3], grips.axes[i])
            if j >= 0:
                to_world(forces[s, 1, k], room.qp.x[3:], grips.axes[j])
        costs[s] = cost
