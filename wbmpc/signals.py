"""Every arrow of the block diagram: records with shapes, units and frames.

Conventions, everywhere in the project:
  * SI units; world axes, z up; `GRAVITY` = 9.81 m/s².
  * Side index 0 = left, 1 = right (`SIDES`).
  * Forces act **on the robot** (a hand braced on a table has f_z > 0).
  * `q`, `v` are Pinocchio's (quaternion xyzw, base velocity in the base frame); `qpos`, `qvel` are MuJoCo's.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from wbmpc.record import record

Vector = NDArray[np.float64]
GRAVITY = 9.81  # [m/s²]
SIDES = ("left", "right")
MAX_CONTACTS = 48  # of MuJoCo's, in one tick's truth
CONTACT = (
    np.dtype(  # geom ids; where, and the force on the robot (on the second geom when both are the robot's), in world
        [
            ("geoms", np.int32, 2),
            ("position", float, 3),  # [m]
            ("force", float, 3),  # [N]
            ("distance", float),  # [m] negative: penetration
        ]
    )
)


class SolveStatus(IntEnum):
    """How one QP solve ended; anything but SOLVED is counted as a failure and triggers the documented fallback."""

    SOLVED = 0
    INFEASIBLE = 1
    ITERATION_LIMIT = 2
    NUMERICAL_ERROR = 3
    NOT_RUN = 4


class HandMode(IntEnum):
    """What the tracker does with a hand."""

    FREE = 0  # posture only
    MOVE = 1  # track the commanded palm position (reach, approach, retract)
    CONTACT = 2  # palm held on a surface, force tracked
    CARRY = 3  # palm moves with a thing held between both hands, its force known


class ContactPhase(IntEnum):
    """The life of a hand contact, in order."""

    NONE = 0
    NEEDED = 1
    CHOSEN = 2
    APPROACHING = 3
    SENSED = 4
    LOADED = 5
    QUIET = 6
    UNLOADED = 7
    RELEASED = 8


@record
class Measurement:
    """What the robot's own sensors say at one tick (noise included)."""

    time: float  # [s]
    joint_position: Vector  # (nj,) [rad]
    joint_velocity: Vector  # (nj,) [rad/s]
    imu_quaternion: Vector  # (4,) wxyz, IMU frame in world (the IMU's own attitude filter)
    imu_gyro: Vector  # (3,) [rad/s] in the IMU frame
    imu_accelerometer: Vector  # (3,) [m/s²] specific force in the IMU frame
    sole_wrench_in_world: Vector  # (2, 6) [N, N·m] force and moment about the sole site, ankle force/torque sensors
    palm_force_in_world: Vector  # (2, 3) [N] palm force sensors


@record
class RobotState:
    """The estimator's answer: everything the controller knows of the robot."""

    time: float  # [s]
    q: Vector  # (nq,) Pinocchio configuration, base pose in world
    v: Vector  # (nv,) Pinocchio velocity, base twist in base
    sole_wrench_in_world: Vector  # (2, 6) [N, N·m]
    palm_force_in_world: Vector  # (2, 3) [N]
    mass_scale: float  # estimated total mass / model mass


@record
class TargetMove:
    """An order to the planner in the middle of a run: from its next plan on the target of a reach is elsewhere."""

    task: int  # index among the scenario's tasks, of a reach
    target: Vector  # (3,) [m] in world


@record
class Setpoint:
    """What the tracker follows at one tick, sampled from the latest plan."""

    time: float  # [s]
    com_position: Vector  # (3,) [m] in world
    com_velocity: Vector  # (3,) [m/s]
    com_acceleration: Vector  # (3,) [m/s²]
    joint_position: Vector  # (nj,) [rad] posture reference, the integral of stage 2's joint velocities
    joint_velocity: Vector  # (nj,) [rad/s] stage 2's joint velocities
    torso_rotation: Vector  # (3, 3) torso to world, of the posture reference
    torso_angular_velocity: Vector  # (3,) [rad/s] in world, of the posture reference
    foot_stance: NDArray[np.bool_]  # (2,)
    foot_position: Vector  # (2, 3) [m] sole in world
    foot_yaw: Vector  # (2,) [rad]
    foot_yaw_rate: Vector  # (2,) [rad/s]
    foot_velocity: Vector  # (2, 3) [m/s]
    foot_acceleration: Vector  # (2, 3) [m/s²]
    hand_mode: NDArray[np.int64]  # (2,) HandMode
    hand_position: Vector  # (2, 3) [m] palm centre in world
    hand_velocity: Vector  # (2, 3) [m/s]
    hand_acceleration: Vector  # (2, 3) [m/s²]
    hand_urgency: Vector  # (2,) 0 … 1: how much a moving hand may disturb the rest of the body to be in time
    hand_force: Vector  # (2, 3) [N] wanted contact force in world, zero when not in contact
    hand_force_cap: Vector  # (2,) [N] bound on the normal force, ramped: contact transitions without jumps
    hand_normal: Vector  # (2, 3) contact normal, out of the surface
    hand_friction: Vector  # (2,) planned friction coefficient
    arm_keep_out: Vector  # (2, 3, 5) half-spaces a·x ≥ b of palm, a point between and elbow; a, b (-inf: none), share


@record
class TorqueCommand:
    """The tracker's answer at one tick."""

    torque: Vector  # (nj,) [N·m]
    acceleration: Vector  # (nv,) [rad/s², m/s²] Pinocchio v̇ of the solution
    sole_wrench_in_world: Vector  # (2, 6) planned contact wrench, force then moment about the sole
    palm_force_in_world: Vector  # (2, 3)
    status: SolveStatus
    solve_time: float  # [s] wall time of the whole tracker tick
    fallback: bool  # the command is not this tick's solution


@record
class CandidateReport:
    """One candidate contact as stage 3 saw it when it fired: what it would cost and give, why it won or lost.

    A candidate that cannot stand alone is weighed with the contacts that would be `beside` it; cost and parts are
    then those of all of them together. Of one that was not weighed, or cannot give what is needed, the cost is inf,
    parts and friction margin are nan and the forces zero.
    """

    patch: str
    hand: int  # side index
    chosen: bool
    cost: float  # stage 3's objective with this candidate's H_i = 1: the sum of the next three
    way_cost: float  # w_i H_i: the way of the palm
    force_cost: float  # of the forces over the knots
    shift_cost: float  # of the ΔZ that the forces do not give
    beside: tuple[str, ...]  # patches of the contacts that it was weighed with
    palm: Vector  # (3,) [m] in world: centre of the palm on the patch
    reach_slack: float  # [m] reach margin; negative: out of reach by that much
    reach_limit: str  # what bounds it: "palm", "elbow", "obstacle" or "CoM"
    friction_margin: float  # [N] smallest μ f_n − |f_t| over the knots
    forces: Vector  # (k, 3) [N] wanted at the knots of the firing, in world, on the robot
    reason: str  # "chosen", "unreachable by 3.2 cm", "cost 1.8 above the best", ...


@record
class Firing:
    """One firing of stage 3: what it was asked, at k knots, and what it made of every candidate."""

    knot_times: Vector  # (k,) [s] of the run; inf: where the running task ends
    delta_z: Vector  # (k, 2) [m] the ZMP shift that fired it
    zmp: Vector  # (k, 2) [m] the ZMP without contact, from which the shift goes
    reserve: float  # [m] by which the feet's pressure is to be inside its polygon
    held: tuple[str, ...]  # patches of the contacts that were there before, each with its hand
    candidates: tuple[CandidateReport, ...]  # all of them, those that were not weighed too


@record
class StageReport:
    """One solve of one stage."""

    status: SolveStatus
    solve_time: float  # [s] wall time, assembly included
    iterations: int


@record
class PlanReport:
    """The plan as the recording and the checks see it. N knots at times t + T, ..., t + N T."""

    time: float  # [s] time of the snapshot the plan was computed from
    mass: float  # [kg] that the plan counts on
    com: Vector  # (N, 3) [m] planned CoM
    com_acceleration: Vector  # (N, 3) [m/s²] times mass: the planned rate of momentum; the angular one is zero
    com_height_band: Vector  # (N, 2) [m] admissible band of stage 1
    zmp: Vector  # (N, 2) [m] planned ZMP of the feet
    support_polygon: Vector  # (k, 2) [m] vertices, counter-clockwise, margin not subtracted
    delta_z: Vector  # (N, 2) [m] the ZMP shift that stage 2 asks of a contact
    hand_reference: Vector  # (2, N, 3) [m] palm references over the horizon; nan for a free hand
    contact_force: Vector  # (2, N, 3) [N] planned hand forces over the horizon
    contact_phase: NDArray[np.int64]  # (2,) ContactPhase of each hand
    contact_patch: tuple[str, str]  # name of the patch of each hand's contact, "" when none
    progress: float  # task progress rate scale, 0 (gated) .. 1 (free)
    stage1: StageReport
    stage2: StageReport
    stage3: StageReport  # status NOT_RUN when it did not fire
    firing: Firing | None  # of stage 3 in this plan
    plan_time: float  # [s] wall time of the whole plan
    events: tuple[str, ...]  # "contact right table_2: chosen -> approaching", ...

    @property
    def candidates(self) -> tuple[CandidateReport, ...]:
        """Every candidate when stage 3 fired in this plan, else none."""
        return self.firing.candidates if self.firing else ()


@record
class Truth:
    """What really happens in the plant at one tick; for the recorder and the checks, never for the controller."""

    time: float  # [s]
    qpos: Vector  # (nq,) MuJoCo
    qvel: Vector  # (nv,) MuJoCo
    torque: Vector  # (nj,) [N·m] applied joint torque of this tick, after the servo's limits
    torque_limit: Vector  # (nj,) [N·m] what the servo could give at this speed, in this direction
    com: Vector  # (3,) [m]
    com_velocity: Vector  # (3,) [m/s]
    angular_momentum: Vector  # (3,) [N·m·s] of the robot about its CoM, in world
    palm_position: Vector  # (2, 3) [m]
    sole_position: Vector  # (2, 3) [m]
    torso_up: float  # cosine of the torso's tilt: 1 upright, 0 lying
    external_force: Vector  # (3,) [N] declared disturbance acting now, sum over bodies
    zmp: Vector  # (2,) [m] measured centre of pressure of the feet; nan when no foot pushes
    contacts: NDArray[np.void]  # (c,) of CONTACT: those that carry force, c ≤ MAX_CONTACTS

    @property
    def contact_count(self) -> int:
        """c"""
        return len(self.contacts)
