"""Where two runs part: which signal first, by how much, and from when on it shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.snapshots import digest
from wbmpc.signals import SIDES, PlanReport

VISIBLE = 0.01  # of a signal's range over the first run: from there on a curve is seen to leave the other
AXES = "xyz"
PLAN = "plan"
# Columns of the recorder in the order in which a tick makes them: what differs first is the cause. Name, unit, and for
# what has a number of each joint, how many come before the joints.
SIGNALS: dict[str, tuple[str, str, int | None]] = {
    "state_q": ("estimated posture", "m, rad", 7),
    "state_v": ("estimated velocity", "m/s, rad/s", 6),
    "state_sole_wrench_in_world": ("sole wrenches, sensed", "N, N·m", None),
    "state_palm_force_in_world": ("palm forces, sensed", "N", None),
    PLAN: ("plan", "", None),
    "setpoint_com_position": ("CoM setpoint", "m", None),
    "setpoint_joint_position": ("joint setpoints", "rad", 0),
    "setpoint_hand_position": ("palm setpoints", "m", None),
    "setpoint_hand_force": ("palm force setpoints", "N", None),
    "command_torque": ("commanded torques", "N·m", 0),
    "external_force": ("disturbance", "N", None),
    "qpos": ("true posture", "m, rad", 7),
    "qvel": ("true velocity", "m/s, rad/s", 6),
    "com": ("CoM", "m", None),
    "palm_position": ("palms", "m", None),
    "sole_position": ("soles", "m", None),
    "zmp": ("ZMP of the feet", "m", None),
}


@dataclass(frozen=True, slots=True)
class Parting:
    """How one signal of two runs parts."""

    signal: str
    unit: str
    tick: int  # first one with another bit
    time: float  # [s] of that tick
    component: str  # which of the signal's numbers differs most at that tick
    first: float  # [unit] by how much
    visible: float | None  # [s] from when on the difference is VISIBLE; None: never
    largest: float  # [unit] over all ticks
    largest_at: float  # [s]


def partings(one: Recorder, other: Recorder, *, joint_names: Sequence[str]) -> list[Parting]:
    """All signals that differ, the first to differ first; those of one tick in the order of cause and effect."""
    found = []
    for name in SIGNALS:
        parting = _of_plans(one, other) if name == PLAN else _of_column(one, other, name, joint_names)
        if parting is not None:
            found.append(parting)
    return sorted(found, key=lambda parting: parting.tick)


def _of_column(one: Recorder, other: Recorder, name: str, joint_names: Sequence[str]) -> Parting | None:
    signal, unit, first_joint = SIGNALS[name]
    common = min(one.ticks, other.ticks)
    a, b = (run.column(name)[:common].reshape(common, -1) for run in (one, other))
    differs = (a != b) & ~(np.isnan(a) & np.isnan(b))
    ticks = np.flatnonzero(differs.any(axis=1))
    if not len(ticks):
        return None
    distance = np.where(differs, np.nan_to_num(np.abs(a - b)), 0.0)
    tick, finite = int(ticks[0]), np.isfinite(a).any(axis=0)
    reach = np.zeros(a.shape[1])
    reach[finite] = np.nanmax(a[:, finite], axis=0) - np.nanmin(a[:, finite], axis=0)
    # The largest range counts for all components: an axis that rests has no range of its own.
    seen = np.flatnonzero(distance.max(axis=1) > VISIBLE * reach.max())
    place, worst = int(distance[tick].argmax()), int(distance.max(axis=1).argmax())
    return Parting(
        signal=signal,
        unit=unit,
        tick=tick,
        time=float(one.time[tick]),
        component=_component(place, one.column(name).shape[1:], first_joint, joint_names),
        first=float(distance[tick, place]),
        visible=float(one.time[seen[0]]) if len(seen) else None,
        largest=float(distance[worst].max()),
        largest_at=float(one.time[worst]),
    )


def _of_plans(one: Recorder, other: Recorder) -> Parting | None:
    for a, b in zip(one.plans, other.plans, strict=False):
        if digest(a) != digest(b):
            tick = int(np.searchsorted(one.time, a.time - 1e-9))
            what = next((word for word, differs in _kinds(a, b) if differs), "statuses")
            return Parting(SIGNALS[PLAN][0], "", tick, a.time, what, np.nan, None, np.nan, np.nan)
    return None


def _kinds(a: PlanReport, b: PlanReport) -> Iterator[tuple[str, bool]]:
    """What two plans may differ in, the most telling first."""
    yield "contacts", a.contact_patch != b.contact_patch
    yield "candidates", [(c.cost, c.reason) for c in a.candidates] != [(c.cost, c.reason) for c in b.candidates]
    yield "forces", not np.array_equal(a.contact_force, b.contact_force)
    yield "motion", not np.array_equal(a.com, b.com, equal_nan=True)
    yield "need of a contact", not np.array_equal(a.delta_z, b.delta_z)


def _component(place: int, shape: tuple[int, ...], first_joint: int | None, joint_names: Sequence[str]) -> str:
    """What the number `place` of a signal of this shape is called."""
    if first_joint is not None:
        joint = place - first_joint
        return "base" if joint < 0 else joint_names[joint] if joint < len(joint_names) else "object"
    side = f"{SIDES[place // shape[-1]]} " if len(shape) == 2 else ""
    within = place % shape[-1]
    return f"{side}{AXES[within]}" if within < 3 else f"{side}moment {AXES[within - 3]}"
