"""Stage 2's joint velocities for a given CoM velocity, and what that CoM velocity costs them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbmpc.jit import kernel, short_kernel
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.qp import QpSolution, QuadraticProgram, make_workspace
from wbmpc.qp.cholesky import add_squares, factor, forward
from wbmpc.record import record
from wbmpc.signals import Vector

FOOT_ROWS = 12  # two soles, six rows each
AT_BOUND = 1e-9  # [m/s, rad/s] from a bound, a velocity is held by it


@record
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


@record
class VelocityCost:
    """V(v) near `at`: what a horizontal CoM velocity v (2,) [m/s] costs the joint velocities that must follow it.

    V is convex and piecewise quadratic; this is its piece at `at`, up to a constant:
    V(v) = gradientᵀ (v − at) + ½ (v − at)ᵀ curvature (v − at).
    """

    at: Vector  # (2,) [m/s]
    gradient: Vector  # (2,) [cost / (m/s)]
    curvature: Vector  # (2, 2) [cost / (m/s)²]

    def of_first_jerk(self, unmoved: Vector, gain: float) -> tuple[Vector, Vector]:
        """Gradient (2,) and curvature (2, 2) at u = 0 of V(unmoved + gain · u), were it all in the same piece."""
        gradient, curvature = np.empty(2), np.empty((2, 2))
        _of_first_jerk(self.at, self.gradient, self.curvature, unmoved, gain, gradient, curvature)
        return gradient, curvature

    def error(self, there: VelocityCost) -> float:
        """How far the slope foreseen at another piece's velocity is from the one found there [cost / (m/s)]."""
        error: float = _error(self.at, self.gradient, self.curvature, there.at, there.gradient)
        return error


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
        self._base_gradient = np.zeros(velocities)  # at no CoM velocity
        self._free, self._curvature = np.zeros(velocities, dtype=np.bool_), np.zeros((2, 2))  # of `cost`
        self.cost: VelocityCost | None = None  # as last solved for these tasks

    def take(self, tasks: VelocityTasks) -> None:
        """Turn to `tasks`; the same object again changes nothing."""
        if tasks is self._tasks:
            return
        self._tasks, self._fresh, self.cost = tasks, True, None
        qp, settings = self.problem, self._settings
        _write(
            *(qp.hessian, self._base_gradient, qp.x_lower, qp.x_upper),
            *(settings.com_velocity_cost, settings.hand_velocity_cost, settings.torso_cost, settings.foot_slack_cost),
            settings.joint_velocity_cost,
            *(tasks.com_jacobian, tasks.com_correction, tasks.com_vertical_velocity),
            *(tasks.hand_jacobian, tasks.hand_velocity, tasks.hand_active),
            *(tasks.torso_jacobian, tasks.torso_velocity),
            *(tasks.foot_jacobian, tasks.foot_velocity),
            *(tasks.posture_weight, tasks.posture_velocity, tasks.lower, tasks.upper),
        )

    def solve(self, velocity: Vector) -> tuple[QpSolution, VelocityCost | None]:
        """q̇ (nv,) for the CoM velocity `velocity` (2,) [m/s], and V there; None when the solve failed."""
        assert self._tasks is not None
        qp, weight, jacobian, fresh = (
            self.problem,
            self._settings.com_velocity_cost,
            self._tasks.com_jacobian,
            self._fresh,
        )
        _turn(qp.gradient, self._base_gradient, weight, velocity, jacobian)
        solution = self._workspace.solve(matrices_changed=fresh)
        self._fresh, self.cost = not solution.solved, None
        if solution.solved:
            self.cost = cost = VelocityCost(velocity, np.empty(2), self._curvature.copy())
            _write_cost(
                *(cost.gradient, cost.curvature, solution.x, velocity, jacobian, qp.hessian, qp.x_lower, qp.x_upper),
                *(weight, fresh, self._free),
            )
            self._curvature = cost.curvature
        return solution, self.cost


@short_kernel
def _slope(at: Vector, gradient: Vector, curvature: Vector, velocity: Vector, axis: int) -> float:
    x, y = velocity[0] - at[0], velocity[1] - at[1]
    slope: float = gradient[axis] + curvature[axis, 0] * x + curvature[axis, 1] * y
    return slope


@kernel
def _of_first_jerk(
    at: Vector, gradient: Vector, curvature: Vector, unmoved: Vector, gain: float, slope: Vector, growth: Vector
) -> None:
    for axis in range(2):
        slope[axis] = gain * _slope(at, gradient, curvature, unmoved, axis)
        for other in range(2):
            growth[axis, other] = gain * gain * curvature[axis, other]


@kernel
def _error(at: Vector, gradient: Vector, curvature: Vector, velocity: Vector, found: Vector) -> float:
    worst = 0.0
    for axis in range(2):
        worst = max(worst, abs(found[axis] - _slope(at, gradient, curvature, velocity, axis)))
    return worst


@kernel
def _turn(gradient: Vector, base: Vector, weight: float, velocity: Vector, jacobian: Vector) -> None:
    """Gradient for a horizontal CoM velocity: −w Jᵀ v added to `base`."""
    pull = velocity @ jacobian[:2]
    for i in range(len(gradient)):
        gradient[i] = base[i] - weight * pull[i]


@kernel
def _write(
    hessian: Vector,
    gradient: Vector,
    x_lower: Vector,
    x_upper: Vector,
    com_cost: float,
    hand_cost: float,
    torso_cost: float,
    foot_cost: float,
    joint_cost: float,
    com: Vector,
    com_correction: Vector,
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
    lower: Vector,
    upper: Vector,
) -> None:
    """Bounds, Hessian, and the gradient at v = 0: Σ w Jᵀ J and −Σ w Jᵀ v of all tasks."""
    nv = len(gradient)
    jacobian, wanted, weight = np.empty((12 + len(foot), nv)), np.zeros(12 + len(foot)), np.empty(12 + len(foot))
    jacobian[:3], wanted[2], weight[:3] = com, com_correction[2] + com_z, com_cost
    rows = 3
    for side in range(2):
        if hand_active[side] != 0.0:
            task = slice(3 * side, 3 * side + 3)
            jacobian[rows : rows + 3], wanted[rows : rows + 3] = hand[task], hand_velocity[task]
            weight[rows : rows + 3] = hand_cost * hand_active[side]
            rows += 3
    jacobian[rows : rows + 3], wanted[rows : rows + 3], weight[rows : rows + 3] = torso, torso_velocity, torso_cost
    rows += 3
    end = rows + len(foot)
    jacobian[rows:end], wanted[rows:end], weight[rows:end] = foot, foot_velocity, foot_cost
    hessian[:], gradient[:] = 0.0, 0.0
    add_squares(hessian, gradient, jacobian[:end], wanted, weight)
    for i in range(nv):
        hessian[i, i] += joint_cost * posture_weight[i]
        gradient[i] -= joint_cost * posture_weight[i] * posture_velocity[i]
        x_lower[i], x_upper[i] = lower[i], upper[i]
        for j in range(i):
            hessian[j, i] = hessian[i, j]


@kernel
def _write_cost(
    slope: Vector,
    curvature: Vector,
    x: Vector,
    velocity: Vector,
    jacobian: Vector,
    hessian: Vector,
    lower: Vector,
    upper: Vector,
    weight: float,
    fresh: bool,
    free: NDArray[np.bool_],
) -> None:
    """Gradient (2,) and curvature (2, 2) of V at the solution x: the joints at their bounds stay there.

    ∇V = w (v − J q̇),   ∇²V = w (1 − w J_f H_ff⁻¹ J_fᵀ)   over the joints f that are free. `free` (nv,) is those of the
    last solve and becomes this one's; the curvature stays if they are the same and the matrices not `fresh`.
    """
    changed = fresh
    for a in range(2):
        slope[a] = velocity[a]
    for i in range(len(x)):
        for a in range(2):
            slope[a] -= jacobian[a, i] * x[i]
        is_free = lower[i] + AT_BOUND < x[i] < upper[i] - AT_BOUND
        changed |= free[i] != is_free
        free[i] = is_free
    for a in range(2):
        slope[a] *= weight
    if not changed:
        return
    joints = np.flatnonzero(free)
    count = len(joints)
    U, follows = np.empty((count, count)), np.empty((2, count))
    for f in range(count):
        for a in range(2):
            follows[a, f] = jacobian[a, joints[f]]
        for g in range(f, count):
            U[f, g] = hessian[joints[f], joints[g]]
    factor(U, count)
    for a in range(2):
        forward(U, follows[a], count)
    for a in range(2):
        for b in range(2):
            curvature[a, b] = weight if a == b else 0.0
            for f in range(count):
                curvature[a, b] -= weight * weight * follows[a, f] * follows[b, f]
