"""The N-step prediction of one CoM axis under piecewise constant jerk (Herdt et al. 2010)."""

from __future__ import annotations

import numpy as np

from wbmpc.signals import Vector


class Preview:
    """Matrices that map a state (c, ċ, c̈) and N jerks to N positions, velocities and accelerations.

    For one axis with state x = (c, ċ, c̈) and jerks U (N,), held for T each ([M] eq. N-preview-Cz and its derivatives):

        C   = P_ps x + P_pu U        (N,) [m]
        Ċ   = P_vs x + P_vu U        (N,) [m/s]
        C̈   = P_as x + P_au U        (N,) [m/s²]

    Knot k = 1 … N lies at time k T after the state.
    """

    def __init__(self, *, steps: int, step: float) -> None:
        """Build the matrices for `steps` knots (≥ 1) of `step` seconds."""
        if steps < 1 or step <= 0.0:
            raise ValueError(f"a preview needs steps >= 1 and step > 0, received {steps} and {step}")
        self.steps = steps
        self.step = step  # [s]
        time = step * np.arange(1.0, steps + 1.0)
        self.times: Vector = time  # (N,) [s]
        self.P_ps = np.column_stack([np.ones(steps), time, time**2 / 2])  # (N, 3)
        self.P_vs = np.column_stack([np.zeros(steps), np.ones(steps), time])
        self.P_as = np.column_stack([np.zeros(steps), np.zeros(steps), np.ones(steps)])
        lag = np.subtract.outer(np.arange(steps), np.arange(steps)).astype(float)  # n = i - j
        past = lag >= 0
        self.P_pu = np.where(past, (1 + 3 * lag + 3 * lag**2) * step**3 / 6, 0.0)  # (N, N)
        self.P_vu = np.where(past, (1 + 2 * lag) * step**2 / 2, 0.0)
        self.P_au = np.where(past, step, 0.0)

    def zmp_matrices(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        """P_zs (N, 3) and P_zu (N, N) of Z = P_zs x + P_zu U + j, [M] eq. Pz-eqs.

        Every entry of row i uses a, b of row i (the paper prints a_{k+1} on the last diagonal).
        """
        return a[:, None] * self.P_ps - b[:, None] * self.P_as, a[:, None] * self.P_pu - b[:, None] * self.P_au
