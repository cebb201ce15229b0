"""Stage 2's joint velocities for a given CoM velocity, and what that CoM velocity costs them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.jit import kernel
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.qp.cholesky import factor, forward
from wbmpc.signals import Vector

FOOT_ROWS = 12  # two soles, six rows each
AT_BOUND = 1e-9  # [m/s, rad/s] from a bound, a velocity is held by it


@dataclass(frozen=True, slots=True)
class VelocityTasks:
    """What stage 2's joint velocities q̇ should do now, linearised at the planner's own configuration."""

    com_jacobian: Vector  # (3, nv) in world
    com_correction: Vector  # (3,) [m/s] added to the planned CoM velocity: closes the loop of the joint reference
    com_vertical_velocity: float  # [m/s] stage 1's ċ_z
    foot_jacobian: Vector  # (12, nv) left then right sole, linear then angular
    foot_velocity: Vector  # (12,) [m/s, rad/s] zero for a stance foot
    hand_jacobian: Vector  # (6, nv) left then right palm, linear
    hand_velocity: Vector  # (6,) [m/s]
    hand_active: Vector  # (2,) 1 for a hand with a reference, else 0
    torso_jacobian: Vector  # (3, nv) angular
    torso_velocity: Vector  # (3,) [rad/s] towards upright
    posture_velocity: Vector  # (nv,) [rad/s] towards the nominal posture; base entries zero
    posture_weight: Vector  # (nv,) factor on α₃ of each coordinate
    lower: Vector  # (nv,) [m/s, rad/s] bounds on q̇ from joint speed and position limits
    upper: Vector  # (nv,)


@dataclass(frozen=True, slots=True)
class VelocityCost:
    """V(v) near `at`: what a horizontal CoM velocity v (2,) [m/s] costs the joint velocities that must follow it.

    V is convex and piecewise quadratic; this is its piece at `at`, up to a constant:
    V(v) = gradientᵀ (v − at) + ½ (v − at)ᵀ curvature (v − at).
    """

    at: Vector  # (2,) [m/s]
    gradient: Vector  # (2,) [cost / (m/s)]
    curvature: Vector  # (2, 2) [cost / (m/s)²]

    def slope(self, velocity: Vector) -> Vector:
        """Gradient (2,) at `velocity` (2,), were it in the same piece."""
        slope: Vector = self.gradient + self.curvature @ (velocity - self.at)
        return slope


class JointVelocities:
    """minimise  α₃|q̇ − q̇_posture|²_W + α₄|J_com q̇ − (v, ċ_z)|² + α₅ Σ|J_hand q̇ − V_hand|²
                 + w_t|J_torso q̇ − ω_up|² + w_foot|J_foot q̇ − v_foot|²   subject to   q̇_low ≤ q̇ ≤ q̇_high

    for a horizontal CoM velocity v. The minimum V(v) is all that the CoM's motion has to know of the joints.
    """

    def __init__(self, velocities: int, settings: WholeBodySettings, *, backend: str) -> None:
        """`velocities`: nv."""
        self._settings = settings
        self.problem = QuadraticProgram(velocities, 0)
        self._workspace = make_workspace(backend, self.problem)
        self._tasks: VelocityTasks | None = None
        self._fresh = True
        self._base_gradient = np.zeros(velocities)
        self.cost: VelocityCost | None = None  # as last solved for these tasks

    def take(self, tasks: VelocityTasks) -> None:
        """Turn to `tasks`; the same object again changes nothing."""
        if tasks is self._tasks:
            return
        self._tasks, self._fresh, self.cost = tasks, True, None
        qp, settings = self.problem, self._settings
        _write(
            *(qp.hessian, self._base_gradient),
            *(settings.com_velocity_cost, settings.hand_velocity_cost, settings.torso_cost, settings.foot_slack_cost),
            settings.joint_velocity_cost,
            *(tasks.com_jacobian, tasks.com_correction[2] + tasks.com_vertical_velocity),
            *(tasks.hand_jacobian, tasks.hand_velocity, tasks.hand_active),
            *(tasks.torso_jacobian, tasks.torso_velocity),
            *(tasks.foot_jacobian, tasks.foot_velocity),
            *(tasks.posture_weight, tasks.posture_velocity),
        )
        qp.x_lower[:], qp.x_upper[:] = tasks.lower, tasks.upper

    def solve(self, velocity: Vector) -> tuple[QpSolution, VelocityCost | None]:
        """q̇ (nv,) for the CoM velocity `velocity` (2,) [m/s], and V there; None when the solve failed."""
        assert self._tasks is not None
        qp, weight, jacobian = self.problem, self._settings.com_velocity_cost, self._tasks.com_jacobian
        qp.gradient[:] = self._base_gradient - weight * (velocity @ jacobian[:2])
        solution = self._workspace.solve(matrices_changed=self._fresh)
        self._fresh, self.cost = not solution.solved, None
        if solution.solved:
            slope, curvature = _cost(solution.x, velocity, jacobian, qp.hessian, qp.x_lower, qp.x_upper, weight)
            self.cost = VelocityCost(velocity, slope, curvature)
        return solution, self.cost


@kernel
def _write(
    hessian: Vector,
    gradient: Vector,
    com_cost: float,
    hand_cost: float,
    torso_cost: float,
    foot_cost: float,
    joint_cost: float,
    com: Vector,
    com_z: float,
    hand: Vector,
    hand_velocity: Vector,
    hand_active: Vector,
    torso: Vector,
    torso_velocity: Vector,
    foot: Vector,
    foot_velocity: Vector,
    posture_weight: Vector,
    posture_velocity: Vector,
) -> None:
    """Hessian, and the gradient at v = 0: Σ w Jᵀ J and −Σ w Jᵀ v of all tasks."""
    nv = len(gradient)
    jacobian, wanted, weight = np.empty((12 + len(foot), nv)), np.zeros(12 + len(foot)), np.empty(12 + len(foot))
    jacobian[:3], jacobian[3:9], jacobian[9:12], jacobian[12:] = com, hand, torso, foot
    wanted[2], wanted[3:9], wanted[9:12], wanted[12:] = com_z, hand_velocity, torso_velocity, foot_velocity
    weight[:3], weight[9:12], weight[12:] = com_cost, torso_cost, foot_cost
    for i in range(6):
        weight[3 + i] = hand_cost * hand_active[i // 3]
    hessian[:] = 0.0
    gradient[:] = 0.0
    for row in range(len(weight)):
        if weight[row] == 0.0:
            continue
        for i in range(nv):
            scaled = weight[row] * jacobian[row, i]
            gradient[i] -= scaled * wanted[row]
            for j in range(i + 1):
                hessian[i, j] += scaled * jacobian[row, j]
    for i in range(nv):
        hessian[i, i] += joint_cost * posture_weight[i]
        gradient[i] -= joint_cost * posture_weight[i] * posture_velocity[i]
        for j in range(i):
            hessian[j, i] = hessian[i, j]


@kernel
def _cost(
    x: Vector, velocity: Vector, jacobian: Vector, hessian: Vector, lower: Vector, upper: Vector, weight: float
) -> tuple[Vector, Vector]:
    """Gradient (2,) and curvature (2, 2) of V at the solution x: the joints at their bounds stay there.

    ∇V = w (v − J q̇),   ∇²V = w (1 − w J_f H_ff⁻¹ J_fᵀ)   over the joints f that are free.
    """
    count, free = 0, np.empty(len(x), np.int64)
    slope, curvature = velocity.copy(), np.zeros((2, 2))
    for i in range(len(x)):
        for a in range(2):
            slope[a] -= jacobian[a, i] * x[i]
        if lower[i] + AT_BOUND < x[i] < upper[i] - AT_BOUND:
            free[count] = i
            count += 1
    U, follows = np.empty((count, count)), np.empty((2, count))
    for f in range(count):
        for a in range(2):
            follows[a, f] = jacobian[a, free[f]]
        for g in range(f, count):
            U[f, g] = hessian[free[f], free[g]]
    factor(U, count)
    for a in range(2):
        forward(U, follows[a], count)
    for a in range(2):
        slope[a] *= weight
        curvature[a, a] = weight
        for b in range(2):
            for f in range(count):
                curvature[a, b] -= weight * weight * follows[a, f] * follows[b, f]
    return slope, curvature
