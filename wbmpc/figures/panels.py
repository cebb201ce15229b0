"""The panels of a figure, as data that `figure.py` draws with matplotlib and the report as SVG.

Which panels a run shows follows from what happened in it, never from its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from wbmpc.checks.stretches import stretches
from wbmpc.figures.trace import TOUCH, Trace
from wbmpc.signals import SIDES

FloatArray = NDArray[np.float64]
STEPPED = 0.03  # [m] a foot that travels farther has stepped
EXCURSION = 0.015  # [m] the CoM's range along an axis that is worth a panel
CLIMB = 0.05  # [m] of the CoM height that is shown whatever else moves
SHIFT = 2e-3  # [m] a smaller ΔZ asks for no contact
STANCE_SHARE = 0.1  # of a foot's largest load: less is a swing foot's touch
LEAST_STANCE = 0.05  # [s] a shorter touch leaves no footprint


class Ink(StrEnum):
    """What a colour means; the names are those of `rerun_sink.palette`."""

    MEASURED = "measured"
    PLANNED = "planned"
    LIMIT = "limit"
    FAULT = "fault"
    LEFT = "left"
    RIGHT = "right"
    X = "x"
    Y = "y"


HANDS = (Ink.LEFT, Ink.RIGHT)


@dataclass(frozen=True, slots=True)
class Curve:
    """A line through points; nan leaves a gap."""

    label: str  # "": not in the legend
    x: FloatArray  # (n,)
    y: FloatArray  # (n,)
    ink: Ink
    width: float = 1.2  # [pt]
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Band:
    """What lies between two curves."""

    label: str
    x: FloatArray  # (n,)
    low: FloatArray  # (n,)
    high: FloatArray  # (n,)
    ink: Ink = Ink.LIMIT


@dataclass(frozen=True, slots=True)
class Outline:
    """A polygon."""

    label: str
    corners: FloatArray  # (k, 2)
    ink: Ink


@dataclass(frozen=True, slots=True)
class Note:
    """A word at a place, above it with a dot there."""

    text: str
    x: float
    y: float
    ink: Ink
    dot: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes."""

    title: str
    unit: str
    y_label: str
    items: Sequence[Curve | Band | Outline | Note]
    over_time: bool = True  # False: a plan view, x ahead and y to the left
    height: float = 1.0  # relative to the others


def panels_of(trace: Trace) -> list[Panel]:
    """What a run shows: from where the ZMP was to which hand pushed how hard. Never empty."""
    panels: list[Panel] = []
    com_range = np.ptp(trace.com, axis=0)
    if trace.feet_travel > STEPPED:
        panels.append(footprints(trace))
    moved = [axis for axis in (0, 1) if com_range[axis] > EXCURSION]
    pushed, held = np.any(trace.push != 0), bool(trace.hand_contacts)
    if com_range[2] > CLIMB or (com_range[2] > EXCURSION and com_range[2] > com_range[:2].max()):
        panels.append(height(trace))
    for axis in moved or [int(np.argmax(com_range[:2]))]:
        panels.append(balance(trace, axis))
    if pushed:
        panels.append(velocity(trace))
    if held or np.nanmax(trace.delta_z, initial=0.0) > SHIFT:
        panels.append(shift(trace))
    if held:
        panels.append(hand_forces(trace))
    return panels


def all_panels_of(trace: Trace) -> list[Panel]:
    """Everything there is to see of a run, quiet as it may have been; only what never happened is left out."""
    panels = [height(trace), balance(trace, 0), balance(trace, 1)]
    if trace.feet_travel > STEPPED:
        panels.insert(0, footprints(trace))
    if np.any(trace.push != 0):
        panels.append(velocity(trace))
    if np.isfinite(trace.delta_z).any():
        panels.append(shift(trace))
    if (trace.hand_force > TOUCH).any():
        panels.append(hand_forces(trace))
    if trace.torque_share.size:
        panels.append(torque_share(trace))
    return panels


def balance(trace: Trace, axis: int) -> Panel:
    """CoM and ZMP along one axis against the support of the feet, in time."""
    t, (low, high) = trace.time, 100 * trace.support[:, axis].T
    name, way = "xy"[axis], "ahead" if axis == 0 else "left"
    items = (
        Band("support of the feet", t, low, high),
        Curve("ZMP", t, 100 * trace.zmp[:, axis], Ink.FAULT, 0.8),
        Curve("CoM", t, 100 * trace.com[:, axis], Ink.MEASURED, 2.2),
        Curve("CoM planned", t, 100 * trace.com_planned[:, axis], Ink.PLANNED, 1.0, dashed=True),
    )
    return Panel(f"CoM and ZMP, {name}", "cm", f"{name} [cm], {way}", items)


def height(trace: Trace) -> Panel:
    """CoM height against the band of stage 1, in time, and the height of hands that hold something: [M] Fig. 4."""
    t, (low, high) = trace.time, 100 * trace.com_height_band.T
    items: list[Curve | Band] = [
        Band("band of stage 1", t, low, high),
        Curve("CoM", t, 100 * trace.com[:, 2], Ink.MEASURED, 2.2),
        Curve("CoM planned", t, 100 * trace.com_planned[:, 2], Ink.PLANNED, 1.0, dashed=True),
    ]
    for side, name in enumerate(SIDES):
        if (trace.hand_force[:, side] > TOUCH).any():
            items.append(Curve(f"{name} hand", t, 100 * trace.palm[:, side, 2], HANDS[side]))
    return Panel("CoM height", "cm", "z [cm]", items)


def velocity(trace: Trace) -> Panel:
    """CoM velocity, in time."""
    curves = [Curve(f"CoM {ink}", trace.time, trace.com_velocity[:, i], ink) for i, ink in enumerate((Ink.X, Ink.Y))]
    return Panel("CoM velocity", "m/s", "velocity [m/s]", curves)


def shift(trace: Trace) -> Panel:
    """The ZMP shift that stage 2 asks of a contact, in time."""
    curve = Curve("largest |ΔZ| over the horizon", trace.time, 100 * trace.delta_z, Ink.PLANNED)
    return Panel("ZMP shift asked of a contact", "cm", "ΔZ [cm]", [curve], height=0.7)


def hand_forces(trace: Trace) -> Panel:
    """Forces of the hands, in time, with the names of the patches that they were made on."""
    items: list[Curve | Note] = []
    for side, name in enumerate(SIDES):
        if (trace.hand_force[:, side] > TOUCH).any():
            planned = np.where(trace.hand_force_planned[:, side] > 0, trace.hand_force_planned[:, side], np.nan)
            items.append(Curve(f"{name} hand", trace.time, trace.hand_force[:, side], HANDS[side], 1.8))
            items.append(Curve("planned", trace.time, planned, Ink.PLANNED, 1.0, dashed=True))
    top = float(trace.hand_force.max())
    for contact in trace.hand_contacts:
        if contact.end - contact.start > 0.02 * np.ptp(trace.time):  # a label on a brief touch would hide the others
            middle = 0.5 * (contact.start + contact.end)
            items.append(Note(contact.patch, middle, 0.04 * top, HANDS[contact.side]))
    return Panel("Hand forces", "N", "hand force [N]", items)


def torque_share(trace: Trace) -> Panel:
    """How much of what its servo can give at that speed the hardest working joint takes, in time."""
    name = trace.joint_names[int(np.argmax(trace.torque_share.max(axis=0)))]
    hardest = trace.torque_share[:, trace.joint_names.index(name)]
    items = (
        Curve("largest of all joints", trace.time, 100 * trace.torque_share.max(axis=1), Ink.LIMIT, 1.0),
        Curve(name, trace.time, 100 * hardest, Ink.MEASURED, 1.6),
    )
    return Panel("Torque, share of the servo's limit", "%", "torque [% of limit]", items)


def footprints(trace: Trace) -> Panel:
    """Footprints with the paths of CoM and ZMP, and where hands pushed, seen from above."""
    items: list[Curve | Outline | Note] = []
    for side in (0, 1):
        load = trace.sole_force[:, side]
        label = f"{SIDES[side]} foot"
        for first, stop in stretches(load > STANCE_SHARE * np.nanmax(load)):
            if trace.time[stop - 1] - trace.time[first] >= LEAST_STANCE:
                items.append(Outline(label, 100 * trace.sole[(first + stop) // 2, side, :, :2], HANDS[side]))
                label = ""  # once in the legend
    for label, path, ink, width in (("ZMP", trace.zmp, Ink.FAULT, 0.6), ("CoM", trace.com, Ink.MEASURED, 1.5)):
        items.append(Curve(label, 100 * path[:, 0], 100 * path[:, 1], ink, width))
    for contact in trace.hand_contacts:
        row = int(np.searchsorted(trace.time, 0.5 * (contact.start + contact.end)))
        x, y = 100 * trace.palm[row, contact.side, :2]
        items.append(Note(contact.patch, x, y, HANDS[contact.side], dot=True))
    return Panel("Footprints, from above", "cm", "y [cm], left", items, over_time=False, height=2.2)
