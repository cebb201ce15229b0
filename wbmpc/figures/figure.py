"""The figure of a run: its panels one below the other, pushes and hand contacts shaded through all of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")  # no screen
from matplotlib.figure import Figure

from wbmpc.checks.stretches import stretches
from wbmpc.errors import WbmpcError
from wbmpc.figures.panels import FAULT, HANDS, Panel, panels_of
from wbmpc.figures.trace import Trace

WIDTH = 9.5  # [in]
PANEL_HEIGHT = 1.5  # [in]
DPI = 110
FORMATS = (".png", ".webp", ".pdf", ".svg")
_LEAST_SHARE = 0.004  # of the time axis: a shorter push would not be seen


def figure_of(trace: Trace, title: str) -> Figure:
    """The figure of one run."""
    panels = panels_of(trace)
    heights = [panel.height for panel in panels]
    figure = Figure(figsize=(WIDTH, PANEL_HEIGHT * sum(heights) + 0.7), dpi=DPI, layout="constrained")
    rows = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        panel.draw(axes, trace)
        _dress(axes, panel, trace)
    timed = [axes for axes, panel in zip(rows, panels, strict=True) if panel.over_time]
    for axes in timed[:-1]:
        axes.tick_params(labelbottom=False)
    if timed:
        timed[-1].set_xlabel("time [s]")
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; its suffix says how.

    Raises:
        WbmpcError: an unknown suffix, or the file cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise WbmpcError(f"{path}: unknown kind of figure; choose one of {', '.join(FORMATS)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        options: dict[str, Any] = {"pil_kwargs": {"lossless": True}} if path.suffix.lower() == ".webp" else {}
        figure.savefig(path, **options)
    except OSError as error:
        raise WbmpcError(f"cannot write the figure {path}: {error.strerror or error}") from error


def _dress(axes: Any, panel: Panel, trace: Trace) -> None:
    """What all panels have: grid, legend, and in time the shades."""
    axes.grid(lw=0.4, alpha=0.5)
    axes.tick_params(labelsize=8)
    axes.yaxis.label.set_size(8)
    axes.xaxis.label.set_size(8)
    if panel.over_time:
        axes.set_xlim(trace.time[0], trace.time[-1])
        for contact in trace.hand_contacts:
            axes.axvspan(contact.start, contact.end, color=HANDS[contact.side], alpha=0.08, lw=0)
        least = _LEAST_SHARE * np.ptp(trace.time)
        for first, stop in stretches(np.any(trace.push != 0, axis=1)):
            start, end = trace.time[first], trace.time[stop - 1]
            axes.axvspan(start, max(end, start + least), color=FAULT, alpha=0.25, lw=0)
    else:
        axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
