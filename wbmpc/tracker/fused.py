"""The tracker's program by compiled code: what is prepared once, and the one call of a tick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbmpc.frame_terms import chains_of
from wbmpc.robot import Robot
from wbmpc.signals import RobotState, Setpoint, Vector
from wbmpc.tracker.clearance import CLEARANCE_ROWS
from wbmpc.tracker.fused_program import build
from wbmpc.tracker.program import FORCES, TrackerProgram
from wbmpc.tracker.settings import TrackerSettings
from wbmpc.tracker.tasks import MOMENTUM, TASK_ROWS, TORSO, TaskStack

# Fields of a setpoint that the kernels read, and their shapes; "j" stands for the number of joints.
SETPOINT: dict[str, tuple[int | str, ...]] = {
    "com_position": (3,),
    "com_velocity": (3,),
    "com_acceleration": (3,),
    "joint_position": ("j",),
    "joint_velocity": ("j",),
    "torso_rotation": (3, 3),
    "torso_angular_velocity": (3,),
    "foot_position": (2, 3),
    "foot_yaw": (2,),
    "foot_yaw_rate": (2,),
    "foot_velocity": (2, 3),
    "foot_acceleration": (2, 3),
    "hand_position": (2, 3),
    "hand_velocity": (2, 3),
    "hand_acceleration": (2, 3),
    "hand_urgency": (2,),
    "hand_force": (2, 3),
    "hand_force_cap": (2,),
    "hand_normal": (2, 3),
    "hand_friction": (2,),
    "arm_keep_out": (2, 3, 5),
}


class FusedAssembly:
    """Writes the same program as `PlainAssembly`, in one call that neither allocates nor holds the interpreter's lock.

    Pinocchio's results are read where Pinocchio keeps them: the views taken at the start stay valid, because a
    `pin.Data` never moves its memory.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings, program: TrackerProgram, *, step: float) -> None:
        """`step` is the tick's length [s]."""
        self.program, self._step = program, step
        self._model, self._data = robot.pin_model, robot.pin_model.createData()
        nv, n, data, qp = robot.nv, robot.nj + FORCES, self._data, program.qp
        frames = (*robot.sole_frames, *robot.palm_frames, *robot.elbow_frames, robot.torso_frame)
        pose, base = data.oMf, data.oMi[1]
        self._pin = (
            *(data.J, data.M.T, data.nle, data.Jcom, data.Ag, data.com[0], data.vcom[0]),  # M is symmetric
            *(base.rotation, base.translation, tuple(pose[f].translation for f in frames)),
            *(tuple(pose[f].rotation for f in robot.sole_frames), pose[robot.torso_frame].rotation),
        )
        chains, lengths = chains_of(self._model, frames)
        limits = np.array([robot.joint_lower, robot.joint_upper, robot.joint_speed, robot.torque_limit])
        self._constants = (chains, lengths, limits, np.array([robot.damping, robot.frictionloss]), robot.mass)
        self._com_integral, self._hand_integral, self._sensed = np.zeros(3), np.zeros((2, 3)), np.zeros(2)
        weight = TaskStack(robot, settings, step=step).weight  # constant for CoM, momentum and torso
        assert weight[MOMENTUM].all() or settings.momentum_weight == 0.0
        assert weight[TORSO].all() or settings.torso_weight == 0.0
        self._scratch = (
            *(np.zeros((len(frames), 6, nv)), np.zeros((len(frames), 6)), np.zeros((len(frames), 6))),
            *(np.zeros((TASK_ROWS, nv)), np.zeros(TASK_ROWS), weight),
            *(np.zeros((CLEARANCE_ROWS, nv)), np.zeros(CLEARANCE_ROWS)),
            *(np.zeros((FORCES, nv)), np.zeros(n), np.zeros(n), np.zeros(n)),
            *self.memory,
        )
        self._qp = (qp.hessian, qp.gradient, qp.matrix, qp.lower, qp.upper, qp.x_lower, qp.x_upper)
        self._answer = (
            *(program.base_map, program.base_offset, program.torque_offset),
            *(program.torque_lower, program.torque_upper, program.contact_rotation),
        )
        shapes = {name: tuple(robot.nj if s == "j" else s for s in shape) for name, shape in SETPOINT.items()}
        modes = [("foot_stance", np.int64, (2,)), ("hand_mode", np.int64, (2,))]
        self._setpoint = np.zeros(1, [*modes, *((name, float, shape) for name, shape in shapes.items())])
        self._cells = tuple((name, self._setpoint[0][name]) for name in self._setpoint.dtype.names or ())
        gains = {name: value for name, value in settings if isinstance(value, float)}
        self._gains = np.array([tuple(gains.values())], [(name, float) for name in gains])

    def build(self, state: RobotState, setpoint: Setpoint) -> None:
        """Write the program for a state and a setpoint."""
        pin.computeAllTerms(self._model, self._data, state.q, state.v)
        pin.updateFramePlacements(self._model, self._data)
        for name, cell in self._cells:
            cell[...] = getattr(setpoint, name)
        now = (state.q, state.v, state.palm_force_in_world, state.mass_scale)
        build(
            *(self._setpoint, self._gains, self._step, now),
            *(self._pin, self._constants, self._scratch, self._qp, self._answer),
        )

    @property
    def memory(self) -> tuple[Vector, ...]:
        """All that one tick leaves to the next: integrals of CoM and palms, filtered palm forces."""
        return self._com_integral, self._hand_integral, self._sensed

    def forget(self) -> None:
        """Clear the integrals, see `TaskStack.forget`."""
        self._com_integral[:], self._hand_integral[:] = 0.0, 0.0
