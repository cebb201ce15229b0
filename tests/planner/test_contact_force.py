"""Stage 3 against enumeration of H with another solver, and its forces against Newton-Euler and the true cone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from newton_euler import centre_of_pressure
from numpy.testing import assert_allclose
from reference_qp import InfeasibleReference, ReferenceQp
from robots import standing_polygon

from wbmpc.planner.contact_force import Choice, ContactChoice, ContactForce, Need
from wbmpc.planner.settings import ContactSettings
from wbmpc.rotations import contact_frame
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SolveStatus, Vector

MASS, HEIGHT = 3.43, 0.25  # [kg], [m] CoM
SETTINGS = ContactSettings()
POLYGON = standing_polygon(margin=0.018)
FRONT = float(POLYGON.offsets[np.argmax(POLYGON.normals[:, 0])])  # [m] foremost place of the feet's pressure
SLOTS, KNOTS = 4, ContactChoice.KNOTS
UP = np.array([0.0, 0.0, 1.0])


def patch(position: Vector, normal: Vector = UP, *, friction: float = 0.5, cap: float = 20.0) -> PatchPose:
    return PatchPose("patch", "object", np.asarray(position, dtype=float), np.asarray(normal), friction, cap)


def lean(beyond: float, *, sideways: float = 0.0, knots: int = KNOTS, growth: float = 0.01) -> Need:
    """At rest with the CoM `beyond` the foremost pressure, a little more with every knot: ΔZ brings it back."""
    zmp = np.array([[FRONT + beyond + growth * k, sideways] for k in range(knots)])
    return Need(
        delta_z=np.column_stack([FRONT - zmp[:, 0], np.zeros(knots)]),
        zmp=zmp,
        weight=np.full(knots, MASS * GRAVITY),
        polygons=(POLYGON,) * knots,
        phantom=np.zeros((knots, 2)),
    )


def pressure(need: Need, knot: int, points: list[Vector], forces: Vector) -> Vector:
    """Centre of pressure (2,) of the feet under hand forces (k, 3); the robot is at rest with its CoM over Z_nc."""
    com = np.array([*need.zmp[knot], HEIGHT])
    return centre_of_pressure(
        mass=MASS, com=com, acceleration=np.zeros(3), plane_height=0.0, point=np.array(points), force=forces
    )


@cache
def choice(backend: str = "daqp", slots: int = SLOTS) -> ContactChoice:
    return ContactChoice(slots, SETTINGS, mass=MASS, backend=backend)


def alone(need: Need, candidate: PatchPose) -> tuple[float, Vector] | None:
    """Cost and forces (KNOTS, 3) of one candidate with H_i = 1, from a second writing; None when infeasible."""
    qp, unit = ReferenceQp(), (MASS * GRAVITY) ** 2
    tangent_1, tangent_2, normal = contact_frame(candidate.normal).T
    mu = candidate.friction / np.sqrt(2.0)
    p = candidate.position
    for k in range(len(need.zmp)):
        f = qp.variables(3)
        qp.cost([(f, normal[None])], 0.0, SETTINGS.force_cost)
        qp.cost([(f, np.array([tangent_1, tangent_2]))], np.zeros(2), SETTINGS.tangent_cost)
        w, Z, wanted = need.weight[k], need.zmp[k], need.zmp[k] + need.delta_z[k]

        def moved(force: Vector, w: float = w, Z: Vector = Z) -> Vector:
            """The feet's vertical force times the pressure [N m]: moments about the world's origin."""
            return w * Z + p[2] * force[:2] - p[:2] * force[2]

        linear = np.column_stack([moved(e) - moved(np.zeros(3)) for e in np.eye(3)])
        # pressure · (w − f_z) against wanted · (w − f_z), and against the polygon's edges
        G = linear + np.outer(wanted, UP)
        qp.cost([(f, G)], w * wanted - moved(np.zeros(3)), SETTINGS.shift_slack_cost)
        polygon = need.polygons[k]
        real = np.isfinite(polygon.offsets)
        A, b = polygon.normals[real], polygon.offsets[real]
        P = A @ linear + np.outer(b, UP)
        qp.bound([(f, P)], np.full(len(b), -np.inf), b * w - A @ moved(np.zeros(3)))
        cone = np.array([s * t - mu * normal for t in (tangent_1, tangent_2) for s in (1, -1)] + [normal])
        qp.bound([(f, cone)], np.full(5, -np.inf), np.array([0, 0, 0, 0, candidate.force_cap]))
    try:
        x, cost = qp.solve()
    except InfeasibleReference:
        return None
    return cost / unit, x.reshape(-1, 3)  # scaled to newtons: the reference's solver wants numbers near one


def random_patches(seed: int) -> list[PatchPose]:
    rng = np.random.default_rng(seed)
    patches = []
    for _ in range(int(rng.integers(1, SLOTS + 1))):
        normal = rng.normal(size=3) * [0.4, 0.4, 0.0] + UP
        if rng.random() < 0.3:
            normal = np.array([0.0, rng.choice([-1.0, 1.0]), 0.0])  # a wall
        position = rng.uniform([-0.3, -0.3, 0.0], [0.4, 0.3, 0.3])
        unit = normal / np.linalg.norm(normal)
        patches.append(patch(position, unit, friction=rng.uniform(0.3, 0.9), cap=rng.uniform(3, 25)))
    return patches


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), beyond=st.floats(0.0, 0.05), sideways=st.floats(-0.05, 0.05))
def test_choice_is_the_best_of_all_candidates_tried_one_by_one(seed: int, beyond: float, sideways: float) -> None:
    """[M] eq. QP2: exact against enumeration of H; no candidate that helps is an answer, not an error."""
    patches, need = random_patches(seed), lean(beyond, sideways=sideways)
    weights = np.random.default_rng(seed).uniform(0.0, 0.3, len(patches))
    answer = choice().solve(need, patches, weights)
    tried = [alone(need, candidate) for candidate in patches]
    costs = np.array([np.inf if one is None else one[0] for one in tried]) + weights
    if not np.isfinite(costs).any():
        assert answer.winner == -1
        assert answer.objective == np.inf
        assert answer.solution.status == SolveStatus.INFEASIBLE
        assert not answer.forces.any()
        return
    assert answer.winner >= 0
    assert costs[answer.winner] == pytest.approx(costs.min(), rel=1e-4, abs=1e-5)  # a tie may go either way
    best = tried[answer.winner]
    assert best is not None
    assert_allclose(answer.forces[answer.winner], best[1], atol=0.02)  # [N]
    losers = np.delete(answer.forces, answer.winner, axis=0)
    assert_allclose(losers, 0.0, atol=1e-3)


def test_both_backends_agree() -> None:
    """daqp's branch and bound and HiGHS' outer approximation; the latter may say that it could not, rarely."""
    gave_up = 0
    for seed in range(24):
        patches, need = random_patches(seed), lean(0.002 * (seed % 16))
        weights = 0.05 * np.arange(len(patches))
        one, other = (choice(backend).solve(need, patches, weights) for backend in ("daqp", "highs"))
        if other.solution.status == SolveStatus.NUMERICAL_ERROR:
            gave_up += 1
            continue
        assert one.solution.status == other.solution.status
        if one.winner >= 0:
            assert other.objective == pytest.approx(one.objective, rel=1e-2, abs=1e-3)
            if one.winner == other.winner:
                assert_allclose(other.forces[one.winner], one.forces[one.winner], atol=0.1)
    assert gave_up <= 1


def helped(answer: Choice, need: Need, patches: list[PatchPose]) -> None:
    """The winner's forces lie in the true friction cone, under the cap, and the feet's pressure in its polygon."""
    winner = patches[answer.winner]
    for k, force in enumerate(answer.forces[answer.winner]):
        normal = float(force @ winner.normal)
        tangential = np.linalg.norm(force - normal * winner.normal)
        assert normal >= -1e-6
        assert tangential <= winner.friction * normal + 1e-5
        assert normal <= winner.force_cap + 1e-5
        assert POLYGON.excess(pressure(need, k, [winner.position], force[None])) < 1e-5


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), beyond=st.floats(0.0, 0.05), sideways=st.floats(-0.05, 0.05))
def test_the_winners_force_is_one_that_the_contact_can_give(seed: int, beyond: float, sideways: float) -> None:
    patches, need = random_patches(seed), lean(beyond, sideways=sideways)
    answer = choice().solve(need, patches, np.zeros(len(patches)))
    if answer.winner >= 0:
        helped(answer, need, patches)


TABLE = patch([0.27, -0.11, 0.20])
BEHIND = patch([-0.25, -0.11, 0.20])
WALL = patch([0.25, 0.28, 0.25], np.array([0.0, -1.0, 0.0]))


def test_a_patch_on_the_wrong_side_loses_at_any_price() -> None:
    need = lean(0.03)
    assert choice().solve(need, [BEHIND, TABLE], np.array([0.0, 10.0])).winner == 1
    assert choice().solve(need, [BEHIND], np.zeros(1)).winner == -1


def test_a_wall_carries_no_weight() -> None:
    need = lean(0.04)
    assert choice().solve(need, [WALL, TABLE], np.array([0.0, 1.0])).winner == 1


def test_a_weak_patch_loses_to_a_strong_one() -> None:
    """Moments about FRONT: holding 4 cm of lean at 22 cm needs m g · 0.05 / 0.23 ≈ 7.3 N at the second knot."""
    weak = patch(TABLE.position, cap=5.0)
    assert choice().solve(lean(0.04), [weak, TABLE], np.array([0.0, 1.0])).winner == 1
    assert choice().solve(lean(0.04), [weak], np.zeros(1)).winner == -1


def test_the_price_of_distance_decides_between_equals() -> None:
    need, twin = lean(0.03), patch(TABLE.position)
    assert choice().solve(need, [TABLE, twin], np.array([0.1, 0.05])).winner == 1
    assert choice().solve(need, [TABLE, twin], np.array([0.05, 0.1])).winner == 0


def test_a_solve_forgets_the_one_before() -> None:
    workspace = ContactChoice(SLOTS, SETTINGS, mass=MASS, backend="daqp")
    workspace.solve(lean(0.05), [TABLE, WALL, BEHIND, TABLE], np.zeros(4))
    again = workspace.solve(lean(0.03), [BEHIND, TABLE], np.zeros(2))
    assert again.winner == 1
    assert_allclose(again.forces, choice().solve(lean(0.03), [BEHIND, TABLE], np.zeros(2)).forces, atol=1e-6)


# The forces of the chosen contacts at every knot


N = 16


def contact_force(contacts: int = 1, **changes: float) -> ContactForce:
    return ContactForce(N, SETTINGS.model_copy(update=changes), mass=MASS, contacts=contacts, backend="daqp")


@settings(max_examples=20, deadline=None)
@given(beyond=st.floats(0.0, 0.03), x=st.floats(0.2, 0.35), z=st.floats(0.05, 0.3), friction=st.floats(0.3, 0.8))
def test_forces_at_all_knots_realise_the_shift(beyond: float, x: float, z: float, friction: float) -> None:
    """Shifts that a force in the cone can give are given exactly (dear slack), at every knot, under Newton-Euler."""
    table = patch([x, 0.0, z], friction=friction)  # straight ahead: a vertical force shifts along x alone
    need = lean(beyond, knots=N, growth=0.001)
    forces, solution = contact_force(shift_slack_cost=1e5).solve(need, [table], np.full((1, N), 40.0))
    assert solution.status == SolveStatus.SOLVED
    assert forces is not None
    for k in range(N):
        moved = pressure(need, k, [table.position], forces[0, k : k + 1])
        assert_allclose(moved, need.zmp[k] + need.delta_z[k], atol=2e-5)


@settings(max_examples=20, deadline=None)
@given(beyond=st.floats(0.0, 0.03), y=st.floats(-0.15, 0.15))
def test_default_slack_leaves_the_pressure_in_the_polygon(beyond: float, y: float) -> None:
    """With the shipped prices the shift is a wish, the polygon the bound; the cone is the true one."""
    table, need = patch([0.27, y, 0.20]), lean(beyond, knots=N, growth=0.001)
    forces, _ = contact_force().solve(need, [table], np.full((1, N), 20.0))
    assert forces is not None
    for k in range(N):
        force = forces[0, k]
        assert POLYGON.excess(pressure(need, k, [table.position], force[None])) < 1e-3
        assert np.linalg.norm(force[:2]) <= table.friction * force[2] + 1e-6
        assert force[2] <= 20.0 + 1e-6


def test_caps_bind_knot_by_knot() -> None:
    need, caps = lean(0.03, knots=N, growth=0.0), np.linspace(0.0, 15.0, N)[None]
    forces, _ = contact_force().solve(need, [TABLE], caps)
    assert forces is not None
    vertical = forces[0, :, 2]
    assert (vertical <= caps[0] + 1e-6).all()
    assert not forces[0, 0].any()  # a cap of zero: not there yet
    assert vertical[1:3] == pytest.approx(caps[0, 1:3], abs=1e-4)  # not enough yet: all there is
    assert vertical[-1] < 14.0  # enough: no more than needed


def test_a_slot_without_a_patch_gives_nothing() -> None:
    forces, _ = contact_force(contacts=2).solve(lean(0.02, knots=N), [None, TABLE], np.full((2, N), 20.0))
    assert forces is not None
    assert not forces[0].any()
    assert (forces[1, :, 2] > 1.0).all()


def test_two_hands_share_the_load() -> None:
    """Mirrored patches, a need straight ahead: mirrored forces whose common effect is the wanted shift."""
    left, right = patch([0.27, 0.1, 0.2]), patch([0.27, -0.1, 0.2])
    need = lean(0.03, knots=N, growth=0.0)
    forces, _ = contact_force(contacts=2, shift_slack_cost=1e4).solve(need, [left, right], np.full((2, N), 20.0))
    assert forces is not None
    assert_allclose(forces[0] * [1, -1, 1], forces[1], atol=1e-4)
    moved = pressure(need, 5, [left.position, right.position], forces[:, 5])
    assert_allclose(moved, need.zmp[5] + need.delta_z[5], atol=2e-4)
    single, _ = contact_force(shift_slack_cost=1e4).solve(need, [patch([0.27, 0.0, 0.2])], np.full((1, N), 20.0))
    assert single is not None
    assert forces[0, 5, 2] == pytest.approx(single[0, 5, 2] / 2, rel=0.05)


def test_choice_and_forces_are_the_same_problem() -> None:
    """At fixed H both write the same cost: same forces where the polygon does not bind."""
    need = lean(0.02)
    chosen = choice().solve(need, [TABLE], np.zeros(1))
    given_all = ContactForce(KNOTS, SETTINGS, mass=MASS, contacts=1, backend="daqp")
    forces, _ = given_all.solve(need, [TABLE], np.full((1, KNOTS), TABLE.force_cap))
    assert forces is not None
    assert_allclose(forces[0], chosen.forces[0], atol=0.05)


def test_a_need_that_is_no_number_is_a_status() -> None:
    need = lean(0.02, knots=N)
    need.delta_z[3, 0] = np.nan
    forces, solution = contact_force().solve(need, [TABLE], np.full((1, N), 20.0))
    assert forces is None
    assert solution.status == SolveStatus.NUMERICAL_ERROR
