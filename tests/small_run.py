"""A small world and a short, made-up run of it, for tests of what is recorded and drawn (no robot, no controller)."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from wbmpc.recorder import Recorder
from wbmpc.signals import (
    CONTACT,
    CandidateReport,
    ContactPhase,
    Firing,
    HandMode,
    PlanReport,
    RobotState,
    Setpoint,
    SolveStatus,
    StageReport,
    TorqueCommand,
    Truth,
)

# One geom of each kind that can be drawn; `tilted` ones would betray a wrong quaternion order or axis.
MJCF = """
<mujoco model="small">
  <asset><mesh name="wedge" vertex="0 0 0  .05 0 0  0 .05 0  0 0 .05"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1" rgba=".8 .82 .85 1"/>
    <geom name="table" type="box" size=".05 .1 .1" pos=".3 0 .1" rgba=".6 .45 .3 1"/>
    <body name="trunk" pos="0 0 .3">
      <freejoint name="root"/>
      <inertial mass="2" pos="0 0 0" diaginertia=".01 .01 .01"/>
      <geom type="box" size=".04 .06 .08" rgba=".2 .3 .7 1"/>
      <geom type="sphere" size=".04" pos="0 0 .13" rgba=".9 .9 .9 1"/>
      <geom type="mesh" mesh="wedge" pos="-.05 0 0" euler="0 -90 0" rgba=".4 .7 .4 1"/>
      <geom name="collision only" type="box" size=".3 .3 .3" group="3"/>
      <body name="left arm" pos="0 .08 .05">
        <joint name="left_shoulder" axis="0 1 0"/>
        <inertial mass=".2" pos="0 0 -.05" diaginertia=".001 .001 .001"/>
        <geom type="capsule" fromto="0 0 0 .1 .05 -.1" size=".015" rgba=".7 .3 .3 1"/>
      </body>
      <body name="right arm" pos="0 -.08 .05">
        <joint name="right_shoulder" axis="0 1 0"/>
        <inertial mass=".2" pos="0 0 -.05" diaginertia=".001 .001 .001"/>
        <geom type="cylinder" fromto="0 0 0 .1 -.05 -.1" size=".015" rgba=".7 .3 .3 1"/>
        <geom type="ellipsoid" size=".03 .02 .01" pos=".1 -.05 -.1" euler="0 45 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
JOINT_NAMES = ("left_shoulder", "right_shoulder")
PATCHES = {"table_1": np.array([[0.27, -0.03, 0.2], [0.33, -0.03, 0.2], [0.33, 0.03, 0.2], [0.27, 0.03, 0.2]])}
TICK = 1e-3  # [s]
PLAN_EVERY = 10  # ticks


@dataclass(frozen=True)
class Robot:
    nq: int = 9
    nv: int = 8
    nj: int = 2


def compile_model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MJCF)


def new_recorder(expected_ticks: int = 100, *, stride: int = 1) -> Recorder:
    recorder = Recorder(Robot(), expected_ticks=expected_ticks, stride=stride)
    recorder.timing.begin(timestep=TICK, realtime=True)
    return recorder


def append_ticks(recorder: Recorder, count: int, *, seed: int = 0) -> None:
    """`count` more ticks, and a plan every ten of them."""
    for k in range(recorder.ticks, recorder.ticks + count):
        rng = np.random.default_rng([seed, k])
        recorder.append(*made_up_tick(k, rng))
        recorder.timing.tick(late=4e-3 if k == 47 else 1e-5, duration=6e-3 if k == 33 else 5e-4)
        if k % PLAN_EVERY == 0:
            recorder.append_plan(made_up_plan(k, rng))
            recorder.timing.plan(snapshot=k, effect=k + 4 + k % 3)


def made_up_tick(k: int, rng: np.random.Generator) -> tuple[Truth, RobotState, Setpoint, TorqueCommand]:
    t = k * TICK
    qpos = np.array([0.02 * np.sin(3 * t), 0, 0.3, np.cos(t / 2), 0, 0, np.sin(t / 2), np.sin(5 * t), -np.sin(5 * t)])
    com = qpos[:3] + np.array([0, 0, 0.01])
    count = k // 10 % 5
    palm = np.array([[0.1, 0.15, 0.25], [0.1, -0.15, 0.25]])
    sole = np.array([[0, 0.05, 0.0], [0, -0.05, 0.0]])
    contacts = np.zeros(count, CONTACT)
    contacts["geoms"], contacts["force"], contacts["distance"] = [0, 2], [1.0, 0.0, 8.0], -2e-4
    contacts["position"] = np.array([[0.05, 0.05, 0], [-0.05, 0.05, 0], [-0.05, -0.05, 0], [0.05, -0.05, 0]])[:count]
    truth = Truth(
        time=t,
        qpos=qpos,
        qvel=rng.normal(size=8),
        torque=rng.normal(size=2),
        torque_limit=np.full(2, 2.5),
        com=com,
        com_velocity=np.zeros(3),
        angular_momentum=np.zeros(3),
        palm_position=palm,
        sole_position=sole,
        torso_up=1.0,
        external_force=np.array([5.0, 0, 0]) if 20 <= k < 40 else np.zeros(3),
        zmp=com[:2] if count else np.full(2, np.nan),
        contacts=contacts,
    )
    state = RobotState(
        time=t,
        q=qpos,
        v=truth.qvel,
        sole_wrench_in_world=rng.normal(size=(2, 6)),
        palm_force_in_world=rng.normal(size=(2, 3)),
        mass_scale=1.0,
    )
    setpoint = Setpoint(
        time=t,
        com_position=com + np.array([0.01, 0, 0]),
        com_velocity=np.zeros(3),
        com_acceleration=np.zeros(3),
        joint_position=np.zeros(2),
        joint_velocity=np.zeros(2),
        torso_rotation=np.eye(3),
        torso_angular_velocity=np.zeros(3),
        foot_stance=np.ones(2, bool),
        foot_position=sole,
        foot_yaw=np.zeros(2),
        foot_yaw_rate=np.zeros(2),
        foot_velocity=np.zeros((2, 3)),
        foot_acceleration=np.zeros((2, 3)),
        hand_mode=np.array([HandMode.MOVE, HandMode.FREE]),
        hand_position=palm + np.array([0.01, 0, 0]),
        hand_velocity=np.zeros((2, 3)),
        hand_acceleration=np.zeros((2, 3)),
        hand_force=np.array([[0.0, 0, 6.0], [0, 0, 0]]) if k >= 50 else np.zeros((2, 3)),
        hand_force_cap=np.zeros(2),
        hand_normal=np.tile([0.0, 0, 1], (2, 1)),
        hand_urgency=np.zeros(2),
        hand_friction=np.full(2, 0.5),
        arm_keep_out=np.tile([0.0, 0.0, 0.0, -np.inf, 0.0], (2, 3, 1)),
    )
    command = TorqueCommand(
        torque=truth.torque,
        acceleration=np.zeros(8),
        sole_wrench_in_world=np.zeros((2, 6)),
        palm_force_in_world=np.zeros((2, 3)),
        status=SolveStatus.INFEASIBLE if k == 33 else SolveStatus.SOLVED,
        solve_time=5e-3 if k == 33 else 2e-4 + 1e-5 * (k % 7),
        fallback=k == 33,
    )
    return truth, state, setpoint, command


def made_up_plan(k: int, rng: np.random.Generator, knots: int = 4) -> PlanReport:
    fired = k == 50
    stage = StageReport(SolveStatus.SOLVED, 1e-4 * rng.random(), 3)
    hand_reference = np.full((2, knots, 3), np.nan)
    hand_reference[0] = np.linspace([0.1, 0.15, 0.25], [0.3, 0.0, 0.2], knots)
    firing = Firing(
        knot_times=np.array([k * TICK + 0.4, np.inf]),
        delta_z=np.array([[-0.004, 0.001], [-0.05, 0.0]]),
        zmp=np.array([[0.06, 0.0], [0.11, 0.0]]),
        reserve=0.012,
        held=(),
        candidates=(
            made_up_candidate("table_1", chosen=True, cost=1.5, reach_slack=0.02, reason="chosen"),
            made_up_candidate("wall", hand=1, reach_slack=-0.2, reason="unreachable by 20.0 cm"),
        ),
    )
    return PlanReport(
        time=k * TICK,
        mass=2.4,
        com=np.linspace([0, 0, 0.31], [0.05, 0, 0.3], knots),
        com_acceleration=np.tile([0.5, 0.0, -1.0], (knots, 1)),
        com_height_band=np.tile([0.25, 0.33], (knots, 1)),
        zmp=np.linspace([0, 0], [0.05, 0.01], knots),
        support_polygon=np.array([[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]]),
        delta_z=np.tile([0.004, -0.001], (knots, 1)),
        hand_reference=hand_reference,
        contact_force=np.tile([[[0.2, 0.0, 3.0]], [[0.0, 0.0, 0.0]]], (1, knots, 1)),
        contact_phase=np.array([ContactPhase.CHOSEN if k >= 50 else ContactPhase.NONE, ContactPhase.NONE]),
        contact_patch=("table_1" if k >= 50 else "", ""),
        progress=1.0,
        stage1=stage,
        stage2=stage,
        stage3=stage if fired else StageReport(SolveStatus.NOT_RUN, 0.0, 0),
        firing=firing if fired else None,
        plan_time=1e-3,
        events=("contact left table_1: needed -> chosen",) if fired else (),
    )


def made_up_candidate(
    patch: str, *, reach_slack: float, reason: str, hand: int = 0, chosen: bool = False, cost: float = np.inf
) -> CandidateReport:
    """A candidate on the table; of one with a cost, 0.2 is for the way and 0.3 for the shift."""
    weighed = np.isfinite(cost)
    return CandidateReport(
        patch=patch,
        hand=hand,
        chosen=chosen,
        cost=cost,
        way_cost=0.2 if weighed else np.nan,
        force_cost=cost - 0.5 if weighed else np.nan,
        shift_cost=0.3 if weighed else np.nan,
        beside=(),
        palm=np.array([0.3, 0.0, 0.22]),
        reach_slack=reach_slack,
        reach_limit="palm",
        friction_margin=0.8 if weighed else np.nan,
        forces=np.array([[0.0, 0, 6.0], [0.0, 1.0, 9.0]]) if weighed else np.zeros((2, 3)),
        reason=reason,
    )
