"""The curves of one recording, all at the same samples, as the panels of a figure want them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks.stretches import joined, stretches
from wbmpc.footage import Footage, site_poses
from wbmpc.rerun_sink.reading import Recording
from wbmpc.signals import SIDES

FloatArray = NDArray[np.float64]
TOUCH = 0.3  # [N] lighter touches of a palm are no contact
_LEAST_SHARE = 0.004  # of the time axis: a shorter push would not be seen
LEAST_GAP = 0.5  # [s] between two contacts of a hand: a palm that settles bounces a little


@dataclass(frozen=True, slots=True)
class HandContact:
    """One stretch of time in which a palm pushes on something."""

    side: int
    start: float  # [s]
    end: float  # [s]
    patch: str  # "" when none was planned


@dataclass(frozen=True, slots=True)
class Trace:
    """n samples of one run; nan where something was not there."""

    time: FloatArray  # (n,) [s]
    com: FloatArray  # (n, 3) [m]
    com_planned: FloatArray  # (n, 3) [m]
    com_height_band: FloatArray  # (n, 2) [m] least and greatest height of stage 1
    zmp: FloatArray  # (n, 2) [m] of the feet, measured
    support: FloatArray  # (n, 2, 2) [m] least and greatest x, then y, of the support polygon
    delta_z: FloatArray  # (n,) [m] largest |ΔZ| over the horizon
    hand_force: FloatArray  # (n, 2) [N] sensed, of each hand
    hand_force_planned: FloatArray  # (n, 2) [N]
    push: FloatArray  # (n, 3) [N] declared disturbance
    palm: FloatArray  # (n, 2, 3) [m]
    sole: FloatArray  # (n, 2, 4, 3) [m] corners of both soles, in order around each
    sole_force: FloatArray  # (n, 2) [N] vertical, sensed
    torque_share: FloatArray  # (n, nj) torque over what the servo can give at that speed
    joint_names: tuple[str, ...]  # nj
    hand_contacts: tuple[HandContact, ...]

    @property
    def com_velocity(self) -> FloatArray:
        """(n, 3) [m/s]"""
        return np.asarray(np.gradient(self.com, self.time, axis=0)) if len(self.time) > 1 else np.zeros_like(self.com)

    @property
    def pushes(self) -> list[tuple[float, float]]:
        """Start and end [s] of every declared push; a short one is drawn as long as can be seen."""
        least = _LEAST_SHARE * float(np.ptp(self.time))
        spans = [(float(self.time[a]), float(self.time[b - 1])) for a, b in stretches(np.any(self.push != 0, axis=1))]
        return [(start, max(end, start + least)) for start, end in spans]

    @property
    def feet_travel(self) -> float:
        """[m] how far a sole comes from where it began, on the floor."""
        centre = self.sole[..., :2].mean(axis=2)  # (n, 2, 2)
        return float(np.linalg.norm(centre - centre[0], axis=2).max())


def trace_of(recording: Recording, footage: Footage) -> Trace:
    """The curves of `recording`, at the samples of its `footage`."""
    time = footage.time

    def scalars(entity: str, columns: int) -> FloatArray:
        """(n, columns) the latest values at each sample."""
        stamps, values = recording.column(entity, "scalars")
        if not len(stamps):
            return np.full((len(time), columns), np.nan)
        latest = np.searchsorted(stamps, time + 1e-9, side="right") - 1
        rows = np.array(values, dtype=float)[np.maximum(latest, 0)]
        return np.where((latest >= 0)[:, None], rows, np.nan)

    com = np.stack([scalars(f"/com/{axis}", 2) for axis in "xyz"], axis=1)  # (n, 3, 2)
    hands = np.stack([scalars(f"/contacts/{side}_hand", 3) for side in SIDES], axis=1)  # (n, 2, 3)
    feet = np.stack([scalars(f"/contacts/{side}_foot", 2) for side in SIDES], axis=1)
    joints = tuple(str(name) for name in recording.static("/joints/torque_share", "names"))
    palm, sole = _hands_and_feet(footage)
    return Trace(
        time=time,
        com=com[:, :, 0],
        com_planned=com[:, :, 1],
        com_height_band=scalars("/com/z/band", 2),
        zmp=np.column_stack([scalars(f"/zmp/{axis}/measured", 1) for axis in "xy"]),
        support=np.stack([scalars(f"/zmp/{axis}/support", 2) for axis in "xy"], axis=1),
        delta_z=1e-3 * scalars("/planner/delta_z", 3)[:, 2],
        hand_force=hands[:, :, 0],
        hand_force_planned=hands[:, :, 1],
        push=recording.pushes(time),
        palm=palm,
        sole=sole,
        sole_force=feet[:, :, 0],
        torque_share=scalars("/joints/torque_share", len(joints)),
        joint_names=joints,
        hand_contacts=tuple(_hand_contacts(recording, time, hands[:, :, 0])),
    )


def _hand_contacts(recording: Recording, time: FloatArray, force: FloatArray) -> Iterator[HandContact]:
    spacing = float(time[-1] - time[0]) / max(1, len(time) - 1)
    gap = round(LEAST_GAP / spacing) if spacing > 0 else 1
    for side, name in enumerate(SIDES):
        stamps, words = recording.words(f"/contact_phase/{name}", "state")
        for first, stop in joined(force[:, side] > TOUCH, gap):
            start, end = float(time[first]), float(time[stop - 1])
            latest = int(np.searchsorted(stamps, 0.5 * (start + end), side="right")) - 1
            patch = words[latest].partition("(")[2].rstrip(")") if latest >= 0 else ""
            yield HandContact(side, start, end, patch)


def _hands_and_feet(footage: Footage) -> tuple[FloatArray, FloatArray]:
    """Palm centres (n, 2, 3) and corners of the soles (n, 2, 4, 3) [m], from the recorded postures."""
    names = [f"{side}_{site}" for site in ("palm", "sole") for side in SIDES]
    position, rotation = site_poses(footage.model, footage.qpos, names)
    size = footage.model.geom(f"{SIDES[0]}_foot").size  # the model contract: a box whose underside the sole is
    corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) * size
    return position[:, :2], np.einsum("nsij,kj->nski", rotation[:, 2:], corners) + position[:, 2:, None]
