"""The panels of a figure. Which of them a run shows follows from what happened in it, never from its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbmpc.checks.stretches import stretches
from wbmpc.figures.trace import TOUCH, Trace
from wbmpc.rerun_sink import palette
from wbmpc.signals import SIDES

STEPPED = 0.03  # [m] a foot that travels farther has stepped
EXCURSION = 0.015  # [m] the CoM's range along an axis that is worth a panel
CLIMB = 0.05  # [m] of the CoM height that is shown whatever else moves
SHIFT = 2e-3  # [m] a smaller ΔZ asks for no contact
STANCE_SHARE = 0.1  # of a foot's largest load: less is a swing foot's touch
LEAST_STANCE = 0.05  # [s] a shorter touch leaves no footprint


def colour(rgb: tuple[int, int, int]) -> tuple[float, float, float]:
    """A colour of the recordings for matplotlib."""
    red, green, blue = rgb
    return red / 255, green / 255, blue / 255


MEASURED, PLANNED, LIMIT, FAULT = map(colour, (palette.MEASURED, palette.PLANNED, palette.LIMIT, palette.FAULT))
HANDS = (colour(palette.LEFT), colour(palette.RIGHT))


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes."""

    draw: Callable[[Any, Trace], None]  # on matplotlib axes
    over_time: bool = True  # False: a plan view, x ahead and y to the left
    height: float = 1.0  # relative to the others


def panels_of(trace: Trace) -> list[Panel]:
    """What a run shows: from where the ZMP was to which hand pushed how hard. Never empty."""
    panels: list[Panel] = []
    com_range = np.ptp(trace.com, axis=0)
    if trace.feet_travel > STEPPED:
        panels.append(Panel(draw_footprints, over_time=False, height=2.2))
    moved = [axis for axis in (0, 1) if com_range[axis] > EXCURSION]
    pushed, held = np.any(trace.push != 0), bool(trace.hand_contacts)
    if com_range[2] > CLIMB or (com_range[2] > EXCURSION and com_range[2] > com_range[:2].max()):
        panels.append(Panel(draw_height))
    for axis in moved or [int(np.argmax(com_range[:2]))]:
        panels.append(Panel(lambda axes, trace, axis=axis: draw_balance(axes, trace, axis)))  # type: ignore[misc]
    if pushed:
        panels.append(Panel(draw_velocity))
    if held or np.nanmax(trace.delta_z, initial=0.0) > SHIFT:
        panels.append(Panel(draw_shift, height=0.7))
    if held:
        panels.append(Panel(draw_hand_forces))
    return panels


def draw_balance(axes: Any, trace: Trace, axis: int) -> None:
    """CoM and ZMP along one axis against the support of the feet, in time."""
    low, high = 100 * trace.support[:, axis].T
    axes.fill_between(trace.time, low, high, color=LIMIT, alpha=0.18, lw=0, label="support of the feet")
    axes.plot(trace.time, 100 * trace.zmp[:, axis], color=FAULT, lw=0.8, label="ZMP")
    axes.plot(trace.time, 100 * trace.com[:, axis], color=MEASURED, lw=2.2, label="CoM")
    axes.plot(trace.time, 100 * trace.com_planned[:, axis], color=PLANNED, lw=1.0, ls="--", label="CoM planned")
    axes.set_ylabel(f"{'xy'[axis]} [cm], {'ahead' if axis == 0 else 'left'}")


def draw_height(axes: Any, trace: Trace) -> None:
    """CoM height against the band of stage 1, in time, and the height of hands that hold something: [M] Fig. 4."""
    low, high = 100 * trace.com_height_band.T
    axes.fill_between(trace.time, low, high, color=LIMIT, alpha=0.18, lw=0, label="band of stage 1")
    axes.plot(trace.time, 100 * trace.com[:, 2], color=MEASURED, lw=2.2, label="CoM")
    axes.plot(trace.time, 100 * trace.com_planned[:, 2], color=PLANNED, lw=1.0, ls="--", label="CoM planned")
    for side, name in enumerate(SIDES):
        if (trace.hand_force[:, side] > TOUCH).any():
            axes.plot(trace.time, 100 * trace.palm[:, side, 2], color=HANDS[side], lw=1.2, label=f"{name} hand")
    axes.set_ylabel("z [cm]")


def draw_velocity(axes: Any, trace: Trace) -> None:
    """CoM velocity, in time."""
    for axis, rgb in zip("xy", palette.AXES, strict=False):
        axes.plot(trace.time, trace.com_velocity[:, "xy".index(axis)], color=colour(rgb), lw=1.2, label=f"CoM {axis}")
    axes.set_ylabel("velocity [m/s]")


def draw_shift(axes: Any, trace: Trace) -> None:
    """The ZMP shift that stage 2 asks of a contact, in time."""
    axes.plot(trace.time, 100 * trace.delta_z, color=PLANNED, lw=1.2, label="largest |ΔZ| over the horizon")
    axes.set_ylabel("ΔZ [cm]")


def draw_hand_forces(axes: Any, trace: Trace) -> None:
    """Forces of the hands, in time, with the names of the patches that they were made on."""
    for side, name in enumerate(SIDES):
        if (trace.hand_force[:, side] > TOUCH).any():
            planned = np.where(trace.hand_force_planned[:, side] > 0, trace.hand_force_planned[:, side], np.nan)
            axes.plot(trace.time, trace.hand_force[:, side], color=HANDS[side], lw=1.8, label=f"{name} hand")
            axes.plot(trace.time, planned, color=PLANNED, lw=1.0, ls="--", label="planned")
    top = float(trace.hand_force.max())
    for contact in trace.hand_contacts:
        if contact.end - contact.start > 0.02 * np.ptp(trace.time):  # a label on a brief touch would hide the others
            where = (0.5 * (contact.start + contact.end), 0.04 * top)
            axes.annotate(contact.patch, where, ha="center", fontsize=7, color=HANDS[contact.side])
    axes.set_ylabel("hand force [N]")


def draw_footprints(axes: Any, trace: Trace) -> None:
    """Footprints with the paths of CoM and ZMP, and where hands pushed, seen from above."""
    for side in (0, 1):
        load = trace.sole_force[:, side]
        label = f"{SIDES[side]} foot"
        for first, stop in stretches(load > STANCE_SHARE * np.nanmax(load)):
            if trace.time[stop - 1] - trace.time[first] >= LEAST_STANCE:
                x, y = 100 * trace.sole[(first + stop) // 2, side, :, :2].T
                axes.fill(x, y, facecolor=(*HANDS[side], 0.12), edgecolor=HANDS[side], lw=0.8, label=label)
                label = "_"  # once in the legend
    axes.plot(*(100 * trace.zmp.T), color=FAULT, lw=0.6, alpha=0.8, label="ZMP")
    axes.plot(*(100 * trace.com[:, :2].T), color=MEASURED, lw=1.5, label="CoM")
    for contact in trace.hand_contacts:
        row = int(np.searchsorted(trace.time, 0.5 * (contact.start + contact.end)))
        x, y = 100 * trace.palm[row, contact.side, :2]
        axes.plot([x], [y], marker="o", ms=5, color=HANDS[contact.side], ls="none", label="_")
        axes.annotate(contact.patch, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set_xlabel("x [cm], ahead")
    axes.set_ylabel("y [cm], left")
