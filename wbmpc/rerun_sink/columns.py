"""A recording back into the columns that a run's recorder had, at the file's rate, for whoever judges runs.

Names, shapes, units and frames are the recorder's; what a file does not hold is not there. Forces were written in
single precision, velocities of the CoM are differences of its positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbmpc.errors import WbmpcError
from wbmpc.footage import site_poses
from wbmpc.recorder import Contacts, Event
from wbmpc.rerun_sink.reading import Recording
from wbmpc.rerun_sink.rerunning import recorded_run
from wbmpc.rerun_sink.ticks import CONTACT_GEOMS, FELL_BACK
from wbmpc.signals import SIDES, ContactPhase, HandMode, SolveStatus, StageReport
from wbmpc.timing import LoopTiming

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Columns:
    """n samples of one run, with c contacts over all of them, and its plans, events and schedule."""

    model: Any  # compiled MjModel of robot and world
    time: FloatArray
    qpos: FloatArray
    qvel: FloatArray
    torque: FloatArray
    torque_limit: FloatArray
    com: FloatArray
    com_velocity: FloatArray
    palm_position: FloatArray
    sole_position: FloatArray
    torso_up: FloatArray
    external_force: FloatArray
    setpoint_com_position: FloatArray
    setpoint_hand_position: FloatArray  # nan for a hand without a reference
    setpoint_hand_mode: NDArray[np.int64]  # FREE, or MOVE for a hand with a reference: a file tells no more
    contact_count: NDArray[np.int64]
    contacts: Contacts
    command_status: NDArray[np.int64]
    command_fallback: NDArray[np.bool_]
    plans: Sequence[Any]  # of PlanReport: time, stages' statuses, contacts' phases and patches
    events: Sequence[Event]
    timing: LoopTiming  # the plans' schedule

    @property
    def ticks(self) -> int:
        """n"""
        return len(self.time)

    @property
    def stride(self) -> int:
        """1: a recording has the controller's signals at every sample."""
        return 1

    @property
    def sample_ticks(self) -> NDArray[np.int64]:
        """(n,) all of them."""
        return np.arange(self.ticks)

    @property
    def contact_tick(self) -> NDArray[np.int64]:
        """(c,) sample of each contact."""
        return np.repeat(np.arange(self.ticks), self.contact_count)


def columns_of(recording: Recording) -> Columns:
    """The columns of a recording.

    Raises:
        WbmpcError: it is none of this project, holds no sample, or was written before it held who touches whom.
    """
    footage = recording.footage()
    model, time = footage.model, footage.time
    stamps, pairs = recording.column(CONTACT_GEOMS, "geoms")
    if not len(stamps):
        raise WbmpcError(f"{recording.path}: written by an earlier version, which did not record who touches whom")

    def scalars(entity: str) -> FloatArray:
        return np.array(recording.column(entity, "scalars")[1], float)

    geoms = [np.asarray(pair, np.int32).reshape(-1, 2) for pair in pairs]
    reference = np.stack([_hand_reference(recording, side, time) for side in SIDES], axis=1)
    sites, _ = site_poses(model, footage.qpos, [f"{side}_{site}" for site in ("palm", "sole") for side in SIDES])
    count = np.array([len(pair) for pair in geoms])
    status, fallback = _tracker(recording, time)
    contacts = Contacts(
        np.concatenate(geoms),
        np.concatenate(footage.contact_position),
        np.concatenate(footage.contact_force),
        np.full(int(count.sum()), np.nan),
    )
    return Columns(
        model=model,
        time=time,
        qpos=footage.qpos,
        qvel=scalars("/state/qvel"),
        torque=scalars("/joints/torque"),
        torque_limit=scalars("/joints/torque_limit"),
        com=footage.com,
        com_velocity=np.gradient(footage.com, time, axis=0) if len(time) > 1 else np.zeros((1, 3)),
        palm_position=sites[:, :2],
        sole_position=sites[:, 2:],
        torso_up=scalars("/tracking/base")[:, 0],
        setpoint_com_position=np.column_stack([scalars(f"/com/{axis}")[:, 1] for axis in "xyz"]),
        setpoint_hand_position=reference,
        setpoint_hand_mode=np.where(np.isfinite(reference).all(axis=2), HandMode.MOVE, HandMode.FREE),
        external_force=recording.pushes(time),
        contact_count=count,
        contacts=contacts,
        command_status=status,
        command_fallback=fallback,
        plans=_plans(recording),
        events=[
            Event(float(t), str(text[0])) for t, text in zip(*recording.column("/log/events", "text"), strict=True)
        ],
        timing=_schedule(recording),
    )


def _tracker(recording: Recording, time: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Status and fallback (n,) of the tracker; a sample stands for all ticks since the one before, the worst counts."""
    stamps, states = recording.column("/solver_status/tracker", "state")
    status, fallback = np.zeros(len(time), int), np.zeros(len(time), bool)
    ends = np.append(stamps[1:], np.inf)
    for start, end, state in zip(stamps, ends, states, strict=True):
        name = str(state[0])
        first, stop = np.searchsorted(time, [start - 1e-9, end - 1e-9])
        rows = slice(first, stop + 1)
        code = SolveStatus[name.removesuffix(FELL_BACK)]
        if code != SolveStatus.SOLVED:
            status[rows] = code
        fallback[rows] |= name.endswith(FELL_BACK)
    return status, fallback


def _plans(recording: Recording) -> list[Any]:
    time, _ = recording.column("/planner/progress", "scalars")

    def lane(entity: str) -> list[str]:
        """The state at each plan: only changes were written."""
        stamps, states = recording.column(entity, "state")
        latest = np.searchsorted(stamps, time + 1e-9, side="right") - 1
        return [str(states[k][0]) for k in latest]

    stages = [
        [StageReport(SolveStatus[name], np.nan, 0) for name in lane(f"/solver_status/stage{i}")] for i in (1, 2, 3)
    ]
    hands = [[word.rstrip(")").partition(" (")[::2] for word in lane(f"/contact_phase/{side}")] for side in SIDES]
    return [
        SimpleNamespace(
            time=float(t),
            stage1=stages[0][k],
            stage2=stages[1][k],
            stage3=stages[2][k],
            contact_phase=np.array([ContactPhase[hand[k][0].upper()] for hand in hands]),
            contact_patch=tuple(hand[k][1] for hand in hands),
        )
        for k, t in enumerate(time)
    ]


def _hand_reference(recording: Recording, side: str, time: FloatArray) -> FloatArray:
    stamps, points = recording.column(f"/world/hands/{side}/reference", "positions")
    reference = np.full((len(time), 3), np.nan)
    for k, point in zip(np.searchsorted(time, stamps - 1e-9), points, strict=True):
        if point.size and k < len(time):
            reference[k] = point
    return reference


def _schedule(recording: Recording) -> LoopTiming:
    run = recorded_run(recording)
    timing = LoopTiming(expected_ticks=1)
    timing.begin(timestep=1.0 / run.document["scenario"]["loop"]["physics_rate"], realtime=run.document["realtime"])
    for snapshot, effect in run.schedule.effects.items():
        timing.plan(snapshot=snapshot, effect=effect)
    return timing
