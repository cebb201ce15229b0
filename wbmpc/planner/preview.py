"""The N-step prediction of one CoM axis under piecewise constant jerk (Herdt et al. 2010)."""

from __future__ import annotations

import numpy as np

from wbmpc.signals import GRAVITY, Vector


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

    def zmp_gains(
        self, *, height: Vector, vertical_acceleration: Vector, vertical_force: Vector, mass: float
    ) -> tuple[Vector, Vector]:
        """Gains a, b (N,) of Z = a c − b c̈ + j, [M] eq. ak_bk_qk.

        Args:
            height: (N,) CoM above the ZMP plane [m].
            vertical_acceleration: (N,) c̈_z [m/s²].
            vertical_force: (N,) f_z of the external contact on the robot [N]; zero for the contact-free ZMP.
            mass: of the robot [kg].

        With no force a = 1 and b = c_z / (g + c̈_z): the exact contact-free ZMP, of which the paper's
        LIPM ZMP is the special case c̈_z = 0.
        """
        denominator = mass * (vertical_acceleration + GRAVITY) - vertical_force  # the feet's vertical force
        return mass * (GRAVITY + vertical_acceleration) / denominator, mass * height / denominator

    def zmp_offset(
        self,
        *,
        point: Vector,
        force: Vector,
        vertical_acceleration: Vector,
        vertical_force: Vector,
        mass: float,
        plane_height: float,
    ) -> Vector:
        """One force's part (N, 2) of j in Z = a c − b c̈ + j [m], [M] eq. ak_bk_qk with the erratum of docs/paper.md.

        Args:
            point: (N, 3) where the force acts, in world [m].
            force: (N, 3) on the robot, in world [N].
            vertical_acceleration: (N,) c̈_z [m/s²].
            vertical_force: (N,) f_z of all contacts together [N].
            mass: of the robot [kg].
            plane_height: height of the ZMP plane in world [m].
        """
        denominator = mass * (vertical_acceleration + GRAVITY) - vertical_force
        lever = point[:, 2] - plane_height
        return (lever[:, None] * force[:, :2] - point[:, :2] * force[:, 2:]) / denominator[:, None]

    def zmp_matrices(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        """P_zs (N, 3) and P_zu (N, N) of Z = P_zs x + P_zu U + j, [M] eq. Pz-eqs.

        Every entry of row i uses a, b of row i (the paper prints a_{k+1} on the last diagonal).
        """
        return a[:, None] * self.P_ps - b[:, None] * self.P_as, a[:, None] * self.P_pu - b[:, None] * self.P_au
