"""The stages in words: the named terms are the solvers' objectives, and the multipliers explain their optima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_case import MASS, TABLE, WALL, lean
from contact_case import SETTINGS as CONTACT
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_form import JointForm
from numpy.testing import assert_allclose
from test_contact_choice import LEFTWARDS
from whole_body_case import PREVIEW, ROBOT, SETTINGS, Problem, arguments, random_problem, solve, stage

from wbmpc.explain.force_terms import choice_program, force_program
from wbmpc.explain.height_terms import height_program
from wbmpc.explain.motion_terms import MotionProgram
from wbmpc.explain.program import Program, term
from wbmpc.planner.com_height import ComHeightStage
from wbmpc.planner.contact_choice import ContactChoice, Option
from wbmpc.planner.contact_force import ContactForce
from wbmpc.planner.contact_sets import ContactSets
from wbmpc.planner.knot_forces import KnotForces
from wbmpc.planner.settings import HeightSettings
from wbmpc.planner.whole_body import HorizontalPlan
from wbmpc.signals import Vector

SEEDS = st.integers(0, 2**32 - 1)
N = PREVIEW.steps
ASKING, MOVING = stage(ask_shift=True), stage(ask_shift=False)
ONE = {ask: JointForm(PREVIEW, ROBOT.nv, SETTINGS, backend="daqp", ask_shift=ask) for ask in (False, True)}


def in_words(problem: Problem, *, ask: bool) -> MotionProgram:
    names = tuple(ROBOT.joint_names)
    return MotionProgram(PREVIEW, SETTINGS, problem.state, asked=ask, joint_names=names, **arguments(problem))


def of_one_qp(plan: HorizontalPlan, *, ask: bool) -> Vector:
    """A plan as variables of `JointForm`."""
    shift = plan.delta_z.T.ravel()
    shifts = [np.maximum(shift, 0.0), np.maximum(-shift, 0.0)] if ask else []
    return np.concatenate([plan.jerk.T.ravel(), plan.footstep_shift.T.ravel(), plan.joint_velocity, *shifts])


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, ask=st.booleans(), walking=st.booleans())
def test_the_terms_of_stage_2_are_the_objective_of_the_one_qp(seed: int, ask: bool, walking: bool) -> None:
    """At the optimum and anywhere else, up to the constant that no solver knows."""
    problem = random_problem(seed, walking=walking)
    plan, form = solve(problem, using=ASKING if ask else MOVING), in_words(problem, ask=ask)
    ONE[ask].solve(problem.state, **arguments(problem))  # writes the problem
    rng = np.random.default_rng(seed)
    other = replace(
        plan,
        jerk=plan.jerk + rng.normal(size=(N, 2)),
        delta_z=ask * rng.normal(size=(N, 2), scale=0.01),
        joint_velocity=rng.normal(size=ROBOT.nv),
        footstep_shift=plan.footstep_shift + walking * rng.normal(size=plan.footstep_shift.shape, scale=0.01),
    )
    words = [form.program.objective(form.point(p)) for p in (plan, other)]
    numbers = [ONE[ask].problem.objective(of_one_qp(p, ask=ask)) for p in (plan, other)]
    assert words[1] - words[0] == pytest.approx(numbers[1] - numbers[0], rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, ask=st.booleans(), walking=st.booleans(), slow=st.booleans())
def test_multipliers_explain_the_optimum_of_stage_2(seed: int, ask: bool, walking: bool, slow: bool) -> None:
    problem = random_problem(seed, walking=walking)
    if slow:
        tasks = problem.tasks
        problem = replace(problem, tasks=replace(tasks, lower=0.05 * tasks.lower, upper=0.05 * tasks.upper))
    form = in_words(problem, ask=ask)
    x = form.point(solve(problem, using=ASKING if ask else MOVING))
    optimum = form.program.optimum(x)
    assert optimum.residual < 1e-6
    assert optimum.worth is None or optimum.worth < 1.0 + 1e-3
    if slow:
        assert any(name in active.label for active in optimum.active for name in ROBOT.joint_names)
    x[0] += 1.0  # a point that is no optimum is not explained
    assert form.program.optimum(x).residual > 1e-6


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, share=st.sampled_from([0.0, 0.3]))
def test_stage_1(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    weights = HeightSettings(middle_share=share)
    stage_1 = ComHeightStage(PREVIEW, weights, backend="daqp")
    state = np.array([rng.uniform(0.2, 0.29), rng.uniform(-0.1, 0.1), 0.0])
    wanted, middle = rng.uniform(0.2, 0.26, N), rng.uniform(0.2, 0.26, N)
    width = rng.uniform(-0.01, 0.05, N)  # two end-effectors that disagree, too
    band = np.column_stack([middle - width, middle + width])
    given_to = {"wanted": wanted, "band": band, "plane": 0.01}
    _, solution = stage_1.plan(state.copy(), **given_to)
    program = height_program(PREVIEW, weights, state, **given_to)
    other = rng.normal(size=N)
    words, numbers = (
        problem.objective(solution.x) - problem.objective(other) for problem in (program, stage_1.problem)
    )
    assert words == pytest.approx(numbers, rel=1e-9)
    assert program.optimum(solution.x).residual < 1e-6


OPTIONS = [
    Option(replace(TABLE, name="table"), 1, 0.1),
    Option(replace(TABLE, name="beside", position=TABLE.position + np.array([0.0, 0.22, 0.0])), 0, 0.12),
    Option(replace(WALL, name="wall"), 0, 0.05),
]


@pytest.mark.parametrize("beyond", [0.005, 0.02, 0.03])
@pytest.mark.parametrize("sideways", [0.0, 0.01])
def test_stage_3_choice(beyond: float, sideways: float) -> None:
    need = lean(beyond, sideways=sideways)
    choice = ContactSets(3, CONTACT, mass=MASS).solve(need, OPTIONS, left=LEFTWARDS)
    assert np.isfinite(choice.objective)
    program = choice_program(need, [OPTIONS[i] for i in choice.winners], CONTACT, mass=MASS)
    x = choice.forces[list(choice.winners)].ravel()
    assert program.objective(x) == pytest.approx(choice.objective, rel=1e-9)
    optimum = program.optimum(x)
    assert optimum.residual < 1e-6
    plain = ContactChoice(3, CONTACT, mass=MASS, backend="daqp").solve(need, OPTIONS, left=LEFTWARDS)
    assert choice.objective == pytest.approx(plain.objective, rel=1e-5)


def test_stage_3_at_the_edge_of_its_cone_and_cap() -> None:
    """A weak patch: hard rows hold the force, and their multipliers carry the rest of the slope."""
    weak = replace(TABLE, name="weak", friction=0.05, force_cap=4.0)
    need = lean(0.01)
    ((cost, forces),) = ContactSets(1, CONTACT, mass=MASS).costs(need, [Option(weak, 1)], [(0,)], left=LEFTWARDS)
    if not np.isfinite(cost):
        need = lean(0.0, growth=0.002)
        ((cost, forces),) = ContactSets(1, CONTACT, mass=MASS).costs(need, [Option(weak, 1)], [(0,)], left=LEFTWARDS)
    program = choice_program(need, [Option(weak, 1)], CONTACT, mass=MASS)
    optimum = program.optimum(forces.ravel())
    assert optimum.residual < 1e-6
    assert {active.term for active in optimum.active} & {"friction cone", "force cap"}


@pytest.mark.parametrize("beyond", [0.0, 0.01])
def test_stage_3_forces(beyond: float) -> None:
    need = lean(beyond, knots=N, growth=0.001)
    patches = [None, replace(TABLE, name="table")]
    caps = np.array([np.zeros(N), TABLE.force_cap * np.clip(np.arange(N) / 4 - 0.5, 0.0, 1.0)])
    forces, _ = KnotForces(N, CONTACT, mass=MASS, contacts=2).solve(need, patches, caps)
    assert forces is not None
    program, x = force_program(need, patches, caps, CONTACT, mass=MASS), forces[1].ravel()
    assert program.optimum(x).residual < 1e-6
    plain = ContactForce(N, CONTACT, mass=MASS, contacts=2, backend="daqp")
    _, solution = plain.solve(need, patches, caps)
    in_one = np.zeros((N, 2, 3))
    in_one[:, 1] = forces[1]
    assert program.objective(x) == pytest.approx(plain.problem.objective(in_one.ravel()), rel=1e-9)
    assert plain.problem.objective(solution.x) == pytest.approx(program.objective(x), rel=1e-4)


def test_a_small_program_by_hand() -> None:
    """½ (x − 3)² + 2 |y| + ½ 4 (y − 1)²  within x ≤ 1:  x = 1, held by 2; y = ½."""
    terms = [
        term("pull", [[1.0, 0.0]], 3.0, weight=1.0, unit="m"),
        term("other", [[0.0, 1.0]], 1.0, weight=4.0, unit="m"),
    ]
    none = np.full(2, -np.inf)
    program = Program(terms, ["x", "y"], none, np.array([1.0, np.inf]), np.array([0.0, 2.0]), "price")
    optimum = program.optimum(np.array([1.0, 0.5]))
    assert optimum.residual < 1e-12
    (held,) = optimum.active
    assert held.label == "x, upper bound"
    assert held.multiplier == pytest.approx(2.0)
    assert program.costs(np.array([1.0, 0.5])) == {"pull": 2.0, "other": 0.5, "price": 1.0}
    assert program.optimum(np.array([1.0, 0.4])).residual > 0.1
    resting = program.optimum(np.array([1.0, 0.0]))
    assert resting.worth == pytest.approx(2.0)  # worth twice its price: y = 0 is no optimum
    assert_allclose(resting.residual, 0.0, atol=1e-12)
