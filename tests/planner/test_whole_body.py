"""Stage 2 against the same problem written a second time for another solver, and its promises."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from reference_qp import ReferenceQp
from robots import at, standing_polygon, surena

from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.whole_body import HorizontalPlan, VelocityTasks, WholeBodyStage, ZmpModel
from wbmpc.signals import GRAVITY, SolveStatus, Vector

ROBOT = surena()
N, T = 16, 0.1
PREVIEW = Preview(steps=N, step=T)
SETTINGS = WholeBodySettings()
POLYGON = standing_polygon(margin=0.018)
TOES = POLYGON.vertices[:, 0].max()  # [m]
TAU = 0.01  # [s]
FREE_HANDS = np.full((2, N, 2), np.nan)
FAR = 1.0  # [m] a bound on ΔZ that never binds


@dataclass(frozen=True)
class Problem:
    """The arguments of one solve."""

    state: Vector
    zmp: ZmpModel
    polygons: tuple[SupportPolygon, ...]
    com_reference: Vector
    reach: Vector
    reach_distance: Vector
    delta_z_limit: float
    tasks: VelocityTasks
    urgency: float = 1.0


def velocity_tasks(rng: np.random.Generator | None = None) -> VelocityTasks:
    """Standing feet and no wish at the home posture, or random wishes at a random posture."""
    nj = ROBOT.nj
    q = ROBOT.home_q.copy()
    if rng is not None:
        q = ROBOT.integrate(q, np.concatenate([np.zeros(6), rng.uniform(-0.3, 0.3, nj)]))
    kinematics = at(q)

    def random(size: int, scale: float) -> Vector:
        return np.zeros(size) if rng is None else rng.uniform(-scale, scale, size)

    return VelocityTasks(
        com_jacobian=kinematics.com_jacobian,
        com_correction=random(3, 0.05),
        com_vertical_velocity=float(random(1, 0.1)[0]),
        foot_jacobian=np.vstack([kinematics.jacobian(frame) for frame in ROBOT.sole_frames]),
        foot_velocity=np.zeros(12),  # stance: both soles stay
        hand_jacobian=np.vstack([kinematics.jacobian(frame)[:3] for frame in ROBOT.palm_frames]),
        hand_velocity=random(6, 0.2),
        hand_active=np.zeros(2) if rng is None else rng.choice([0.0, 1.0], 2),
        torso_jacobian=kinematics.jacobian(ROBOT.torso_frame)[3:],
        torso_velocity=random(3, 0.2),
        posture_velocity=np.concatenate([np.zeros(6), random(nj, 0.3)]),
        lower=np.concatenate([np.full(6, -5.0), np.full(nj, -3.0) if rng is None else rng.uniform(-3.0, 0.0, nj)]),
        upper=np.concatenate([np.full(6, 5.0), np.full(nj, 3.0) if rng is None else rng.uniform(0.0, 3.0, nj)]),
    )


def still(**changes: object) -> Problem:
    """Standing at rest over the middle of the feet."""
    centre = POLYGON.centre
    problem = Problem(
        state=np.array([[centre[0], 0.0, 0.0], [centre[1], 0.0, 0.0]]),
        zmp=ZmpModel(np.ones(N), np.full(N, 0.264 / GRAVITY), np.zeros((N, 2))),
        polygons=(POLYGON,) * N,
        com_reference=np.tile(centre, (N, 1)),
        reach=FREE_HANDS,
        reach_distance=np.full((2, 2), 0.15),
        delta_z_limit=FAR,
        tasks=velocity_tasks(),
    )
    return replace(problem, **changes)


def random_problem(seed: int) -> Problem:
    rng = np.random.default_rng(seed)
    state = np.column_stack([rng.uniform(-0.02, 0.04, 2), rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.2, 0.2, 2)])
    reach = FREE_HANDS.copy()
    reach[0] = np.linspace([0.1, 0.1], rng.uniform([0.2, -0.1], [0.4, 0.2]), N)
    if rng.random() < 0.5:
        reach[1, 4:] = rng.uniform([0.1, -0.2], [0.3, -0.1])
    return Problem(
        state=state,
        zmp=ZmpModel(rng.uniform(0.9, 1.2, N), rng.uniform(0.02, 0.03, N), rng.uniform(-0.01, 0.01, (N, 2))),
        polygons=tuple(POLYGON.shrunk(0.008 * t) for t in PREVIEW.times),
        com_reference=np.tile(POLYGON.centre, (N, 1)),
        reach=reach,
        reach_distance=rng.uniform([[0.12, 0.02]] * 2, [[0.25, 0.2]] * 2),
        delta_z_limit=float(rng.choice([0.0, 0.01, FAR])),
        tasks=velocity_tasks(rng),
        urgency=float(rng.choice([1.0, 20.0])),
    )


def solve(problem: Problem, stage: WholeBodyStage | None = None) -> HorizontalPlan:
    stage = stage or WholeBodyStage(PREVIEW, ROBOT.nv, SETTINGS, backend="daqp")
    arguments = {name: getattr(problem, name) for name in problem.__dataclass_fields__ if name != "state"}
    plan, solution = stage.solve(problem.state, velocity_time=TAU, **arguments)
    assert plan is not None, solution.status.name
    return plan


def cost_and_violation(problem: Problem, plan: HorizontalPlan) -> float:
    """½ Σ of the weighted squares of the docstring, soft bounds included, from the plan's own motion."""
    s, t = SETTINGS, problem.tasks
    velocity = problem.state[:, 1] + TAU * problem.state[:, 2] + TAU**2 / 2 * plan.jerk[0]
    com_error = t.com_jacobian @ plan.joint_velocity - np.append(velocity, t.com_vertical_velocity) - t.com_correction
    hand_error = (t.hand_jacobian @ plan.joint_velocity - t.hand_velocity).reshape(2, 3)
    squares = [
        (s.jerk_cost, plan.jerk),
        (s.delta_z_cost, plan.delta_z),
        (s.joint_velocity_cost, plan.joint_velocity - t.posture_velocity),
        (s.com_velocity_cost, com_error),
        (s.hand_velocity_cost, hand_error * np.sqrt(t.hand_active)[:, None]),
        (problem.urgency * s.velocity_cost, plan.velocity),
        (problem.urgency * s.position_cost, plan.com - problem.com_reference),
        (s.torso_cost, t.torso_jacobian @ plan.joint_velocity - t.torso_velocity),
    ]
    total = sum(weight * float(np.sum(np.square(error))) for weight, error in squares)
    for k, polygon in enumerate(problem.polygons):
        excess = polygon.normals @ plan.zmp[k] - polygon.offsets
        total += s.zmp_slack_cost * float(np.sum(np.maximum(excess, 0.0) ** 2))
    end, a, b = problem.polygons[-1], problem.zmp.a[-1], problem.zmp.b[-1]
    capture = a * (plan.com[-1] + np.sqrt(b / a) * plan.velocity[-1]) + problem.zmp.offset[-1] + plan.delta_z[-1]
    total += s.rest_slack_cost * float(np.sum(np.maximum(end.normals @ capture - end.offsets, 0.0) ** 2))
    beyond = np.abs(problem.reach - plan.com) - problem.reach_distance[:, None, :]
    total += s.reach_slack_cost * float(np.nansum(np.maximum(beyond, 0.0) ** 2))
    return 0.5 * total


def reference(problem: Problem) -> tuple[Vector, float, dict[str, slice]]:
    """[M] eq. formul, knot by knot, solved by NNLS."""
    s, t, qp = SETTINGS, problem.tasks, ReferenceQp()
    eye = np.eye(N)
    jerks, positions, velocities, accelerations, shifts = [], [], [], [], []
    for axis in range(2):
        jerk, c, dc, ddc = qp.axis(problem.state[axis], steps=N, step=T)
        shift = qp.variables(N)
        qp.cost([(jerk, eye)], np.zeros(N), s.jerk_cost)
        qp.cost([(shift, eye)], np.zeros(N), s.delta_z_cost)
        qp.cost([(dc, eye)], np.zeros(N), problem.urgency * s.velocity_cost)
        qp.cost([(c, eye)], problem.com_reference[:, axis], problem.urgency * s.position_cost)
        if problem.delta_z_limit > 0:
            qp.bound([(shift, eye)], np.full(N, -problem.delta_z_limit), np.full(N, problem.delta_z_limit))
        else:
            qp.equal([(shift, eye)], np.zeros(N))
        for hand in range(2):
            r, d = problem.reach[hand, :, axis], problem.reach_distance[hand, axis]
            known = np.isfinite(r)
            if known.any():
                qp.soft_bound([(c, eye[known])], r[known] - d, r[known] + d, s.reach_slack_cost)
        for blocks, block in zip(
            (jerks, positions, velocities, accelerations, shifts), (jerk, c, dc, ddc, shift), strict=True
        ):
            blocks.append(block)
    for k, polygon in enumerate(problem.polygons):
        real = np.isfinite(polygon.offsets)
        A, b = polygon.normals[real], polygon.offsets[real]
        terms = []
        for axis in range(2):
            column = A[:, axis : axis + 1]
            terms += [
                (_one(positions[axis], k), problem.zmp.a[k] * column),
                (_one(accelerations[axis], k), -problem.zmp.b[k] * column),
                (_one(shifts[axis], k), column),
            ]
        qp.soft_bound(terms, np.full(len(b), -np.inf), b - A @ problem.zmp.offset[k], s.zmp_slack_cost)
    end, a = problem.polygons[-1], problem.zmp.a[-1]
    real = np.isfinite(end.offsets)
    A, b, omega = end.normals[real], end.offsets[real], np.sqrt(a / problem.zmp.b[-1])
    terms = []
    for axis in range(2):
        column = A[:, axis : axis + 1]
        terms += [
            (_one(positions[axis], N - 1), a * column),
            (_one(velocities[axis], N - 1), a / omega * column),
            (_one(shifts[axis], N - 1), column),
        ]
    qp.soft_bound(terms, np.full(len(b), -np.inf), b - A @ problem.zmp.offset[-1], s.rest_slack_cost)
    qd = qp.variables(ROBOT.nv)
    qp.cost([(qd, np.eye(ROBOT.nv))], t.posture_velocity, s.joint_velocity_cost)
    for row in range(3):
        terms = [(qd, t.com_jacobian[row : row + 1])]
        wanted = t.com_correction[row] + t.com_vertical_velocity
        if row < 2:
            terms.append((_one(jerks[row], 0), np.array([[-(TAU**2) / 2]])))
            wanted = t.com_correction[row] + problem.state[row, 1] + TAU * problem.state[row, 2]
        qp.cost(terms, wanted, s.com_velocity_cost)
    for hand in range(2):
        if t.hand_active[hand]:
            rows = slice(3 * hand, 3 * hand + 3)
            qp.cost([(qd, t.hand_jacobian[rows])], t.hand_velocity[rows], s.hand_velocity_cost)
    qp.cost([(qd, t.torso_jacobian)], t.torso_velocity, s.torso_cost)
    qp.equal([(qd, t.foot_jacobian)], t.foot_velocity)
    qp.bound([(qd, np.eye(ROBOT.nv))], t.lower, t.upper)
    x, cost = qp.solve()
    return x, cost, {"qd": qd, "cx": positions[0], "cy": positions[1], "dx": shifts[0], "dy": shifts[1]}


def _one(block: slice, k: int) -> slice:
    return slice(block.start + k, block.start + k + 1)


@pytest.mark.parametrize("seed", range(6))
def test_optimum_is_another_solvers(seed: int) -> None:
    problem = random_problem(seed)
    plan = solve(problem)
    x, cost, blocks = reference(problem)
    assert cost_and_violation(problem, plan) == pytest.approx(cost, rel=1e-5)
    assert_allclose(plan.com, np.column_stack([x[blocks["cx"]], x[blocks["cy"]]]), atol=1e-5)
    assert_allclose(plan.delta_z, np.column_stack([x[blocks["dx"]], x[blocks["dy"]]]), atol=1e-5)
    assert_allclose(plan.joint_velocity, x[blocks["qd"]], atol=1e-4)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_hard_constraints_hold(seed: int) -> None:
    """J_foot q̇ = 0 (the cure of an erratum), joint bounds, |ΔZ| ≤ limit; the ZMP reported is that of the motion."""
    problem = random_problem(seed)
    plan = solve(problem)
    t = problem.tasks
    assert_allclose(t.foot_jacobian @ plan.joint_velocity, 0.0, atol=1e-7)
    assert (plan.joint_velocity >= t.lower - 1e-7).all()
    assert (plan.joint_velocity <= t.upper + 1e-7).all()
    assert np.abs(plan.delta_z).max() <= problem.delta_z_limit + 1e-9
    model = problem.zmp
    zmp = model.a[:, None] * plan.com - model.b[:, None] * plan.acceleration + model.offset + plan.delta_z
    assert_allclose(plan.zmp, zmp, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(x=st.floats(-0.02, 0.02), y=st.floats(-0.02, 0.02), vx=st.floats(-0.06, 0.06), vy=st.floats(-0.06, 0.06))
def test_zmp_stays_in_the_polygon_at_every_knot(x: float, y: float, vx: float, vy: float) -> None:
    """[M] eq. ZMP-constraint, from any state that the feet can catch (capture point inside)."""
    centre = POLYGON.centre
    plan = solve(still(state=np.array([[centre[0] + x, vx, 0.0], [centre[1] + y, vy, 0.0]]), delta_z_limit=0.0))
    assert max(POLYGON.excess(z) for z in plan.zmp) < 2e-4
    assert_allclose(plan.delta_z, 0.0, atol=0)


def test_without_the_foot_rows_only_the_base_would_move() -> None:
    """Erratum: [M] eq. formul has no J_foot q̇ = 0; a hand's velocity is then met by drifting off with the base."""
    tasks = velocity_tasks()
    tasks = replace(tasks, hand_active=np.array([1.0, 0.0]), hand_velocity=np.array([0.1, 0, 0, 0, 0, 0]))
    with_feet = solve(still(tasks=tasks))
    without = solve(still(tasks=replace(tasks, foot_jacobian=np.zeros((12, ROBOT.nv)))))
    slip = np.abs(tasks.foot_jacobian @ without.joint_velocity).max()
    assert slip > 0.02  # [m/s]
    assert np.abs(tasks.foot_jacobian @ with_feet.joint_velocity).max() < 1e-8


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
    """A hand reference `distance` beyond the toes, d = 0.15 m, from the fourth knot on."""
    reach = FREE_HANDS.copy()
    reach[0, 8:] = [TOES + distance, 0.0]
    return still(reach=reach)


def test_a_hand_within_reach_needs_no_shift() -> None:
    assert np.abs(solve(leaning(0.10)).delta_z).max() < 1e-4


def test_a_hand_beyond_reach_forces_the_com_past_the_toes_and_asks_for_a_shift() -> None:
    """[M] stage 2: |R − C| ≤ d pulls the CoM along, and ΔZ ≠ 0 says that the feet alone cannot hold it."""
    plan = solve(leaning(0.20))
    assert plan.com[-1, 0] > TOES + 0.03
    assert plan.delta_z[-1, 0] < -0.03  # back to the feet
    assert max(POLYGON.excess(z) for z in plan.zmp) < 1e-3


def test_without_help_the_feet_come_first_and_the_hand_stays_short() -> None:
    plan = solve(replace(leaning(0.20), delta_z_limit=0.0))
    assert max(POLYGON.excess(z) for z in plan.zmp) < 1e-3
    assert plan.com[8:12, 0].max() < TOES + 0.02  # d asks for TOES + 0.05


def test_a_plan_without_help_can_be_stopped_at_its_end() -> None:
    """The capture point at the last knot lies over the feet; otherwise no later plan can save the robot."""
    plan = solve(replace(leaning(0.20), delta_z_limit=0.0))
    assert POLYGON.excess(plan.com[-1] + plan.velocity[-1] * np.sqrt(0.264 / GRAVITY)) < 0.018  # on the soles


def test_a_known_force_lets_the_com_past_the_toes() -> None:
    """Case a of the paper: with the brace's force in a, b and j the same lean needs no ΔZ."""
    m, lift, x, z = ROBOT.mass, 8.0, 0.27, 0.20
    point, force = np.tile([x, 0.0, z], (N, 1)), np.tile([0.0, 0.0, lift], (N, 1))
    zero = np.zeros(N)
    a, b = PREVIEW.zmp_gains(height=np.full(N, 0.264), vertical_acceleration=zero, vertical_force=force[:, 2], mass=m)
    offset = PREVIEW.zmp_offset(
        point=point, force=force, vertical_acceleration=zero, vertical_force=force[:, 2], mass=m, plane_height=0.0
    )
    # moments about the foremost place of the pressure, at rest: how far out the CoM may be
    front = POLYGON.offsets[np.argmax(POLYGON.normals[:, 0])]
    outmost = front + lift * (x - front) / (m * GRAVITY)
    assert outmost > TOES + 0.03
    state = np.array([[outmost - 0.003, 0.0, 0.0], [POLYGON.centre[1], 0.0, 0.0]])
    braced = solve(still(state=state, zmp=ZmpModel(a, b, offset), delta_z_limit=0.0))
    assert max(POLYGON.excess(z) for z in braced.zmp) < 1e-4
    assert braced.com[:, 0].max() < outmost + 1e-4
    unaided = solve(still(state=state, delta_z_limit=0.0))
    assert max(POLYGON.excess(z) for z in unaided.zmp) > 0.005 or unaided.com[-1, 0] > outmost + 0.1


def test_infeasible_rows_are_a_status() -> None:
    tasks = velocity_tasks()
    lower, upper = np.full(ROBOT.nv, -0.01), np.full(ROBOT.nv, 0.01)
    foot_velocity = np.zeros(12)
    foot_velocity[0] = 1.0  # a metre a second with joints that may not move
    problem = still(tasks=replace(tasks, lower=lower, upper=upper, foot_velocity=foot_velocity))
    stage = WholeBodyStage(PREVIEW, ROBOT.nv, SETTINGS, backend="daqp")
    arguments = {name: getattr(problem, name) for name in problem.__dataclass_fields__ if name != "state"}
    plan, solution = stage.solve(problem.state, velocity_time=TAU, **arguments)
    assert plan is None
    assert solution.status == SolveStatus.INFEASIBLE
    solve(still(), stage)  # the next problem is solved again


def test_a_stage_forgets_its_last_problem() -> None:
    """Warm starts change no answer."""
    stage = WholeBodyStage(PREVIEW, ROBOT.nv, SETTINGS, backend="daqp")
    solve(random_problem(1), stage)
    again = solve(random_problem(2), stage)
    assert_allclose(again.com, solve(random_problem(2)).com, atol=1e-7)


def test_backends_agree() -> None:
    problem = random_problem(3)
    other = solve(problem, WholeBodyStage(PREVIEW, ROBOT.nv, SETTINGS, backend="osqp"))
    assert_allclose(other.com, solve(problem).com, atol=5e-4)
