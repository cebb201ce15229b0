"""Stage 1 against the same problem written in states and solved by another solver, and what it promises."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from reference_qp import ReferenceQp

from wbmpc.planner.com_height import ComHeightStage, HeightPlan
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import HeightSettings
from wbmpc.signals import SolveStatus, Vector

N, T = 16, 0.1
PREVIEW = Preview(steps=N, step=T)
SETTINGS = HeightSettings()
LIMITS = (0.16, 0.275)
OPEN = np.tile([-np.inf, np.inf], (N, 1))
EYE = np.eye(N)


def stage(**changes: float) -> ComHeightStage:
    return ComHeightStage(PREVIEW, SETTINGS.model_copy(update=changes), backend="daqp")


def solve(
    problem: ComHeightStage, state: Vector, wanted: Vector, limits: tuple[float, float], band: Vector
) -> HeightPlan:
    plan, solution = problem.solve(state, wanted=wanted, limits=limits, band=band)
    assert plan is not None
    assert solution.status == SolveStatus.SOLVED
    return plan


def cost(s: HeightSettings, plan: HeightPlan, wanted: Vector, limits: tuple[float, float], band: Vector) -> float:
    """½ Σ of the weighted squares that the docstring names."""

    def outside(low: Vector | float, high: Vector | float) -> float:
        return float(np.sum(np.maximum(0.0, np.maximum(low - plan.height, plan.height - high)) ** 2))

    return 0.5 * (
        s.jerk_cost * float(plan.jerk @ plan.jerk)
        + s.velocity_cost * float(plan.velocity @ plan.velocity)
        + s.position_cost * float(np.sum((plan.height - wanted) ** 2))
        + s.limit_slack_cost * outside(*limits)
        + s.band_slack_cost * outside(*band.T)
    )


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_no_plan_nearby_costs_less_when_the_middle_of_the_band_has_its_share(seed: int, share: float) -> None:
    """The paper's remark: w_p ((1 − s) |C − C_posture|² + s |C − C_middle|²) as a sum of two squares."""
    rng = np.random.default_rng(seed)
    state = np.array([rng.uniform(0.20, 0.24), 0.0, 0.0])
    wanted, middle = np.full(N, rng.uniform(0.2, 0.24)), np.full(N, rng.uniform(0.2, 0.24))
    band = np.column_stack([middle - 0.06, middle + 0.06])
    plan = solve(stage(middle_share=share), state, wanted, (-np.inf, np.inf), band)

    def price(jerk: Vector) -> float:
        height, velocity = PREVIEW.P_ps @ state + PREVIEW.P_pu @ jerk, PREVIEW.P_vs @ state + PREVIEW.P_vu @ jerk
        away = (1.0 - share) * np.sum((height - wanted) ** 2) + share * np.sum((height - middle) ** 2)
        return float(
            SETTINGS.jerk_cost * jerk @ jerk
            + SETTINGS.velocity_cost * velocity @ velocity
            + SETTINGS.position_cost * away
        )

    best = price(plan.jerk)
    for _ in range(30):
        assert price(plan.jerk + rng.normal(0.0, 0.05, N)) >= best - 1e-10


def test_a_share_of_one_ends_in_the_middle_of_the_band() -> None:
    state, wanted, band = np.array([0.26, 0.0, 0.0]), np.full(N, 0.26), np.tile([0.18, 0.25], (N, 1))
    ends = [solve(stage(middle_share=s), state, wanted, LIMITS, band).height[-1] for s in (0.0, 0.5, 1.0)]
    assert ends[0] == pytest.approx(0.25, abs=2e-3)  # at the edge of the band: where it is wanted is outside
    assert ends[2] == pytest.approx(0.215, abs=2e-3)
    assert ends[2] < ends[1] < ends[0]


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_optimum_is_another_solvers(seed: int) -> None:
    """[M] eq. QP1 with the band and limits, as states tied by eq. state-eq, solved by NNLS."""
    rng = np.random.default_rng(seed)
    state = np.array([rng.uniform(0.17, 0.27), rng.uniform(-0.1, 0.1), rng.uniform(-0.3, 0.3)])
    wanted = rng.uniform(0.17, 0.27) + np.linspace(0.0, rng.uniform(-0.05, 0.05), N)
    centre = rng.uniform(0.19, 0.25) + np.linspace(0.0, rng.uniform(-0.04, 0.04), N)
    band = np.column_stack([centre - 0.02, centre + 0.02])
    plan = solve(stage(), state, wanted, LIMITS, band)

    other = ReferenceQp()
    jerk, c, dc, _ = other.axis(state, steps=N, step=T)
    other.cost([(jerk, EYE)], np.zeros(N), SETTINGS.jerk_cost)
    other.cost([(dc, EYE)], np.zeros(N), SETTINGS.velocity_cost)
    other.cost([(c, EYE)], wanted, SETTINGS.position_cost)
    other.soft_bound([(c, EYE)], np.full(N, LIMITS[0]), np.full(N, LIMITS[1]), SETTINGS.limit_slack_cost)
    other.soft_bound([(c, EYE)], band[:, 0], band[:, 1], SETTINGS.band_slack_cost)
    x, optimum = other.solve()
    assert cost(SETTINGS, plan, wanted, LIMITS, band) == pytest.approx(optimum, rel=1e-6, abs=1e-12)
    assert_allclose(plan.height, x[c], atol=1e-6)


@settings(deadline=None)
@given(height=st.floats(0.19, 0.24), velocity=st.floats(-0.05, 0.05), wanted=st.floats(0.1, 0.35))
def test_limits_and_band_are_kept(height: float, velocity: float, wanted: float) -> None:
    """Wherever the pull goes: within the legs' range, and within |c_z − r_z| ≤ d to a soft bound's slack."""
    band = np.tile([0.18, 0.25], (N, 1))
    plan = solve(stage(), np.array([height, velocity, 0.0]), np.full(N, wanted), LIMITS, band)
    assert plan.height.min() >= 0.18 - 1e-3
    assert plan.height.max() <= 0.25 + 1e-3
    free = solve(stage(), np.array([height, velocity, 0.0]), np.full(N, wanted), LIMITS, OPEN)
    assert free.height.min() >= LIMITS[0] - 1e-4
    assert free.height.max() <= LIMITS[1] + 1e-4


def test_an_end_effector_on_the_ground_brings_the_com_down() -> None:
    """The paper's own example: R lower than d below the CoM."""
    reference = np.linspace(0.10, 0.0, N)
    band = np.column_stack([reference - 0.2, reference + 0.2])
    plan = solve(stage(), np.array([0.264, 0.0, 0.0]), np.full(N, 0.264), LIMITS, band)
    assert plan.height[-1] == pytest.approx(0.2, abs=1e-3)


def test_a_start_outside_the_limits_still_has_a_plan() -> None:
    plan = solve(stage(), np.array([0.30, 0.0, 0.0]), np.full(N, 0.264), LIMITS, OPEN)
    assert plan.height[0] > LIMITS[1]
    assert plan.height[-1] <= LIMITS[1] + 1e-4


def test_end_effectors_that_disagree_meet_in_the_middle() -> None:
    """One hand wants the CoM in 0.23 … 0.27, the other in 0.17 … 0.21: the band's bounds cross."""
    band = np.tile([0.23, 0.21], (N, 1))
    plan = solve(stage(), np.array([0.26, 0.0, 0.0]), np.full(N, 0.22), LIMITS, band)
    assert plan.height[-1] == pytest.approx(0.22, abs=2e-3)


def closed_loop(problem: ComHeightStage, seconds: float) -> float:
    """Height [m] after replanning every T from a CoM that sinks slowly."""
    state = np.array([0.264, -0.02, 0.0])
    for _ in range(round(seconds / T)):
        plan = solve(problem, state, np.full(N, 0.264), LIMITS, OPEN)
        state = np.array([plan.height[0], plan.velocity[0], plan.acceleration[0]])
    return float(state[0])


def test_jerk_alone_drifts_and_the_weak_terms_are_the_cure() -> None:
    """Erratum: [M] eq. QP1 minimises the jerk alone; a small velocity then goes on until the legs end."""
    assert closed_loop(stage(position_cost=0.0, velocity_cost=0.0), 8.0) < 0.19
    assert closed_loop(stage(), 8.0) == pytest.approx(0.264, abs=1e-3)


def test_a_state_that_is_no_number_is_a_status() -> None:
    plan, solution = stage().solve(np.array([np.nan, 0.0, 0.0]), wanted=np.full(N, 0.264), limits=LIMITS, band=OPEN)
    assert plan is None
    assert solution.status == SolveStatus.NUMERICAL_ERROR


def test_the_plan_is_one_motion() -> None:
    """Height, velocity and acceleration belong to the same jerks: one Taylor step from knot to knot is exact."""
    plan = solve(stage(), np.array([0.25, 0.05, 0.1]), np.full(N, 0.22), LIMITS, OPEN)
    p, v, a, u = plan.height[:-1], plan.velocity[:-1], plan.acceleration[:-1], plan.jerk[1:]
    assert_allclose(plan.height[1:], p + T * v + T**2 / 2 * a + T**3 / 6 * u, atol=1e-12)
    assert_allclose(plan.velocity[1:], v + T * a + T**2 / 2 * u, atol=1e-12)
    assert_allclose(plan.acceleration[1:], a + T * u, atol=1e-12)
