"""Stage 3's choice of one or two contacts against enumeration of every admissible set with another solver."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from contact_case import BEHIND, KNOTS, MASS, POLYGON, SETTINGS, TABLE, UP, WALL, lean, patch, pressure
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from reference_qp import InfeasibleReference, ReferenceQp

from wbmpc.planner.contact_choice import CROSSING_GAP, Choice, Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contact_stage import ENUMERATION, ChoosesContacts, make_contact_choice
from wbmpc.rotations import contact_frame
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SolveStatus, Vector

SLOTS = 6
LEFT, RIGHT = 0, 1
LEFTWARDS = np.array([0.0, 1.0])


@cache
def workspace(backend: str, most: int) -> ChoosesContacts:
    settings = SETTINGS.model_copy(update={"most_contacts": most})
    return make_contact_choice(backend, SLOTS, settings, mass=MASS)


def choose(need: Need, options: list[Option], *, backend: str = ENUMERATION, most: int = 2) -> Choice:
    return workspace(backend, most).solve(need, options, left=LEFTWARDS)


def forces_of(need: Need, patches: list[PatchPose]) -> tuple[float, Vector] | None:
    """Cost and forces (k, KNOTS, 3) of contacts that are all taken, from a second writing; None when infeasible."""
    qp, unit = ReferenceQp(), (MASS * GRAVITY) ** 2
    for k in range(len(need.zmp)):
        w, Z, wanted = need.weight[k], need.zmp[k], need.zmp[k] + need.delta_z[k]
        polygon = need.polygons[k]
        real = np.isfinite(polygon.offsets)
        A, b = polygon.normals[real], polygon.offsets[real]
        shift, inside = [], []
        for candidate in patches:
            f, p = qp.variables(3), candidate.position
            tangent_1, tangent_2, normal = contact_frame(candidate.normal).T
            mu = candidate.friction / np.sqrt(2.0)
            qp.cost([(f, normal[None])], 0.0, SETTINGS.force_cost)
            qp.cost([(f, np.array([tangent_1, tangent_2]))], np.zeros(2), SETTINGS.tangent_cost)
            cone = np.array([s * t - mu * normal for t in (tangent_1, tangent_2) for s in (1, -1)] + [normal])
            qp.bound([(f, cone)], np.full(5, -np.inf), np.array([0, 0, 0, 0, candidate.force_cap]))
            # the feet's vertical force w − Σ f_z times their pressure: moments about the world's origin [N m]
            moment = np.column_stack([p[2] * e[:2] - p[:2] * e[2] for e in np.eye(3)])
            shift.append((f, moment + np.outer(wanted, UP)))
            inside.append((f, A @ moment + np.outer(b, UP)))
        qp.cost(shift, w * (wanted - Z), SETTINGS.shift_slack_cost)
        qp.bound(inside, np.full(len(b), -np.inf), w * (b - A @ Z))
    try:
        x, cost = qp.solve()
    except InfeasibleReference:
        return None
    return cost / unit, x.reshape(len(need.zmp), len(patches), 3).swapaxes(0, 1)  # scaled to newtons: near one


def admissible(options: list[Option], most: int) -> Iterator[tuple[int, ...]]:
    """Every set of options that keeps the held ones, gives no hand or patch two partners, and crosses no arms."""
    held = {i for i, option in enumerate(options) if option.held}
    for size in range(1, most + 1):
        for members in combinations(range(len(options)), size):
            hands = {options[i].hand for i in members}
            patches = {id(options[i].patch) for i in members}
            if (
                held <= set(members)
                and len(hands) == len(patches) == size
                and not crossed([options[i] for i in members])
            ):
                yield members


def crossed(options: list[Option]) -> bool:
    """Whether the left hand's contact is not clearly to the left of the right hand's."""
    if len(options) < 2:
        return False
    left, right = sorted(options, key=lambda option: option.hand)
    return float(left.patch.position[1] - right.patch.position[1]) < CROSSING_GAP


def enumerated(need: Need, options: list[Option], most: int) -> dict[tuple[int, ...], tuple[float, Vector]]:
    """Cost, prices included, and forces of every admissible set that can give the need."""
    out = {}
    for members in admissible(options, most):
        answer = forces_of(need, [options[i].patch for i in members])
        if answer is not None:
            prices = sum(options[i].price for i in members if not options[i].held)
            out[members] = (answer[0] + prices, answer[1])
    return out


def random_options(seed: int, *, weak: bool) -> list[Option]:
    """Up to SLOTS options on tables and walls, some patches offered to both hands, perhaps one held."""
    rng = np.random.default_rng(seed)
    options: list[Option] = []
    while len(options) < rng.integers(1, SLOTS + 1):
        normal = rng.normal(size=3) * [0.4, 0.4, 0.0] + UP
        if rng.random() < 0.3:
            normal = np.array([0.0, rng.choice([-1.0, 1.0]), 0.0])  # a wall
        position = rng.uniform([-0.3, -0.3, 0.0], [0.4, 0.3, 0.3])
        cap = rng.uniform(1, 6) if weak else rng.uniform(3, 25)
        place = patch(position, normal / np.linalg.norm(normal), friction=rng.uniform(0.3, 0.9), cap=cap)
        hands = [LEFT, RIGHT] if rng.random() < 0.5 else [int(rng.integers(2))]
        options += [Option(place, hand, float(rng.uniform(0.0, 0.3))) for hand in hands]
    options = options[:SLOTS]
    if rng.random() < 0.4:
        chosen = int(rng.integers(len(options)))
        options[chosen] = Option(options[chosen].patch, options[chosen].hand, options[chosen].price, held=True)
    return options


INSTANCES = {
    "seed": st.integers(0, 2**32 - 1),
    "weak": st.booleans(),  # caps so small that one is seldom enough
    "most": st.integers(1, 2),
    "beyond": st.floats(0.005, 0.05),  # stage 3 is not asked about less
    "sideways": st.floats(-0.05, 0.05),
}


# relative cost, forces [N], forces of options not taken [N]; daqp's tolerance is on rows of newtons
ACCURACY = {ENUMERATION: (1e-8, 1e-6, 0.0), "daqp": (1e-3, 0.02, 1e-3)}


@pytest.mark.parametrize("backend", ACCURACY)
@settings(max_examples=80, deadline=None)
@given(**INSTANCES)
def test_choice_is_the_best_of_all_admissible_sets(
    backend: str, seed: int, weak: bool, most: int, beyond: float, sideways: float
) -> None:
    """[M] eq. QP2 with ΣH up to two: exact; no set that helps is an answer, not an error."""
    options, need = random_options(seed, weak=weak), lean(beyond, sideways=sideways)
    answer = choose(need, options, most=most, backend=backend)
    tried = enumerated(need, options, most)
    if not tried:
        assert answer.winners == ()
        assert answer.objective == np.inf
        assert answer.solution.status != SolveStatus.SOLVED  # daqp may call a nearly feasible problem ill-conditioned
        assert not answer.forces.any()
        return
    held = tuple(i for i, option in enumerate(options) if option.held)
    taken = tuple(sorted((*answer.winners, *held)))
    best = min(cost for cost, _ in tried.values())
    assert tried[taken][0] == pytest.approx(best, rel=1e-4, abs=1e-5)  # a tie may go either way
    relative, newtons, untaken = ACCURACY[backend]
    assert answer.objective == pytest.approx(best, rel=relative, abs=relative)
    assert_allclose(answer.forces[list(taken)], tried[taken][1], atol=newtons)
    assert_allclose(np.delete(answer.forces, taken, axis=0), 0.0, atol=untaken)


def test_the_random_instances_ask_for_none_one_and_two() -> None:
    """The property test above would mean little if one answer were always the same."""
    sizes = [len(choose(lean(0.03), random_options(seed, weak=True)).winners) for seed in range(120)]
    assert min(sizes.count(size) for size in (0, 1, 2)) >= 5


def test_all_backends_agree() -> None:
    """Enumeration, daqp's branch and bound, HiGHS' outer approximation; the last may say that it could not, rarely."""
    gave_up = 0
    for seed in range(24):
        options, need = random_options(seed, weak=seed % 2 == 0), lean(0.002 * (seed % 16))
        exact, *others = (choose(need, options, backend=backend) for backend in (ENUMERATION, "daqp", "highs"))
        for other in others:
            if other.solution.status == SolveStatus.NUMERICAL_ERROR:
                gave_up += 1
                continue
            assert other.solution.status == exact.solution.status
            if exact.solution.status == SolveStatus.SOLVED:
                assert other.objective == pytest.approx(exact.objective, rel=1e-3, abs=1e-4)
                if exact.winners == other.winners:
                    assert_allclose(other.forces, exact.forces, atol=0.1)
    assert gave_up <= 1


def helped(answer: Choice, need: Need, options: list[Option]) -> None:
    """All forces lie in the true friction cone, under the cap, and the feet's pressure in its polygon."""
    for option, forces in zip(options, answer.forces, strict=True):
        for force in forces:
            normal = float(force @ option.patch.normal)
            tangential = np.linalg.norm(force - normal * option.patch.normal)
            assert normal >= -1e-6
            assert tangential <= option.patch.friction * normal + 1e-5
            assert normal <= option.patch.force_cap + 1e-5
    for k in range(KNOTS):
        points = [option.patch.position for option in options]
        assert POLYGON.excess(pressure(need, k, points, answer.forces[:, k])) < 1e-5


@settings(max_examples=60, deadline=None)
@given(**INSTANCES)
def test_the_forces_are_such_as_the_contacts_can_give(
    seed: int, weak: bool, most: int, beyond: float, sideways: float
) -> None:
    options, need = random_options(seed, weak=weak), lean(beyond, sideways=sideways)
    answer = choose(need, options, most=most)
    if answer.solution.status == SolveStatus.SOLVED:
        helped(answer, need, options)


# one, two or none


LEAN = lean(0.04)  # moments about FRONT: 4 cm at 22 cm take m g · 0.05 / 0.23 ≈ 7.3 N at the second knot


def pair(cap: float, price: float = 0.1) -> list[Option]:
    """Mirrored patches of the same strength, one for each hand."""
    return [Option(patch([0.27, y, 0.20], cap=cap), hand, price) for y, hand in ((0.11, LEFT), (-0.11, RIGHT))]


def test_two_are_taken_when_one_cap_is_too_small() -> None:
    options = pair(5.0)
    answer = choose(LEAN, options)
    assert answer.winners == (0, 1)
    helped(answer, LEAN, options)
    assert_allclose(answer.forces[0] * [1, -1, 1], answer.forces[1], atol=1e-4)  # in equal parts


def test_one_is_taken_when_one_is_enough() -> None:
    assert len(choose(LEAN, pair(20.0)).winners) == 1


def test_a_second_contact_for_nothing_shares_the_load() -> None:
    """No price, no reason to leave it all to one hand: the second contact costs its w_i and nothing else."""
    assert choose(LEAN, pair(20.0, price=0.0)).winners == (0, 1)


def test_none_is_taken_when_nothing_helps() -> None:
    assert choose(LEAN, pair(2.0)).winners == ()  # even both together are too weak
    assert choose(LEAN, pair(5.0), most=1).winners == ()


def test_one_patch_bears_one_hand() -> None:
    place = patch([0.27, 0.0, 0.20], cap=5.0)
    assert choose(LEAN, [Option(place, LEFT), Option(place, RIGHT)]).winners == ()


def test_a_held_contact_is_joined_when_it_does_not_do() -> None:
    weak, other = pair(5.0)
    held = Option(weak.patch, weak.hand, held=True)
    answer = choose(LEAN, [held, other])
    assert answer.winners == (1,)
    helped(answer, LEAN, [held, other])
    assert choose(lean(0.01), [held, other]).winners == ()  # it does
    assert choose(lean(0.01), [held, other]).objective < np.inf


# which one


def test_a_patch_on_the_wrong_side_loses_at_any_price() -> None:
    assert choose(lean(0.03), [Option(BEHIND, RIGHT), Option(TABLE, RIGHT, 10.0)]).winners == (1,)
    assert choose(lean(0.03), [Option(BEHIND, RIGHT)]).winners == ()


def test_a_wall_carries_no_weight() -> None:
    assert choose(LEAN, [Option(WALL, RIGHT), Option(TABLE, RIGHT, 1.0)]).winners == (1,)


def test_a_weak_patch_loses_to_a_strong_one() -> None:
    weak = Option(patch(TABLE.position, cap=5.0), RIGHT)
    assert choose(LEAN, [weak, Option(TABLE, RIGHT, 1.0)]).winners == (1,)
    assert choose(LEAN, [weak]).winners == ()


@pytest.mark.parametrize("cheap", [0, 1])
def test_the_price_of_distance_decides_between_equals(cheap: int) -> None:
    options = [Option(patch(TABLE.position), RIGHT, 0.05 if i == cheap else 0.1) for i in range(2)]
    assert choose(lean(0.03), options).winners == (cheap,)


def test_arms_do_not_cross() -> None:
    left, right = pair(5.0)
    crossing = [Option(left.patch, RIGHT), Option(right.patch, LEFT)]
    assert choose(LEAN, crossing).winners == ()
    assert choose(LEAN, [*crossing, left, right]).winners == (2, 3)  # dearer, but possible
    turned = workspace(ENUMERATION, 2).solve(LEAN, crossing, left=-LEFTWARDS)  # a robot that faces the other way
    assert turned.winners == (0, 1)


@pytest.mark.parametrize("backend", [ENUMERATION, "daqp"])
def test_hands_that_are_there_are_not_lost_for_being_near(backend: str) -> None:
    """Palms land beside their patches' centres: a pair that is held may be nearer than one that is to be chosen."""
    near = [Option(patch([0.27, y, 0.20], cap=5.0), hand) for y, hand in ((0.02, LEFT), (-0.02, RIGHT))]
    held = [Option(option.patch, option.hand, held=True) for option in near]
    assert choose(LEAN, near, backend=backend).objective == np.inf
    assert choose(LEAN, [held[0], near[1]], backend=backend).objective == np.inf
    assert choose(LEAN, held, backend=backend).objective < np.inf
    stage = workspace(backend, 2)
    costs = [stage.costs(LEAN, options, [(0, 1)], left=LEFTWARDS)[0][0] for options in (near, held)]
    assert costs[0] == np.inf
    assert costs[1] < np.inf


@pytest.mark.parametrize("backend", [ENUMERATION, "daqp"])
def test_a_solve_forgets_the_one_before(backend: str) -> None:
    used, fresh = (make_contact_choice(backend, SLOTS, SETTINGS, mass=MASS) for _ in range(2))
    before = [Option(TABLE, LEFT, held=True), Option(WALL, RIGHT, 0.3), Option(TABLE, RIGHT)]
    used.solve(lean(0.05), before, left=LEFTWARDS)
    one, other = (
        w.solve(lean(0.03), [Option(BEHIND, LEFT), Option(TABLE, LEFT)], left=LEFTWARDS) for w in (used, fresh)
    )
    assert one.winners == (1,)
    assert_allclose(one.forces, other.forces, atol=1e-6)


def test_a_need_that_is_no_number_is_a_status() -> None:
    for backend in (ENUMERATION, "daqp", "highs"):
        need = lean(0.02)
        need.delta_z[1, 0] = np.nan
        answer = choose(need, [Option(TABLE, RIGHT)], backend=backend)
        assert answer.solution.status == SolveStatus.NUMERICAL_ERROR
        assert answer.winners == ()
        assert answer.objective == np.inf


def test_nothing_to_choose_from_is_an_answer() -> None:
    assert choose(LEAN, []).solution.status == SolveStatus.INFEASIBLE


def test_what_cannot_be_held_at_once_is_infeasible() -> None:
    left, right = (Option(option.patch, option.hand, held=True) for option in pair(20.0))
    for backend in (ENUMERATION, "daqp"):
        assert choose(LEAN, [left, right], backend=backend).solution.status == SolveStatus.SOLVED
        assert choose(LEAN, [left, right], backend=backend, most=1).objective == np.inf
        assert choose(LEAN, [left, Option(right.patch, LEFT, held=True)], backend=backend).objective == np.inf
