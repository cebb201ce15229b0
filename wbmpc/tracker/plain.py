"""The tracker's program, written in numpy: what wbmpc/tracker/fused.py does faster, for reading and for checking."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv

from wbmpc.kinematics import Kinematics
from wbmpc.robot import Robot
from wbmpc.rotations import contact_frame
from wbmpc.signals import RobotState, Setpoint, Vector
from wbmpc.tracker.clearance import Clearance
from wbmpc.tracker.constraints import PALM_ROWS, JointLimits, palm_force_rows
from wbmpc.tracker.program import CLEARANCE, FORCES, PALM, TrackerProgram
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tasks import CARRY, CONTACT, TASK_ROWS, TaskStack

WORLD = np.eye(3)  # rotation of a force that is given in world
SENSED_SHARE = 0.2  # per tick, of the filtered palm force
FRICTION_SPEED = 0.1  # [rad/s] wanted speed from which a joint's dry friction is fully compensated


class PlainAssembly:
    """Writes the program of one tick, block by block, as the mathematics has it."""

    def __init__(self, robot: Robot, settings: TrackerSettings, program: TrackerProgram, *, step: float) -> None:
        """`step` is the tick's length [s]."""
        self.program, n = program, robot.nj + FORCES
        self._robot, self._settings = robot, settings
        self._kinematics = Kinematics(robot)
        self._tasks = TaskStack(robot, settings, step=step)
        self._clearance = Clearance(robot, settings)
        self._limits = JointLimits(
            robot,
            speed_limit=settings.joint_velocity_limit,
            horizon=settings.limit_horizon,
            torque_share=settings.torque_share,
        )
        self._contact_jacobian = np.zeros((FORCES, robot.nv))
        self._base_right = np.zeros((6, n + 1), order="F")
        self._diagonal, self._reference = np.zeros(n), np.zeros(n)
        self._stacked = np.zeros((TASK_ROWS, n))
        self._sensed = np.zeros(2)  # [N] filtered normal force of each braced palm

    def build(self, state: RobotState, setpoint: Setpoint) -> None:
        """Write the program for a state and a setpoint."""
        self._kinematics.update(state.q, state.v)
        self._tasks.build(self._kinematics, state.v, setpoint)
        self._clearance.build(self._kinematics, state.v, setpoint)
        self._contacts(self._kinematics, setpoint, state.palm_force_in_world)
        self._assemble(state, setpoint)

    @property
    def memory(self) -> tuple[Vector, ...]:
        """All that one tick leaves to the next: integrals of CoM and palms, filtered palm forces."""
        return *self._tasks.integrals, self._sensed

    def forget(self) -> None:
        """See `TaskStack.forget`."""
        self._tasks.forget()

    def _contacts(self, kinematics: Kinematics, setpoint: Setpoint, palm_force: Vector) -> None:
        """Contact Jacobians, force bounds, cones and force references, each in its contact's own frame.

        `palm_force` (2, 3) is sensed, in world [N].
        """
        program, nj, settings = self.program, self._robot.nj, self._settings
        qp = program.qp
        lower, upper = qp.x_lower[nj:], qp.x_upper[nj:]
        lower[:], upper[:] = 0.0, 0.0
        self._diagonal[nj:] = settings.force_regularization
        self._reference[nj:] = 0.0
        for side in range(2):
            sole = slice(6 * side, 6 * side + 6)
            # the tasks already hold the sole's Jacobian in world axes
            jacobian = self._tasks.matrix[9 + 6 * side : 15 + 6 * side]
            R = kinematics.rotation(self._robot.sole_frames[side])
            program.contact_rotation[side] = R
            self._contact_jacobian[6 * side : 6 * side + 3] = R.T @ jacobian[:3]
            self._contact_jacobian[6 * side + 3 : 6 * side + 6] = R.T @ jacobian[3:]
            if setpoint.foot_stance[side]:
                lower[sole], upper[sole] = -np.inf, np.inf
                lower[6 * side + 2] = 0.0
            palm = slice(12 + 3 * side, 15 + 3 * side)
            if int(setpoint.hand_mode[side]) == CARRY:  # the held thing's force is known
                program.contact_rotation[2 + side] = WORLD
                self._contact_jacobian[palm] = self._tasks.matrix[21 + 3 * side : 24 + 3 * side]
                lower[palm] = upper[palm] = setpoint.hand_force[side]
                first = PALM.start + side * PALM_ROWS
                qp.matrix[first : first + PALM_ROWS, nj + 12 + 3 * side : nj + 15 + 3 * side] = 0.0
                self._sensed[side] = 0.0
                continue
            if int(setpoint.hand_mode[side]) != CONTACT:
                self._contact_jacobian[palm] = 0.0
                self._sensed[side] = 0.0
                continue
            R = contact_frame(setpoint.hand_normal[side])
            program.contact_rotation[2 + side] = R
            self._contact_jacobian[palm] = R.T @ self._tasks.matrix[21 + 3 * side : 24 + 3 * side]
            lower[palm], upper[palm] = -np.inf, np.inf
            sensed = float(palm_force[side] @ setpoint.hand_normal[side])
            self._sensed[side] += SENSED_SHARE * (max(sensed, 0.0) - self._sensed[side])
            # A palm that has bounced off would be thrown at the surface again by a force that nothing takes up.
            most = min(float(setpoint.hand_force_cap[side]), self._sensed[side] + settings.hand_force_rise)
            lower[14 + 3 * side], upper[14 + 3 * side] = 0.0, most
            first = PALM.start + side * PALM_ROWS
            qp.matrix[first : first + PALM_ROWS, nj + 12 + 3 * side : nj + 15 + 3 * side] = palm_force_rows(
                setpoint.hand_friction[side]
            )
            self._diagonal[nj + 12 + 3 * side : nj + 15 + 3 * side] = settings.hand_force_weight
            self._reference[nj + 12 + 3 * side : nj + 15 + 3 * side] = R.T @ setpoint.hand_force[side]

    def _assemble(self, state: RobotState, setpoint: Setpoint) -> None:
        """Costs, rows and bounds of the unknowns, the base eliminated."""
        program, nj, settings, kinematics = self.program, self._robot.nj, self._settings, self._kinematics
        qp, base_map = program.qp, program.base_map
        M, h = state.mass_scale * kinematics.mass_matrix, state.mass_scale * kinematics.bias
        J = self._contact_jacobian
        right = self._base_right
        right[:, :nj] = -M[:6, 6:]
        right[:, nj:-1] = J[:, :6].T
        right[:, -1] = -h[:6]
        _, solved, _ = dposv(M[:6, :6], right)
        base_map[:] = solved[:, :-1]
        program.base_offset[:] = base_offset = solved[:, -1]

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

        rows = program.torque_matrix
        np.matmul(M[6:, :6], base_map, out=rows)
        rows[:, :nj] += M[6:, 6:]
        rows[:, nj:] -= J[:, 6:].T
        robot = self._robot
        program.torque_offset[:] = h[6:] + M[6:, :6] @ base_offset + robot.damping * velocity
        program.torque_offset += robot.frictionloss * np.tanh(setpoint.joint_velocity / FRICTION_SPEED)
        program.torque_lower[:], program.torque_upper[:] = self._limits.torque(velocity)
        np.subtract(program.torque_lower, program.torque_offset, out=qp.lower[program.torque_rows])
        np.subtract(program.torque_upper, program.torque_offset, out=qp.upper[program.torque_rows])

        clearance = self._clearance
        rows = qp.matrix[CLEARANCE]
        np.matmul(clearance.matrix[:, :6], base_map, out=rows)
        rows[:, :nj] += clearance.matrix[:, 6:]
        qp.lower[CLEARANCE] = clearance.lower - clearance.matrix[:, :6] @ base_offset
        qp.x_lower[:nj], qp.x_upper[:nj] = self._limits.acceleration(position, velocity)
