"""The numbers of a run that every scenario has, whatever it checks: `metrics` of NAME.json, see docs/results.md."""

from __future__ import annotations

import numpy as np

from wbmpc.checks.blocks import by_blocks, lengths
from wbmpc.checks.context import CheckContext
from wbmpc.checks.hand_contacts import hand_contacts
from wbmpc.signals import SolveStatus, Vector


def metrics_of(context: CheckContext) -> dict[str, float]:
    """Metrics by name, in SI units; nan where a run has no such thing."""
    recorder, facts = context.recorder, context.facts
    if recorder.ticks == 0:
        return {"simulated_time": 0.0}
    joints = facts.no_load_speed.size
    palm_push = lengths(context.palm_force)  # (n, 2)
    stage3 = sum(plan.stage3.status != SolveStatus.NOT_RUN for plan in recorder.plans)
    hands = hand_contacts(context)
    return {
        "simulated_time": recorder.ticks * facts.timestep,
        "robot_mass": facts.mass,
        "com_height_min": float(recorder.com[:, 2].min()),
        "com_height_max": float(recorder.com[:, 2].max()),
        "com_speed_max": float(lengths(recorder.com_velocity).max()),
        "torso_up_min": float(recorder.torso_up.min()),
        "torque_peak_fraction": float((_largest(recorder.torque) / facts.stall_torque).max()),
        "speed_peak_fraction": float((_largest(recorder.qvel[:, 6 : 6 + joints]) / facts.no_load_speed).max()),
        "penetration_max": 0.0 - float(recorder.contacts.distance.min(initial=0.0)),
        "hand_force_max": float(palm_push.max()),
        "hand_contacts": float(len(hands)),
        "first_hand_contact": float(recorder.time[hands[0].start]) if hands else np.nan,
        "plans": float(len(recorder.plans)),
        "stage3_plans": float(stage3),
    }


def _largest(values: Vector) -> Vector:
    """(w,) largest magnitudes over the rows of `values` (n, w)."""
    return by_blocks(lambda block: np.abs(block).max(axis=0, keepdims=True), values).max(axis=0)
