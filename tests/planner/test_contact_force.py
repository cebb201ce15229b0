"""Stage 3's forces with given contacts, as one QP and knot by knot, against Newton-Euler and the true friction cone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_case import KNOTS, MASS, POLYGON, SETTINGS, TABLE, lean, patch, pressure
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wbmpc.planner.contact_choice import ContactChoice, Option
from wbmpc.planner.contact_force import ContactForce
from wbmpc.planner.contact_stage import ENUMERATION, PlansForces, make_force_stage
from wbmpc.planner.knot_forces import KnotForces
from wbmpc.planner.settings import PlannerSettings
from wbmpc.signals import SolveStatus

N = 16
BOTH = pytest.mark.parametrize("backend", [ENUMERATION, "daqp"])


def contact_force(backend: str, contacts: int = 1, *, steps: int = N, **changes: float) -> PlansForces:
    contact = SETTINGS.model_copy(update=changes)
    given_settings = PlannerSettings(miqp_backend=backend).model_copy(update={"contact": contact})
    return make_force_stage(given_settings, mass=MASS, steps=steps, contacts=contacts)


def test_the_settings_decide_which_stage_is_made() -> None:
    assert isinstance(contact_force(ENUMERATION), KnotForces)
    assert isinstance(contact_force("daqp"), ContactForce)
    assert isinstance(make_force_stage(PlannerSettings(), mass=MASS, steps=N, contacts=2), KnotForces)


@BOTH
@settings(max_examples=20, deadline=None)
@given(beyond=st.floats(0.0, 0.03), x=st.floats(0.2, 0.35), z=st.floats(0.05, 0.3), friction=st.floats(0.3, 0.8))
def test_forces_at_all_knots_realise_the_shift(
    backend: str, beyond: float, x: float, z: float, friction: float
) -> None:
    """Shifts that a force in the cone can give are given exactly (dear slack), at every knot, under Newton-Euler."""
    table = patch([x, 0.0, z], friction=friction)  # straight ahead: a vertical force shifts along x alone
    need = lean(beyond, knots=N, growth=0.001)
    forces, solution = contact_force(backend, shift_slack_cost=1e5).solve(need, [table], np.full((1, N), 40.0))
    assert solution.status == SolveStatus.SOLVED
    assert forces is not None
    for k in range(N):
        moved = pressure(need, k, [table.position], forces[0, k : k + 1])
        assert_allclose(moved, need.zmp[k] + need.delta_z[k], atol=2e-5)


@BOTH
@settings(max_examples=20, deadline=None)
@given(beyond=st.floats(0.0, 0.03), y=st.floats(-0.15, 0.15))
def test_default_slack_leaves_the_pressure_in_the_polygon(backend: str, beyond: float, y: float) -> None:
    """With the shipped prices the shift is a wish, the polygon the bound; the cone is the true one."""
    table, need = patch([0.27, y, 0.20]), lean(beyond, knots=N, growth=0.001)
    forces, _ = contact_force(backend).solve(need, [table], np.full((1, N), 20.0))
    assert forces is not None
    for k in range(N):
        force = forces[0, k]
        assert POLYGON.excess(pressure(need, k, [table.position], force[None])) < 1e-3
        assert np.linalg.norm(force[:2]) <= table.friction * force[2] + 1e-6
        assert force[2] <= 20.0 + 1e-6


@BOTH
def test_caps_bind_knot_by_knot(backend: str) -> None:
    need, caps = lean(0.03, knots=N, growth=0.0), np.linspace(0.0, 15.0, N)[None]
    forces, _ = contact_force(backend).solve(need, [TABLE], caps)
    assert forces is not None
    vertical = forces[0, :, 2]
    assert (vertical <= caps[0] + 1e-6).all()
    assert not forces[0, 0].any()  # a cap of zero: not there yet
    assert vertical[1:3] == pytest.approx(caps[0, 1:3], abs=1e-4)  # not enough yet: all there is
    assert vertical[-1] < 14.0  # enough: no more than needed


@BOTH
def test_a_slot_without_a_patch_gives_nothing(backend: str) -> None:
    forces, _ = contact_force(backend, contacts=2).solve(lean(0.02, knots=N), [None, TABLE], np.full((2, N), 20.0))
    assert forces is not None
    assert not forces[0].any()
    assert (forces[1, :, 2] > 1.0).all()


@BOTH
def test_two_hands_share_the_load(backend: str) -> None:
    """Mirrored patches, a need straight ahead: mirrored forces whose common effect is the wanted shift."""
    left, right = patch([0.27, 0.1, 0.2]), patch([0.27, -0.1, 0.2])
    need = lean(0.03, knots=N, growth=0.0)
    forces, _ = contact_force(backend, contacts=2, shift_slack_cost=1e4).solve(
        need, [left, right], np.full((2, N), 20.0)
    )
    assert forces is not None
    assert_allclose(forces[0] * [1, -1, 1], forces[1], atol=1e-4)
    moved = pressure(need, 5, [left.position, right.position], forces[:, 5])
    assert_allclose(moved, need.zmp[5] + need.delta_z[5], atol=2e-4)
    single, _ = contact_force(backend, shift_slack_cost=1e4).solve(
        need, [patch([0.27, 0.0, 0.2])], np.full((1, N), 20.0)
    )
    assert single is not None
    assert forces[0, 5, 2] == pytest.approx(single[0, 5, 2] / 2, rel=0.05)


@BOTH
def test_choice_and_forces_are_the_same_problem(backend: str) -> None:
    """At fixed H both write the same cost: same forces where the polygon does not bind."""
    need = lean(0.02)
    chosen = ContactChoice(2, SETTINGS, mass=MASS, backend="daqp").solve(
        need, [Option(TABLE, 1)], left=np.array([0.0, 1.0])
    )
    given_all = contact_force(backend, steps=KNOTS)
    forces, _ = given_all.solve(need, [TABLE], np.full((1, KNOTS), TABLE.force_cap))
    assert forces is not None
    assert_allclose(forces[0], chosen.forces[0], atol=0.05)


@BOTH
def test_a_need_that_is_no_number_is_a_status(backend: str) -> None:
    need = lean(0.02, knots=N)
    need.delta_z[3, 0] = np.nan
    forces, solution = contact_force(backend).solve(need, [TABLE], np.full((1, N), 20.0))
    assert forces is None
    assert solution.status == SolveStatus.NUMERICAL_ERROR


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_knot_by_knot_is_the_same_as_one_qp(seed: int) -> None:
    """Tables and walls, ramping caps, slots without a patch, shifts that cannot be given: the same forces."""
    rng = np.random.default_rng(seed)
    patches = []
    for _ in range(2):
        normal = rng.normal(size=3) * [0.4, 0.4, 0.0] + [0.0, 0.0, 1.0]
        if rng.random() < 0.3:
            normal = np.array([0.0, rng.choice([-1.0, 1.0]), 0.0])
        position, friction = rng.uniform([-0.1, -0.3, 0.0], [0.4, 0.3, 0.3]), rng.uniform(0.3, 0.9)
        place = patch(position, normal / np.linalg.norm(normal), friction=friction)
        patches.append(place if rng.random() < 0.85 else None)
    need = lean(rng.uniform(0, 0.03), sideways=rng.uniform(-0.03, 0.03), knots=N, growth=rng.uniform(0, 0.003))
    ramp = np.linspace(0.0, 1.0, N) * rng.uniform(-20, 20, (2, 1))
    caps = np.clip(rng.uniform(-10, 20, (2, 1)) + ramp, 0.0, 20.0)
    plain, ours = ((contact_force(backend, contacts=2).solve(need, patches, caps)) for backend in ("daqp", ENUMERATION))
    assert plain[1].status == ours[1].status == SolveStatus.SOLVED
    assert plain[0] is not None
    assert ours[0] is not None
    assert_allclose(ours[0], plain[0], atol=1e-4)  # [N]
    assert_allclose(ours[1].x, plain[1].x, atol=1e-4)


@BOTH
def test_no_plan_remembers_the_one_before(backend: str) -> None:
    """The need changes with the same polygons, then the polygons do: each time as if asked first."""
    first = lean(0.02, knots=N)
    questions = [first, replace(lean(0.03, knots=N), polygons=first.polygons), first.inset(0.03), first]
    patches, caps = [patch(np.array([0.15, 0.0, 0.2]))], np.full((1, N), 20.0)
    stage = contact_force(backend, shift_slack_cost=1.0)
    answers = [stage.solve(need, patches, caps)[0] for need in questions]
    for need, answer in zip(questions, answers, strict=True):
        alone, _ = contact_force(backend, shift_slack_cost=1.0).solve(need, patches, caps)
        assert alone is not None
        assert answer is not None
        assert_allclose(answer, alone, atol=1e-6)
    assert np.abs(answers[0] - answers[1]).max() > 0.01
    assert np.abs(answers[0] - answers[2]).max() > 0.01
