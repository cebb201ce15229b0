"""Columns of the model's mismatch: what a plan said of its first knot, drawn at that knot's time, and what was then.

The ZMP and the CoM height within stage 1's band are drawn in the same way by `plans` and `ticks`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbmpc.recorder import Recorder
from wbmpc.rerun_sink.momentum import MomentumRate
from wbmpc.rerun_sink.palette import AXES, MEASURED, PALE_AXES, PLANNED
from wbmpc.rerun_sink.stream import Stream
from wbmpc.signals import GRAVITY, SIDES, PlanReport

_VECTORS = (*(f"{side}_hand" for side in SIDES), "momentum_rate")
_FEET = "/mismatch/feet"
_ANGULAR = "/mismatch/angular_momentum_rate"


def describe_mismatch(stream: Stream) -> None:
    """Names and colours of everything that this file sends; vectors have saturated colours where measured."""
    for name in _VECTORS:
        stream.series(f"/mismatch/{name}/measured", [f"{axis} measured" for axis in "xyz"], AXES, width=1.0)
        stream.series(f"/mismatch/{name}/planned", [f"{axis} planned" for axis in "xyz"], PALE_AXES)
    stream.series(f"{_FEET}/measured", ["feet measured"], [MEASURED], width=1.0)
    stream.series(f"{_FEET}/planned", ["feet planned"], [PLANNED])
    stream.series(f"{_ANGULAR}/measured", [f"{axis} measured" for axis in "xyz"], AXES, width=1.0)
    stream.series(f"{_ANGULAR}/planned", ["planned"], [PLANNED])


def write_planned(stream: Stream, plans: Sequence[PlanReport], knot_period: float) -> None:
    """Send the plans' first knots, each `knot_period` [s] after its plan's snapshot.

    The feet carry m (g + c̈_z) − Σ f_z ([M] eq. ZMP_k's denominator); the ZMP's model takes the angular momentum about
    the CoM for constant.
    """
    time = np.array([plan.time for plan in plans]) + knot_period
    force = np.array([plan.contact_force[:, 0] for plan in plans])  # (n, 2, 3)
    momentum = np.array([plan.mass * plan.com_acceleration[0] for plan in plans])  # (n, 3)
    weight = GRAVITY * np.array([plan.mass for plan in plans])
    for name, planned in zip(_VECTORS, (force[:, 0], force[:, 1], momentum), strict=True):
        stream.scalars(f"/mismatch/{name}/planned", time, planned)
    stream.scalars(f"{_FEET}/planned", time, weight + momentum[:, 2] - force[:, :, 2].sum(axis=1))
    stream.scalars(f"{_ANGULAR}/planned", time, np.zeros(len(plans)))


def write_measured(stream: Stream, recorder: Recorder, rows: NDArray[np.int64], momentum: MomentumRate) -> None:
    """Send the ticks `rows`: forces as the robot's sensors have them, momentum as the simulator has it."""
    time, samples = recorder.time[rows], rows // recorder.stride
    palm, sole = recorder.state_palm_force_in_world[samples], recorder.state_sole_wrench_in_world[samples]
    for i, name in enumerate(_VECTORS[: len(SIDES)]):
        stream.scalars(f"/mismatch/{name}/measured", time, palm[:, i])
    stream.scalars(f"{_FEET}/measured", time, sole[:, :, 2].sum(axis=1))
    middle, rate = momentum.between(time, recorder.com_velocity[rows], recorder.angular_momentum[rows])
    if not len(middle):  # the first sample has none before it
        return
    stream.scalars(f"/mismatch/{_VECTORS[-1]}/measured", middle, rate[:, :3])
    stream.scalars(f"{_ANGULAR}/measured", middle, rate[:, 3:])
