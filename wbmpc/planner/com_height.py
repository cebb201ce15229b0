"""Stage 1: the CoM height over the horizon, inside the kinematic band of hands and feet ([M] eq. QP1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import HeightSettings
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.signals import SolveStatus, Vector


@dataclass(frozen=True, slots=True)
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
        self._preview = preview
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
        settings, steps = self._settings, self._preview.steps
        limits = np.tile([plane + settings.lowest, plane + settings.highest], (steps, 1))
        plan, solution = self.solve(state, wanted=wanted, limits=limits, band=band)
        if plan is None or not settings.enabled:
            state[1:] = 0.0
            zero = np.zeros(steps)
            plan = HeightPlan(zero, np.full(steps, state[0]), zero, zero)
        return plan, solution

    def solve(
        self, state: Vector, *, wanted: Vector, limits: Vector, band: Vector
    ) -> tuple[HeightPlan | None, QpSolution]:
        """Plan the height from `state` (3,) = (c_z, ċ_z, c̈_z).

        Args:
            state: [m, m/s, m/s²] in world.
            wanted: (N,) height to stay near [m].
            limits: (N, 2) lowest and highest height the legs allow [m].
            band: (N, 2) admissible band of the end-effectors, R ± d [m]; ±inf where nothing binds.

        Returns:
            The plan, or None when the solve failed (the solution carries the status).
        """
        preview, settings, qp = self._preview, self._settings, self.problem
        drift = preview.P_ps @ state
        n = preview.steps
        qp.lower[:n], qp.upper[:n] = limits[:, 0] - drift, limits[:, 1] - drift
        low, high = band[:, 0], band[:, 1]
        if settings.middle_share and np.isfinite(band).all():
            wanted = wanted + settings.middle_share * (0.5 * (low + high) - wanted)
        qp.gradient[:] = settings.velocity_cost * (preview.P_vu.T @ (preview.P_vs @ state)) + settings.position_cost * (
            preview.P_pu.T @ (drift - wanted)
        )
        crossed = low > high
        if crossed.any():  # two end-effectors disagree: the compromise between them
            low, high = low.copy(), high.copy()
            low[crossed] = high[crossed] = 0.5 * (low + high)[crossed]
        qp.lower[n:], qp.upper[n:] = low - drift, high - drift
        solution = self._workspace.solve(matrices_changed=self._fresh)
        self._fresh = False
        if solution.status != SolveStatus.SOLVED:
            return None, solution
        jerk = solution.x.copy()
        return (
            HeightPlan(
                jerk=jerk,
                height=drift + preview.P_pu @ jerk,
                velocity=preview.P_vs @ state + preview.P_vu @ jerk,
                acceleration=preview.P_as @ state + preview.P_au @ jerk,
            ),
            solution,
        )
