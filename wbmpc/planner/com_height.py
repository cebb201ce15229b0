"""Stage 1: the CoM height over the horizon, inside the kinematic band of hands and feet ([M] eq. QP1)."""

from __future__ import annotations

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import HeightSettings
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.record import record
from wbmpc.signals import SolveStatus, Vector


@record
class HeightPlan:
    """Stage 1's answer over the horizon, all (N,)."""

    jerk: Vector  # [m/s³]
    height: Vector  # [m] in world
    velocity: Vector  # [m/s]
    acceleration: Vector  # [m/s²]


class ComHeightStage:
    """minimise  w_j |U|² + w_v |Ċ|² + w_p |C − C_wanted|²  over the vertical jerks U (N,)

    subject to  C_low ≤ C ≤ C_high   hard kinematic bounds of the legs (soft with a very large weight, so that a
                                     state outside them still has a plan), and
                R − d ≤ C ≤ R + d    the band of [M] eq. QP1 (soft: two end-effectors may disagree).

    The paper minimises the jerk alone; that drifts inside the band, hence the weak velocity and position terms.
    C_wanted is what the postures of tasks and contacts say; a `middle_share` of the weight goes to the middle of the
    band instead, the paper's own remark: w_p ((1 − s) |C − C_posture|² + s |C − C_middle|²), up to a constant.
    """

    def __init__(self, preview: Preview, settings: HeightSettings, *, backend: str) -> None:
        n = preview.steps
        self._steps = n
        self._of_state = np.array([preview.P_ps, preview.P_vs, preview.P_as])  # (3, N, 3)
        self._of_jerks = np.array([preview.P_pu, preview.P_vu, preview.P_au])  # (3, N, N)
        self._settings = settings
        weights = np.concatenate([np.full(n, settings.limit_slack_cost), np.full(n, settings.band_slack_cost)])
        self.problem = QuadraticProgram(n, 2 * n, soft_weight=weights)
        self.problem.hessian[:] = (
            settings.jerk_cost * np.eye(n)
            + settings.velocity_cost * preview.P_vu.T @ preview.P_vu
            + settings.position_cost * preview.P_pu.T @ preview.P_pu
        )
        self.problem.matrix[:n] = self.problem.matrix[n:] = preview.P_pu
        self.problem.x_lower[:], self.problem.x_upper[:] = -np.inf, np.inf
        self._workspace = make_workspace(backend, self.problem)
        self._fresh = True

    def plan(self, state: Vector, *, wanted: Vector, band: Vector, plane: float) -> tuple[HeightPlan, QpSolution]:
        """`solve` within the legs' range over the feet at `plane` [m]; the height stays when it fails or is turned off.

        `state` (3,) is brought to rest in that case.
        """
        settings = self._settings
        limits = (plane + settings.lowest, plane + settings.highest)
        plan, solution = self.solve(state, wanted=wanted, limits=limits, band=band)
        if plan is None or not settings.enabled:
            state[1:] = 0.0
            zero = np.zeros(self._steps)
            plan = HeightPlan(zero, np.full(self._steps, state[0]), zero, zero)
        return plan, solution

    def solve(
        self, state: Vector, *, wanted: Vector, limits: tuple[float, float], band: Vector
    ) -> tuple[HeightPlan | None, QpSolution]:
        """Plan the height from `state` (3,) = (c_z, ċ_z, c̈_z).

        Args:
            state: [m, m/s, m/s²] in world.
            wanted: (N,) height to stay near [m].
            limits: lowest and highest height the legs allow [m].
            band: (N, 2) admissible band of the end-effectors, R ± d [m]; ±inf where nothing binds.

        Returns:
            The plan, or None when the solve failed (the solution carries the status).
        """
        settings, qp, state = self._settings, self.problem, np.ascontiguousarray(state)
        _write(
            *(qp.gradient, qp.lower, qp.upper, self._of_state, self._of_jerks, state, wanted, *limits, band),
            *(settings.velocity_cost, settings.position_cost, settings.middle_share),
        )
        solution = self._workspace.solve(matrices_changed=self._fresh)
        self._fresh = False
        if solution.status != SolveStatus.SOLVED:
            return None, solution
        jerk = solution.x.copy()
        return HeightPlan(jerk, *_read(self._of_state, self._of_jerks, state, jerk)), solution


@kernel
def _write(
    gradient: Vector,
    lower: Vector,
    upper: Vector,
    of_state: Vector,
    of_jerks: Vector,
    state: Vector,
    wanted: Vector,
    lowest: float,
    highest: float,
    band: Vector,
    velocity_cost: float,
    position_cost: float,
    middle_share: float,
) -> None:
    """Gradient (N,) and bounds (2 N,) of the problem; where two end-effectors disagree, the compromise between them.

    `of_state` (3, N, 3), `of_jerks` (3, N, N): the matrices of `Preview` for position, velocity and acceleration.
    """
    n = len(gradient)
    drift, error = of_state[0] @ state, np.empty(n)
    share = middle_share if np.isfinite(band).all() else 0.0
    for k in range(n):
        low, high = band[k]
        error[k] = drift[k] - (wanted[k] + share * (0.5 * (low + high) - wanted[k]) if share > 0.0 else wanted[k])
        if low > high:
            low = high = 0.5 * (low + high)
        lower[k], upper[k] = lowest - drift[k], highest - drift[k]
        lower[n + k], upper[n + k] = low - drift[k], high - drift[k]
    slope, pull = of_jerks[1].T @ (of_state[1] @ state), of_jerks[0].T @ error
    for k in range(n):
        gradient[k] = velocity_cost * slope[k] + position_cost * pull[k]


@kernel
def _read(of_state: Vector, of_jerks: Vector, state: Vector, jerk: Vector) -> tuple[Vector, Vector, Vector]:
    """Height, velocity and acceleration (N,) under the jerks (N,)."""
    return (
        of_state[0] @ state + of_jerks[0] @ jerk,
        of_state[1] @ state + of_jerks[1] @ jerk,
        of_state[2] @ state + of_jerks[2] @ jerk,
    )
