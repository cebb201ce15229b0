"""The figure of a run: its panels one below the other, pushes and hand contacts shaded through all of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")  # no screen
from matplotlib.figure import Figure

from wbmpc.errors import WbmpcError
from wbmpc.figures.panels import HANDS, Band, Curve, Ink, Note, Outline, Panel, panels_of
from wbmpc.figures.trace import Trace
from wbmpc.files import writing
from wbmpc.rerun_sink import palette

WIDTH = 9.5  # [in]
PANEL_HEIGHT = 1.5  # [in]
DPI = 110
FORMATS = (".png", ".webp", ".pdf", ".svg")
_RGB = {
    Ink.MEASURED: palette.MEASURED,
    Ink.PLANNED: palette.PLANNED,
    Ink.LIMIT: palette.LIMIT,
    Ink.FAULT: palette.FAULT,
    Ink.LEFT: palette.LEFT,
    Ink.RIGHT: palette.RIGHT,
    Ink.X: palette.AXES[0],
    Ink.Y: palette.AXES[1],
}
COLOUR = {ink: (red / 255, green / 255, blue / 255) for ink, (red, green, blue) in _RGB.items()}


def figure_of(trace: Trace, title: str) -> Figure:
    """The figure of one run."""
    panels = panels_of(trace)
    heights = [panel.height for panel in panels]
    figure = Figure(figsize=(WIDTH, PANEL_HEIGHT * sum(heights) + 0.7), dpi=DPI, layout="constrained")
    rows = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        for item in panel.items:
            _draw(axes, item)
        _dress(axes, panel, trace)
    timed = [axes for axes, panel in zip(rows, panels, strict=True) if panel.over_time]
    for axes in timed[:-1]:
        axes.tick_params(labelbottom=False)
    if timed:
        timed[-1].set_xlabel("time [s]", fontsize=8)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; its suffix says how.

    Raises:
        WbmpcError: an unknown suffix, or the file cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise WbmpcError(f"{path}: unknown kind of figure; choose one of {', '.join(FORMATS)}")
    with writing(path):
        options: dict[str, Any] = {"pil_kwargs": {"lossless": True}} if path.suffix.lower() == ".webp" else {}
        figure.savefig(path, **options)


def _draw(axes: Any, item: Curve | Band | Outline | Note) -> None:
    colour = COLOUR[item.ink]
    if isinstance(item, Note):
        if item.dot:
            axes.plot([item.x], [item.y], marker="o", ms=5, color=colour, ls="none", label="_")
            axes.annotate(item.text, (item.x, item.y), xytext=(4, 4), textcoords="offset points", fontsize=7)
        else:
            axes.annotate(item.text, (item.x, item.y), ha="center", fontsize=7, color=colour)
        return
    label = item.label or "_"
    if isinstance(item, Curve):
        style = "--" if item.dashed else "-"
        axes.plot(item.x, item.y, color=colour, lw=item.width, ls=style, label=label)
    elif isinstance(item, Band):
        axes.fill_between(item.x, item.low, item.high, color=colour, alpha=0.18, lw=0, label=label)
    else:
        axes.fill(*item.corners.T, facecolor=(*colour, 0.12), edgecolor=colour, lw=0.8, label=label)


def _dress(axes: Any, panel: Panel, trace: Trace) -> None:
    """What all panels have: grid, legend, and in time the shades."""
    axes.set_ylabel(panel.y_label, fontsize=8)
    axes.grid(lw=0.4, alpha=0.5)
    axes.tick_params(labelsize=8)
    if panel.over_time:
        axes.set_xlim(trace.time[0], trace.time[-1])
        for contact in trace.hand_contacts:
            axes.axvspan(contact.start, contact.end, color=COLOUR[HANDS[contact.side]], alpha=0.08, lw=0)
        for start, end in trace.pushes:
            axes.axvspan(start, end, color=COLOUR[Ink.FAULT], alpha=0.25, lw=0)
    else:
        axes.set_xlabel("x [cm], ahead", fontsize=8)
        axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
