"""The joint-level inverse-dynamics tracker: one QP over accelerations and contact forces per tick."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from scipy.linalg.lapack import dposv

from wbmpc.kinematics import Kinematics
from wbmpc.qp import QuadraticProgram, make_workspace
from wbmpc.robot import Robot
from wbmpc.rotations import contact_frame
from wbmpc.signals import RobotState, Setpoint, TorqueCommand, Vector
from wbmpc.tracker.clearance import CLEARANCE_ROWS, Clearance
from wbmpc.tracker.constraints import (
    PALM_ROWS,
    PRESSURE_ROWS,
    WRENCH_ROWS,
    JointLimits,
    palm_force_rows,
    pressure_rows,
    sole_wrench_rows,
)
from wbmpc.tracker.reflex import TouchReflex
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tasks import CARRY, CONTACT, TaskStack

FORCES = 18  # two sole wrenches (6 each), then two palm forces (3 each), each in its contact's own frame
WORLD = np.eye(3)  # rotation of a force that is given in world
SENSED_SHARE = 0.2  # per tick, of the filtered palm force
FRICTION_SPEED = 0.1  # [rad/s] wanted speed from which a joint's dry friction is fully compensated
TORQUE_SLACK_COST = 1e4  # [cost / (N·m)²]; what a violated row would ask is clipped by the servo's limit anyway


class Tracker:
    """minimise  Σ w |J v̇ − a|²  +  w_p |q̈ − q̈_posture|²  +  w_f |F − F_plan|²

    subject to  M v̇ + h = [0; τ] + J_cᵀ F     floating base and joints,
                W F ≤ 0                        wrench cones of the soles, friction pyramids of the palms,
                τ_low(q̇) ≤ τ ≤ τ_high(q̇)       the servo's torque-speed line (soft, then clipped),
                q̈_low ≤ q̈ ≤ q̈_high             joint position and speed limits,
                C v̇ ≥ c                         arms off the trunk and off the wall (soft).

    The six base rows give v̇_base = M_bb⁻¹ (J_cbᵀ F − h_b − M_bj q̈), which eliminates them; the unknowns are
    y = (q̈ (nj), F (18)) and the torques follow from the joint rows.

    A failed solve repeats the last torque with some joint damping; it is marked `fallback` and counted.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings, *, step: float) -> None:
        """`step` is the tick's length [s]."""
        nj = robot.nj
        self._robot, self._settings = robot, settings
        self._kinematics = Kinematics(robot)
        self._tasks = TaskStack(robot, settings, step=step)
        self._limits = JointLimits(
            robot,
            speed_limit=settings.joint_velocity_limit,
            horizon=settings.limit_horizon,
            torque_share=settings.torque_share,
        )
        self._torque_rows = slice(0, nj)
        self._palm_rows = slice(nj + 2 * WRENCH_ROWS, nj + 2 * WRENCH_ROWS + 2 * PALM_ROWS)
        comfort_rows = slice(self._palm_rows.stop, self._palm_rows.stop + 2 * PRESSURE_ROWS)
        self._clearance_rows = slice(comfort_rows.stop, comfort_rows.stop + CLEARANCE_ROWS)
        self._clearance = Clearance(robot, settings)
        self._reflex = TouchReflex()
        rows = self._clearance_rows.stop
        soft = np.zeros(rows)
        soft[self._clearance_rows] = settings.clearance_weight
        soft[self._torque_rows] = TORQUE_SLACK_COST
        soft[comfort_rows] = settings.foot_comfort_weight
        self.problem = QuadraticProgram(nj + FORCES, rows, soft_weight=soft)
        self.problem.upper[nj : self._clearance_rows.start] = 0.0
        wrench_rows = sole_wrench_rows(
            half_extents=robot.sole_half_extents - settings.foot_inset,
            friction=settings.foot_friction,
            yaw_radius=settings.foot_yaw_radius,
        )
        for side in range(2):
            first = nj + side * WRENCH_ROWS
            wrench = slice(nj + 6 * side, nj + 6 * side + 6)
            self.problem.matrix[first : first + WRENCH_ROWS, wrench] = wrench_rows
            first = comfort_rows.start + side * PRESSURE_ROWS
            self.problem.matrix[first : first + PRESSURE_ROWS, wrench] = pressure_rows(
                robot.sole_half_extents - settings.foot_comfort_inset
            )
        self._workspace = make_workspace(settings.qp_backend, self.problem)
        self._contact_jacobian = np.zeros((FORCES, robot.nv))
        self._contact_rotation = np.zeros((4, 3, 3))  # soles, then palms: contact frame to world
        self._base_map = np.zeros((6, nj + FORCES))
        self._base_right = np.zeros((6, nj + FORCES + 1), order="F")
        self._diagonal = np.zeros(nj + FORCES)
        self._reference = np.zeros(nj + FORCES)
        self._stacked = np.zeros((self._tasks.matrix.shape[0], nj + FORCES))
        self._sensed = np.zeros(2)  # [N] filtered normal force of each braced palm
        self._torque = np.zeros(nj)
        self._torque_offset = np.zeros(nj)
        self._torque_bounds = self._limits.torque(np.zeros(nj))

    def solve(self, state: RobotState, setpoint: Setpoint) -> TorqueCommand:
        """Torques for one tick. Never raises for a failed solve: see the class."""
        start = perf_counter()
        kinematics, nj = self._kinematics, self._robot.nj
        kinematics.update(state.q, state.v)
        setpoint = self._reflex.apply(setpoint, state.palm_force_in_world)
        self._tasks.build(kinematics, state.v, setpoint)
        self._clearance.build(kinematics, state.v, setpoint)
        self._contacts(kinematics, setpoint, state.palm_force_in_world)
        self._torque_bounds = lower, upper = self._limits.torque(state.v[6:])
        base_offset = self._assemble(state, setpoint)
        solution = self._workspace.solve()
        if not solution.solved:
            self._tasks.forget()
            torque = self._torque - self._settings.fallback_damping * state.v[6:]
            return TorqueCommand(
                torque=np.minimum(np.maximum(torque, lower), upper),
                acceleration=np.zeros(self._robot.nv),
                sole_wrench_in_world=np.zeros((2, 6)),
                palm_force_in_world=np.zeros((2, 3)),
                status=solution.status,
                solve_time=perf_counter() - start,
                fallback=True,
            )
        y = solution.x
        acceleration = np.empty(self._robot.nv)
        acceleration[:6] = self._base_map @ y + base_offset
        acceleration[6:] = y[:nj]
        qp, rows = self.problem, self._torque_rows
        # rows hold torque − offset; the bounds were shifted by the same offset
        torque = qp.matrix[rows] @ y + self._torque_offset
        np.minimum(np.maximum(torque, lower, out=torque), upper, out=torque)
        self._torque = torque
        forces = y[nj:].reshape(6, 3)
        wrench = np.empty((2, 6))
        palm = np.empty((2, 3))
        for side in range(2):
            R = self._contact_rotation[side]
            wrench[side, :3] = R @ forces[2 * side]
            wrench[side, 3:] = R @ forces[2 * side + 1]
            palm[side] = self._contact_rotation[2 + side] @ forces[4 + side]
        return TorqueCommand(
            torque=torque,
            acceleration=acceleration,
            sole_wrench_in_world=wrench,
            palm_force_in_world=palm,
            status=solution.status,
            solve_time=perf_counter() - start,
            fallback=False,
        )

    def _contacts(self, kinematics: Kinematics, setpoint: Setpoint, palm_force: Vector) -> None:
        """Contact Jacobians, force bounds, cones and force references, each in its contact's own frame.

        `palm_force` (2, 3) is sensed, in world [N].
        """
        qp, nj, settings = self.problem, self._robot.nj, self._settings
        lower, upper = qp.x_lower[nj:], qp.x_upper[nj:]
        lower[:], upper[:] = 0.0, 0.0
        self._diagonal[nj:] = settings.force_regularization
        self._reference[nj:] = 0.0
        for side in range(2):
            sole = slice(6 * side, 6 * side + 6)
            # the tasks already hold the sole's Jacobian in world axes
            jacobian = self._tasks.matrix[9 + 6 * side : 15 + 6 * side]
            R = kinematics.rotation(self._robot.sole_frames[side])
            self._contact_rotation[side] = R
            self._contact_jacobian[6 * side : 6 * side + 3] = R.T @ jacobian[:3]
            self._contact_jacobian[6 * side + 3 : 6 * side + 6] = R.T @ jacobian[3:]
            if setpoint.foot_stance[side]:
                lower[sole], upper[sole] = -np.inf, np.inf
                lower[6 * side + 2] = 0.0
            palm = slice(12 + 3 * side, 15 + 3 * side)
            if int(setpoint.hand_mode[side]) == CARRY:  # the held thing's force is known
                self._contact_rotation[2 + side] = WORLD
                self._contact_jacobian[palm] = self._tasks.matrix[21 + 3 * side : 24 + 3 * side]
                lower[palm] = upper[palm] = setpoint.hand_force[side]
                first = self._palm_rows.start + side * PALM_ROWS
                qp.matrix[first : first + PALM_ROWS, nj + 12 + 3 * side : nj + 15 + 3 * side] = 0.0
                self._sensed[side] = 0.0
                continue
            if int(setpoint.hand_mode[side]) != CONTACT:
                self._contact_jacobian[palm] = 0.0
                self._sensed[side] = 0.0
                continue
            R = contact_frame(setpoint.hand_normal[side])
            self._contact_rotation[2 + side] = R
            self._contact_jacobian[palm] = R.T @ self._tasks.matrix[21 + 3 * side : 24 + 3 * side]
            lower[palm], upper[palm] = -np.inf, np.inf
            sensed = float(palm_force[side] @ setpoint.hand_normal[side])
            self._sensed[side] += SENSED_SHARE * (max(sensed, 0.0) - self._sensed[side])
            # A palm that has bounced off would be thrown at the surface again by a force that nothing takes up.
            most = min(float(setpoint.hand_force_cap[side]), self._sensed[side] + settings.hand_force_rise)
            lower[14 + 3 * side], upper[14 + 3 * side] = 0.0, most
            first = self._palm_rows.start + side * PALM_ROWS
            qp.matrix[first : first + PALM_ROWS, nj + 12 + 3 * side : nj + 15 + 3 * side] = palm_force_rows(
                setpoint.hand_friction[side]
            )
            self._diagonal[nj + 12 + 3 * side : nj + 15 + 3 * side] = settings.hand_force_weight
            self._reference[nj + 12 + 3 * side : nj + 15 + 3 * side] = R.T @ setpoint.hand_force[side]

    def _assemble(self, state: RobotState, setpoint: Setpoint) -> Vector:
        """Write the QP; returns the base acceleration (6,) at y = 0."""
        qp, nj, settings, kinematics = self.problem, self._robot.nj, self._settings, self._kinematics
        M, h = state.mass_scale * kinematics.mass_matrix, state.mass_scale * kinematics.bias
        J = self._contact_jacobian
        base_map, right = self._base_map, self._base_right
        right[:, :nj] = -M[:6, 6:]
        right[:, nj:-1] = J[:, :6].T
        right[:, -1] = -h[:6]
        _, solved, _ = dposv(M[:6, :6], right)
        base_map[:] = solved[:, :-1]
        base_offset = solved[:, -1]

        tasks, stacked = self._tasks, self._stacked
        np.matmul(tasks.matrix[:, :6], base_map, out=stacked)
        stacked[:, :nj] += tasks.matrix[:, 6:]
        target = tasks.target - tasks.matrix[:, :6] @ base_offset
        weighted = stacked.T * tasks.weight
        np.matmul(weighted, stacked, out=qp.hessian)

        velocity, position = state.v[6:], state.q[7:]
        self._diagonal[:nj] = settings.posture_weight + settings.acceleration_regularization
        self._reference[:nj] = settings.posture_stiffness * (
            setpoint.joint_position - position
        ) + settings.posture_damping * (setpoint.joint_velocity - velocity)
        qp.hessian.reshape(-1)[:: nj + FORCES + 1] += self._diagonal
        np.matmul(weighted, target, out=qp.gradient)
        np.negative(qp.gradient, out=qp.gradient)
        weights = self._diagonal.copy()
        weights[:nj] = settings.posture_weight
        qp.gradient -= weights * self._reference

        rows = qp.matrix[self._torque_rows]
        np.matmul(M[6:, :6], base_map, out=rows)
        rows[:, :nj] += M[6:, 6:]
        rows[:, nj:] -= J[:, 6:].T
        robot = self._robot
        self._torque_offset = h[6:] + M[6:, :6] @ base_offset + robot.damping * velocity
        self._torque_offset += robot.frictionloss * np.tanh(setpoint.joint_velocity / FRICTION_SPEED)
        lower, upper = self._torque_bounds
        np.subtract(lower, self._torque_offset, out=qp.lower[self._torque_rows])
        np.subtract(upper, self._torque_offset, out=qp.upper[self._torque_rows])

        clearance = self._clearance
        rows = qp.matrix[self._clearance_rows]
        np.matmul(clearance.matrix[:, :6], base_map, out=rows)
        rows[:, :nj] += clearance.matrix[:, 6:]
        qp.lower[self._clearance_rows] = clearance.lower - clearance.matrix[:, :6] @ base_offset
        qp.x_lower[:nj], qp.x_upper[:nj] = self._limits.acceleration(position, velocity)
        return base_offset
