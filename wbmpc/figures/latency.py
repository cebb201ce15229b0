"""The figure of a latency sweep: how far each check is from failing, over the plan delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl

from wbmpc.figures.figure import COLOUR, DPI, WIDTH
from wbmpc.figures.panels import Ink

_HEIGHT = 3.2  # [in]


def latency_figure(
    title: str, *, delay: Sequence[float], passed: Sequence[bool], margins: Mapping[str, Sequence[float]]
) -> mpl.figure.Figure:
    """One curve for each check; the runs and how they ended as marks on the line of zero margin.

    Args:
        delay: (n,) [ms], ascending.
        passed: (n,) verdicts.
        margins: by check, (n,) distance from the threshold over the threshold; negative: failed.
    """
    figure = mpl.figure.Figure(figsize=(WIDTH, _HEIGHT), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    axes.axhspan(-1.1, 0.0, color=COLOUR[Ink.FAULT], alpha=0.08, lw=0)
    axes.axhline(0.0, color=COLOUR[Ink.LIMIT], lw=1.0)
    styles = ("-", "--", ":", "-.")
    for place, (name, values) in enumerate(margins.items()):
        axes.plot(delay, values, color=f"C{place % 10}", ls=styles[place // 10 % 4], lw=1.4, marker=".", label=name)
    for verdict, colour, marker in ((True, COLOUR[Ink.MEASURED], "o"), (False, COLOUR[Ink.FAULT], "X")):
        at = [d for d, ended in zip(delay, passed, strict=True) if ended is verdict]
        label = "the run passes" if verdict else "the run fails"
        axes.plot(at, [0.0] * len(at), color=colour, marker=marker, ms=7, ls="none", label=label, zorder=3)
    axes.set_ylim(-1.1, 1.1)
    axes.set_xlabel("plan delay [ms]", fontsize=8)
    axes.set_ylabel("margin / threshold", fontsize=8)
    axes.grid(lw=0.4, alpha=0.5)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure
