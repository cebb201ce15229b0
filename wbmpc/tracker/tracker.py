"""The joint-level inverse-dynamics tracker: one QP over accelerations and contact forces per tick."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Protocol

import numpy as np

from wbmpc.qp import make_workspace
from wbmpc.robot import Robot
from wbmpc.signals import RobotState, Setpoint, TorqueCommand, Vector
from wbmpc.tracker.fused import FusedAssembly
from wbmpc.tracker.program import TrackerProgram
from wbmpc.tracker.reflex import TouchReflex
from wbmpc.tracker.settings import TrackerSettings

if TYPE_CHECKING:
    from wbmpc.tracker.plain import PlainAssembly

BINDING = 1e-9  # [N·m] beyond the servo's line


class Assembly(Protocol):
    """Writes the program of one tick."""

    def build(self, state: RobotState, setpoint: Setpoint) -> None: ...
    def forget(self) -> None: ...

    @property
    def memory(self) -> tuple[Vector, ...]:
        """All that one tick leaves to the next: integrals of CoM and palms, filtered palm forces."""
        ...


class Tracker:
    """minimise  Σ w |J v̇ − a|²  +  w_p |q̈ − q̈_posture|²  +  w_f |F − F_plan|²

    subject to  M v̇ + h = [0; τ] + J_cᵀ F     floating base and joints,
                W F ≤ 0                        wrench cones of the soles, friction pyramids of the palms,
                τ_low(q̇) ≤ τ ≤ τ_high(q̇)       the servo's torque-speed line (soft, then clipped),
                q̈_low ≤ q̈ ≤ q̈_high             joint position and speed limits,
                C v̇ ≥ c                         arms off the trunk and off the wall (soft).

    The six base rows give v̇_base = M_bb⁻¹ (J_cbᵀ F − h_b − M_bj q̈), which eliminates them; the unknowns are
    y = (q̈ (nj), F (18)) and the torques follow from the joint rows. Those rows are left out first: when the torques
    of the answer keep to the servo's line anyway, it is the optimum. They stay in for as long as they bind.

    A failed solve repeats the last torque with some joint damping; it is marked `fallback` and counted.
    """

    def __init__(self, robot: Robot, settings: TrackerSettings, *, step: float) -> None:
        """`step` is the tick's length [s]."""
        self._robot, self._settings = robot, settings
        self._program = TrackerProgram(robot, settings)
        self._assembly: Assembly = _assembly(settings)(robot, settings, self._program, step=step)
        self._full = make_workspace(settings.qp_backend, self._program.qp)
        self._relaxed = make_workspace(settings.qp_backend, self._program.relaxed)
        self._bound = False  # torques were at the servo's line in the last tick
        self._reflex = TouchReflex()
        self._torque = np.zeros(robot.nj)

    def continue_from(self, other: Tracker) -> None:
        """Go on where another one, with other settings, has stopped."""
        self._bound, self._reflex, self._torque = other._bound, other._reflex, other._torque
        for mine, before in zip(self._assembly.memory, other._assembly.memory, strict=True):
            mine[:] = before

    def solve(self, state: RobotState, setpoint: Setpoint) -> TorqueCommand:
        """Torques for one tick. Never raises for a failed solve: see the class."""
        start = perf_counter()
        program = self._program
        self._assembly.build(state, self._reflex.apply(setpoint, state.palm_force_in_world))
        lower, upper = program.torque_lower, program.torque_upper
        solution = (self._full if self._bound else self._relaxed).solve()
        torque = np.empty(self._robot.nj)
        bound = program.torque(solution.x, tolerance=BINDING, out=torque)
        if bound and not self._bound and solution.solved:
            solution = self._full.solve()
            program.torque(solution.x, tolerance=BINDING, out=torque)
        self._bound = bound
        if not solution.solved:
            self._assembly.forget()
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
        np.minimum(np.maximum(torque, lower, out=torque), upper, out=torque)
        self._torque = torque
        acceleration, wrench, palm = np.empty(self._robot.nv), np.empty((2, 6)), np.empty((2, 3))
        program.recover(solution.x, acceleration, wrench, palm)
        return TorqueCommand(
            torque=torque,
            acceleration=acceleration,
            sole_wrench_in_world=wrench,
            palm_force_in_world=palm,
            status=solution.status,
            solve_time=perf_counter() - start,
            fallback=False,
        )


def _assembly(settings: TrackerSettings) -> type[FusedAssembly | PlainAssembly]:
    if settings.assembly == "fused":
        return FusedAssembly
    from wbmpc.tracker.plain import PlainAssembly  # with it comes scipy: 25 MB that a run does without

    return PlainAssembly
