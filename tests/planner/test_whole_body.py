"""Stage 2 against the same problem written a second time for another solver, and its promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from reference_qp import ReferenceQp
from robots import surena
from whole_body_case import (
    ROBOT,
    SETTINGS,
    TAU,
    N,
    Problem,
    T,
    arguments,
    random_problem,
    solve,
    stage,
    standing,
    still,
    velocity_tasks,
)

from wbmpc.planner.bands import NO_FOOT, horizontal_band
from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.horizontal_problem import LARGEST_SHIFT
from wbmpc.planner.joint_velocities import FOOT_ROWS
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.whole_body import HorizontalPlan
from wbmpc.planner.zmp_model import loaded_model
from wbmpc.signals import GRAVITY, SolveStatus, Vector

POLYGON = standing().polygons[0]
TOES = POLYGON.vertices[:, 0].max()  # [m]


def cost_and_violation(problem: Problem, plan: HorizontalPlan) -> float:
    """½ Σ of the weighted squares of the docstring, soft bounds included, from the plan's own motion."""
    s, t, support = SETTINGS, problem.tasks, problem.support
    velocity = problem.state[:, 1] + TAU * problem.state[:, 2] + TAU**2 / 2 * plan.jerk[0]
    com_error = t.com_jacobian @ plan.joint_velocity - np.append(velocity, t.com_vertical_velocity) - t.com_correction
    hand_error = (t.hand_jacobian @ plan.joint_velocity - t.hand_velocity).reshape(2, 3)
    moved = plan.zmp - support.shift @ plan.footstep_shift  # feet's ZMP as seen from the footsteps
    off_centre = (moved - plan.delta_z - support.centres) * np.sqrt(support.centring)[:, None]
    squares = [
        (s.jerk_cost, plan.jerk),
        (s.delta_z_cost, plan.delta_z),
        (s.joint_velocity_cost, (plan.joint_velocity - t.posture_velocity) * np.sqrt(t.posture_weight)),
        (s.com_velocity_cost, com_error),
        (s.hand_velocity_cost, hand_error * np.sqrt(t.hand_active)[:, None]),
        (problem.urgency * s.velocity_cost, plan.velocity - support.com_velocity),
        (problem.urgency * s.position_cost, plan.com - support.com_reference),
        (s.footstep_cost, plan.footstep_shift),
        (s.zmp_centre_cost, off_centre),
        (s.torso_cost, t.torso_jacobian @ plan.joint_velocity - t.torso_velocity),
        (s.foot_slack_cost, t.foot_jacobian @ plan.joint_velocity - t.foot_velocity),
    ]
    total = sum(weight * float(np.sum(np.square(error))) for weight, error in squares)
    total += 2.0 * s.delta_z_price * float(np.abs(plan.delta_z).sum())

    def beyond(value: Vector, lower: Vector | float, upper: Vector) -> float:
        return float(np.sum(np.maximum(value - upper, 0.0) ** 2) + np.sum(np.maximum(lower - value, 0.0) ** 2))

    for k in range(N):
        total += s.zmp_slack_cost * beyond(support.normals[k] @ moved[k], -np.inf, support.offsets[k])
    a, b = problem.zmp.a[-1], problem.zmp.b[-1]
    capture = a * (plan.com[-1] + np.sqrt(b / a) * plan.velocity[-1]) + problem.zmp.offset[-1] + plan.delta_z[-1]
    capture = capture - support.rest_shift @ plan.footstep_shift
    total += s.rest_slack_cost * beyond(support.rest_normals @ capture, -np.inf, support.rest_offsets)
    total += s.reach_slack_cost * beyond(plan.com.T, problem.com_band[:, :, 0], problem.com_band[:, :, 1])
    before = np.zeros(2)
    for j, shift in enumerate(plan.footstep_shift):
        apart = support.placement_axes[j] @ (shift - before)
        total += s.foot_slack_cost * beyond(apart, support.placement_lower[j], support.placement_upper[j])
        before = shift
    return 0.5 * total


def reference(problem: Problem, *, ask_shift: bool) -> tuple[Vector, float, dict[str, list[slice]]]:
    """[M] eq. formul and Herdt's footsteps, knot by knot and footstep by footstep, solved by NNLS.

    The footsteps are places and not displacements; |ΔZ|'s plain norm is a bound t ≥ |ΔZ|, linear in t.
    """
    s, t, support, qp = SETTINGS, problem.tasks, problem.support, ReferenceQp()
    m, eye, each = MAX_FOOTSTEPS, np.eye(N), np.eye(MAX_FOOTSTEPS)
    blocks: dict[str, list[slice]] = {name: [] for name in ("jerk", "c", "dc", "ddc", "dz", "step")}
    constant = 0.0
    for axis in range(2):
        jerk, c, dc, ddc = qp.axis(problem.state[axis], steps=N, step=T)
        shift, step = qp.variables(N), qp.variables(m)
        qp.cost([(jerk, eye)], np.zeros(N), s.jerk_cost)
        qp.cost([(dc, eye)], support.com_velocity[:, axis], problem.urgency * s.velocity_cost)
        qp.cost([(c, eye)], support.com_reference[:, axis], problem.urgency * s.position_cost)
        places = support.footsteps[:, axis]
        qp.cost([(step, each)], places, s.footstep_cost)
        qp.bound([(step, each)], places + support.lower[:, axis], places + support.upper[:, axis])
        if ask_shift:
            # ½ w |ΔZ|² + p |ΔZ|₁ = ½ (w/2) ΔZ² + ½ (w/2) (t + 2p/w)² − p²/w  where t = |ΔZ|
            size, half = qp.variables(N), 0.5 * s.delta_z_cost
            top = s.delta_z_price / half
            qp.cost([(shift, eye)], np.zeros(N), half)
            qp.cost([(size, eye)], np.full(N, -top), half)
            constant += 0.5 * half * top**2 * N
            for sign in (1.0, -1.0):
                qp.bound([(size, eye), (shift, sign * eye)], np.zeros(N), np.full(N, np.inf))
            qp.bound([(shift, eye)], np.full(N, -LARGEST_SHIFT), np.full(N, LARGEST_SHIFT))
        else:
            qp.equal([(shift, eye)], np.zeros(N))
        qp.soft_bound([(c, eye)], *problem.com_band[axis].T, s.reach_slack_cost)
        for name, block in zip(blocks, (jerk, c, dc, ddc, shift, step), strict=True):
            blocks[name].append(block)

    def feet_zmp(k: int, A: Vector, share: Vector, *, shifted: bool) -> tuple[list[tuple[slice, Vector]], Vector]:
        """Terms of A (Z_k + ΔZ_k − Σ share (F − F_ref)), and their constant part."""
        terms = []
        for axis in range(2):
            column = A[:, axis : axis + 1]
            terms += [
                (_one(blocks["c"][axis], k), problem.zmp.a[k] * column),
                (_one(blocks["ddc"][axis], k), -problem.zmp.b[k] * column),
                (blocks["step"][axis], -column * share),
            ]
            if shifted:
                terms.append((_one(blocks["dz"][axis], k), column))
        return terms, A @ (problem.zmp.offset[k] + share @ support.footsteps)

    for k in range(N):
        real = np.isfinite(support.offsets[k])
        A, bound = support.normals[k][real], support.offsets[k][real]
        terms, known = feet_zmp(k, A, support.shift[k], shifted=True)
        qp.soft_bound(terms, np.full(len(bound), -np.inf), bound - known, s.zmp_slack_cost)
        if support.centring[k]:
            terms, known = feet_zmp(k, np.eye(2), support.shift[k], shifted=False)
            qp.cost(terms, support.centres[k] - known, s.zmp_centre_cost * support.centring[k])
    real, a = np.isfinite(support.rest_offsets), problem.zmp.a[-1]
    A, bound, omega = support.rest_normals[real], support.rest_offsets[real], np.sqrt(a / problem.zmp.b[-1])
    terms = []
    for axis in range(2):
        column = A[:, axis : axis + 1]
        terms += [
            (_one(blocks["c"][axis], N - 1), a * column),
            (_one(blocks["dc"][axis], N - 1), a / omega * column),
            (_one(blocks["dz"][axis], N - 1), column),
            (blocks["step"][axis], -column * support.rest_shift),
        ]
    known = A @ (problem.zmp.offset[-1] + support.rest_shift @ support.footsteps)
    qp.soft_bound(terms, np.full(len(bound), -np.inf), bound - known, s.rest_slack_cost)
    for j in range(m):
        apart = np.zeros(m)
        apart[j] = 1.0
        if j:
            apart[j - 1] = -1.0
        axes = support.placement_axes[j]
        terms = [(blocks["step"][axis], axes[:, axis : axis + 1] * apart) for axis in range(2)]
        known = axes @ (apart @ support.footsteps)
        bounds = (known + support.placement_lower[j], known + support.placement_upper[j])
        qp.soft_bound(terms, *bounds, s.foot_slack_cost)

    qd = qp.variables(ROBOT.nv)
    for joint, weight in enumerate(t.posture_weight):
        qp.cost([(_one(qd, joint), np.eye(1))], t.posture_velocity[joint], s.joint_velocity_cost * weight)
    for row in range(3):
        terms = [(qd, t.com_jacobian[row : row + 1])]
        wanted = t.com_correction[row] + t.com_vertical_velocity
        if row < 2:
            terms.append((_one(blocks["jerk"][row], 0), np.array([[-(TAU**2) / 2]])))
            wanted = t.com_correction[row] + problem.state[row, 1] + TAU * problem.state[row, 2]
        qp.cost(terms, wanted, s.com_velocity_cost)
    for hand in range(2):
        if t.hand_active[hand]:
            rows = slice(3 * hand, 3 * hand + 3)
            qp.cost([(qd, t.hand_jacobian[rows])], t.hand_velocity[rows], s.hand_velocity_cost)
    qp.cost([(qd, t.torso_jacobian)], t.torso_velocity, s.torso_cost)
    qp.cost([(qd, t.foot_jacobian)], t.foot_velocity, s.foot_slack_cost)
    qp.bound([(qd, np.eye(ROBOT.nv))], t.lower, t.upper)
    x, cost = qp.solve()
    return x, cost - constant, {**blocks, "qd": [qd]}


def _one(block: slice, k: int) -> slice:
    return slice(block.start + k, block.start + k + 1)


@pytest.mark.parametrize("ask_shift", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_optimum_is_another_solvers(seed: int, ask_shift: bool) -> None:
    problem = random_problem(seed, walking=seed % 2 == 0)
    plan = solve(problem, ask_shift=ask_shift)
    x, cost, blocks = reference(problem, ask_shift=ask_shift)

    def block(name: str) -> Vector:
        return np.column_stack([x[columns] for columns in blocks[name]])

    assert cost_and_violation(problem, plan) == pytest.approx(cost, rel=1e-5)
    assert_allclose(plan.com, block("c"), atol=1e-5)
    assert_allclose(plan.delta_z, block("dz"), atol=1e-5)
    assert_allclose(plan.footstep_shift, block("step") - problem.support.footsteps, atol=1e-5)
    assert_allclose(plan.joint_velocity, x[blocks["qd"][0]], atol=1e-4)


def test_random_problems_use_every_term() -> None:
    """What the comparison above is worth: rows that bind, footsteps that move, shifts that are and are not zero."""
    problems = [random_problem(seed, walking=seed % 2 == 0) for seed in range(6)]
    plans = [solve(problem, ask_shift=True) for problem in problems]
    assert any((p.delta_z == 0.0).all() for p in plans)
    assert any(np.abs(p.delta_z).max() > 0.01 for p in plans)
    assert max(np.abs(p.footstep_shift).max() for p in plans) > 0.003
    assert any(q.support.centring.any() for q in problems)
    outside = [np.maximum(q.com_band[:, :, 0] - p.com.T, p.com.T - q.com_band[:, :, 1]).max() for q, p in
               zip(problems, plans, strict=True)]  # fmt: skip
    assert max(outside) > 1e-4
    placed = []
    for problem, plan in zip(problems, plans, strict=True):
        apart = np.diff(plan.footstep_shift, axis=0, prepend=np.zeros((1, 2)))
        apart = np.einsum("jab,jb->ja", problem.support.placement_axes, apart)
        placed.append(np.maximum(problem.support.placement_lower - apart, apart - problem.support.placement_upper))
    assert max(rows.max() for rows in placed) > 1e-6


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), ask_shift=st.booleans())
def test_hard_constraints_hold(seed: int, ask_shift: bool) -> None:
    """Joint bounds, bounds of footsteps, no ΔZ unless asked for; the ZMP reported is that of the motion."""
    problem = random_problem(seed, walking=seed % 2 == 0)
    plan = solve(problem, ask_shift=ask_shift)
    t, support = problem.tasks, problem.support
    assert (plan.joint_velocity >= t.lower - 1e-7).all()
    assert (plan.joint_velocity <= t.upper + 1e-7).all()
    assert (plan.footstep_shift >= support.lower - 1e-7).all()
    assert (plan.footstep_shift <= support.upper + 1e-7).all()
    assert np.abs(plan.delta_z).max() <= (LARGEST_SHIFT + 1e-7 if ask_shift else 0.0)
    model = problem.zmp
    zmp = model.a[:, None] * plan.com - model.b[:, None] * plan.acceleration + model.offset + plan.delta_z
    assert_allclose(plan.zmp, zmp, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_feet_get_their_velocities(seed: int) -> None:
    """J_foot q̇ = v_foot (the cure of an erratum) for standing and swinging feet, when the joints can."""
    rng = np.random.default_rng(seed)
    tasks = velocity_tasks()
    swing = np.concatenate([rng.uniform(-0.15, 0.15, 3), rng.uniform(-0.3, 0.3, 3)])
    wanted = np.concatenate([np.zeros(6), swing])
    plan = solve(still(tasks=replace(tasks, foot_velocity=wanted)))
    assert_allclose(tasks.foot_jacobian @ plan.joint_velocity, wanted, atol=2e-3)


@settings(max_examples=25, deadline=None)
@given(x=st.floats(-0.02, 0.02), y=st.floats(-0.02, 0.02), vx=st.floats(-0.06, 0.06), vy=st.floats(-0.06, 0.06))
def test_zmp_stays_in_the_polygon_at_every_knot(x: float, y: float, vx: float, vy: float) -> None:
    """[M] eq. ZMP-constraint, from any state that the feet can catch (capture point inside)."""
    centre = POLYGON.centre
    plan = solve(still(state=np.array([[centre[0] + x, vx, 0.0], [centre[1] + y, vy, 0.0]])))
    assert max(POLYGON.excess(z) for z in plan.zmp) < 2e-4


@settings(max_examples=25, deadline=None)
@given(x=st.floats(-0.02, 0.02), y=st.floats(-0.02, 0.02), vx=st.floats(-0.06, 0.06), vy=st.floats(-0.06, 0.06))
def test_no_shift_is_asked_for_when_the_feet_are_enough(x: float, y: float, vx: float, vy: float) -> None:
    """The plain norm: ΔZ is 0 exactly, and the plan is the one made without it."""
    centre = POLYGON.centre
    problem = still(state=np.array([[centre[0] + x, vx, 0.0], [centre[1] + y, vy, 0.0]]))
    asked = solve(problem, ask_shift=True)
    assert (asked.delta_z == 0.0).all()
    assert_allclose(asked.com, solve(problem).com, atol=1e-7)


def test_without_the_foot_rows_only_the_base_would_move() -> None:
    """Erratum: [M] eq. formul has no J_foot q̇ = 0; a hand's velocity is then met by drifting off with the base."""
    tasks = velocity_tasks()
    tasks = replace(tasks, hand_active=np.array([1.0, 0.0]), hand_velocity=np.array([0.1, 0, 0, 0, 0, 0]))
    with_feet = solve(still(tasks=tasks))
    without = solve(still(tasks=replace(tasks, foot_jacobian=np.zeros((12, ROBOT.nv)))))
    slip = np.abs(tasks.foot_jacobian @ without.joint_velocity).max()
    assert slip > 0.02  # [m/s]
    assert np.abs(tasks.foot_jacobian @ with_feet.joint_velocity).max() < 1e-6


def test_hands_and_com_get_their_velocities() -> None:
    """With room to move, J_hand q̇ = V_hand and J_com q̇ = ċ to the weights' small compromise."""
    tasks = velocity_tasks()
    tasks = replace(tasks, hand_active=np.ones(2), hand_velocity=np.array([0.05, 0.0, 0.03, 0.03, -0.02, 0.0]))
    tasks = replace(tasks, com_correction=np.array([0.02, -0.01, -0.01]), torso_jacobian=np.zeros((3, ROBOT.nv)))
    plan = solve(still(tasks=tasks))
    assert_allclose(tasks.hand_jacobian @ plan.joint_velocity, tasks.hand_velocity, atol=5e-3)
    # the CoM's own plan is at rest (a little of the wish is taken up by the first jerk)
    assert_allclose(tasks.com_jacobian @ plan.joint_velocity, tasks.com_correction, atol=2e-3)


def leaning(distance: float) -> Problem:
    """A hand reference `distance` beyond the toes, d = 0.15 m, in the second half of the horizon."""
    reach = np.full((2, N, 2), np.nan)
    reach[0, 8:] = [TOES + distance, 0.0]
    return still(com_band=horizontal_band(reach, np.full((2, 2), 0.15), NO_FOOT, NO_FOOT))


def test_a_hand_within_reach_needs_no_shift() -> None:
    assert not solve(leaning(0.10), ask_shift=True).delta_z.any()


def test_a_hand_beyond_reach_forces_the_com_past_the_toes_and_asks_for_a_shift() -> None:
    """[M] stage 2: |R − C| ≤ d pulls the CoM along, and ΔZ ≠ 0 says that the feet alone cannot hold it."""
    plan = solve(leaning(0.20), ask_shift=True)
    assert plan.com[-1, 0] > TOES + 0.03
    assert plan.delta_z[-1, 0] < -0.03  # back to the feet
    assert max(POLYGON.excess(z) for z in plan.zmp) < 1e-3


def test_without_help_the_feet_come_first_and_the_hand_stays_short() -> None:
    plan = solve(leaning(0.20))
    assert max(POLYGON.excess(z) for z in plan.zmp) < 1e-3
    assert plan.com[8:12, 0].max() < TOES + 0.02  # d asks for TOES + 0.05


def test_a_plan_without_help_can_be_stopped_at_its_end() -> None:
    """The capture point at the last knot lies over the feet; otherwise no later plan can save the robot."""
    plan = solve(leaning(0.20))
    assert POLYGON.excess(plan.com[-1] + plan.velocity[-1] * np.sqrt(0.264 / GRAVITY)) < 0.018  # on the soles


def test_a_known_force_lets_the_com_past_the_toes() -> None:
    """Case a of the paper: with the brace's force in a, b and j the same lean needs no ΔZ."""
    m, lift, x, z = ROBOT.mass, 8.0, 0.27, 0.20
    point, force = np.tile([x, 0.0, z], (N, 1)), np.tile([0.0, 0.0, lift], (N, 1))
    zero = np.zeros(N)
    height = HeightPlan(jerk=zero, height=np.full(N, 0.264), velocity=zero, acceleration=zero)
    model = loaded_model(height, forces=force[None], points=point[None], plane=0.0, mass=m)
    # moments about the foremost place of the pressure, at rest: how far out the CoM may be
    front = POLYGON.offsets[np.argmax(POLYGON.normals[:, 0])]
    outmost = front + lift * (x - front) / (m * GRAVITY)
    assert outmost > TOES + 0.03
    state = np.array([[outmost - 0.003, 0.0, 0.0], [POLYGON.centre[1], 0.0, 0.0]])
    braced = solve(still(state=state, zmp=model))
    assert max(POLYGON.excess(z) for z in braced.zmp) < 1e-4
    assert braced.com[:, 0].max() < outmost + 1e-4
    unaided = solve(still(state=state))
    assert max(POLYGON.excess(z) for z in unaided.zmp) > 0.005 or unaided.com[-1, 0] > outmost + 0.1


def test_a_footstep_goes_where_the_capture_point_is() -> None:
    """Herdt: pushed sideways on one foot, the next footstep goes further out, the more the harder the push."""
    shifts = [solve(pushed(speed)).footstep_shift[0, 1] for speed in (0.2, 0.3, 0.4)]
    assert np.diff(shifts).min() > 0.05
    assert_allclose(solve(pushed(0.3, adaptable=False)).footstep_shift, 0.0, atol=1e-12)


def test_an_adapted_footstep_saves_what_a_fixed_one_does_not() -> None:
    free, fixed = solve(pushed(0.3)), solve(pushed(0.3, adaptable=False))

    def excess(problem: Problem, plan: HorizontalPlan) -> float:
        support = problem.support
        moved = plan.zmp - support.shift @ plan.footstep_shift
        return max(polygon.excess(z) for polygon, z in zip(support.polygons, moved, strict=True))

    assert excess(pushed(0.3), free) < 2e-3
    assert excess(pushed(0.3), fixed) > 0.02


def pushed(speed: float, *, adaptable: bool = True) -> Problem:
    """On the right foot, falling to the left at `speed` [m/s]; the left foot can land after 0.2 s."""
    support = stepping_left(adaptable=adaptable)
    x, y = support.polygons[0].centre
    return still(support=support, state=np.array([[x, 0.0, 0.0], [y + 0.01, speed, 0.0]]))


def stepping_left(*, adaptable: bool) -> SupportPreview:
    """Single support on the right foot until knot 2, then on the left one, 0.09 m beside it."""
    half = surena().sole_half_extents
    corners = [foot_corners(position=np.array([0.0, y]), yaw=0.0, half_extents=half) for y in (0.0, 0.09)]
    single = SupportPolygon.of_corners(corners[0], margin=0.01, plane_height=0.0)
    both = SupportPolygon.of_corners(np.vstack(corners), margin=0.01, plane_height=0.0)
    polygons = (single,) * 2 + (SupportPolygon.of_corners(corners[1], margin=0.01, plane_height=0.0),) * (N - 2)
    shift, rest_shift = np.zeros((N, MAX_FOOTSTEPS)), np.zeros(MAX_FOOTSTEPS)
    shift[2:, 0], rest_shift[0] = 1.0, 0.5
    limit, footsteps = np.zeros((MAX_FOOTSTEPS, 2)), np.zeros((MAX_FOOTSTEPS, 2))
    footsteps[0, 1] = 0.09
    limit[0] = 0.2 if adaptable else 0.0
    preview = SupportPreview.standing(polygons, rest=both)
    return replace(preview, shift=shift, rest_shift=rest_shift, footsteps=footsteps, lower=-limit, upper=limit)


def test_contradicting_bounds_are_a_status() -> None:
    tasks = velocity_tasks()
    lower = tasks.lower.copy()
    lower[7] = tasks.upper[7] + 1.0
    one = stage(ask_shift=False)
    problem = still(tasks=replace(tasks, lower=lower))
    plan, solution = one.solve(problem.state, **arguments(problem))
    assert plan is None
    assert solution.status == SolveStatus.INFEASIBLE
    solve(still(), using=one)  # the next problem is solved again


def test_feet_that_cannot_follow_are_no_failure() -> None:
    """A metre a second with joints that may not move: soft rows, the plan of the CoM stands."""
    tasks = velocity_tasks()
    foot_velocity = np.zeros(FOOT_ROWS)
    foot_velocity[0] = 1.0
    held = np.full(ROBOT.nv, 0.01)
    plan = solve(still(tasks=replace(tasks, lower=-held, upper=held, foot_velocity=foot_velocity)))
    assert max(POLYGON.excess(z) for z in plan.zmp) < 1e-3


@pytest.mark.parametrize("ask_shift", [False, True])
def test_a_stage_forgets_its_last_problem(ask_shift: bool) -> None:
    """Warm starts and the blocks written in place change no answer, whatever support came before."""
    one = stage(ask_shift=ask_shift)
    solve(random_problem(1, walking=True), using=one)
    for seed, walking in ((2, False), (3, True), (4, False)):
        problem = random_problem(seed, walking=walking)
        again, fresh = solve(problem, using=one), solve(problem, ask_shift=ask_shift)
        assert_allclose(again.com, fresh.com, atol=1e-7)
        assert_allclose(again.footstep_shift, fresh.footstep_shift, atol=1e-7)


def test_backends_agree() -> None:
    problem = random_problem(3, walking=True)
    other = solve(problem, using=stage(ask_shift=False, backend="osqp"))
    assert_allclose(other.com, solve(problem).com, atol=5e-4)
