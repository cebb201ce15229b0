"""The table and the picture of stage 3 against its peers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

if TYPE_CHECKING:
    from benchmarks.stage3_peers import Meeting, Size, Times

BEGIN, END = "<!-- table: made by benchmarks.stage3_peers -->", "<!-- end of table -->"
ENUMERATION = "enumeration"


def table(meeting: Meeting, sizes: list[Size]) -> list[str]:
    """Lines of Markdown: a row for each size."""
    names = list(meeting.peers)
    lines = [
        f"| candidates × knots | {ENUMERATION} [ms] | of it CPU | "
        + " | ".join(f"{name} [ms]" for name in names)
        + " |",
        "|---|---|---|" + "---|" * len(names),
    ]
    for size in sizes:
        own = meeting.own[size]
        cells = [_cell(meeting.peers[name][size], float(np.median(own.inside))) for name in names]
        ours = f"{_milliseconds(own.total)} | {_milliseconds(own.inside)}"
        lines.append(f"| {size[0]} × {size[1]} | {ours} | " + " | ".join(cells) + " |")
    return lines


def forces_table(seconds: dict[int, tuple[list[float], list[float]]]) -> list[str]:
    """Lines of Markdown: the forces of given contacts at 16 knots."""
    lines = ["| forces of | one QP, daqp [ms] | knot by knot [ms] | |", "|---|---|---|---|"]
    for contacts, (plain, knots) in seconds.items():
        ratio = float(np.median(plain) / np.median(knots))
        what = "one contact" if contacts == 1 else f"{contacts} contacts"
        lines.append(f"| {what} | {_milliseconds(plain)} | {_milliseconds(knots)} | **{ratio:.0f} ×** |")
    return lines


def _cell(times: Times, reference: float) -> str:
    """Median (99 %) of the wall clock and the ratio of CPU times; what went wrong."""
    if times.beyond:
        return f"> {1e3 * times.beyond:.3g} **> {times.beyond / reference:.0f} ×**"
    if not times.total:
        return times.refused
    notes = [f"{count} {word}" for count, word in ((times.wrong, "wrong"), (times.gave_up, "gave up")) if count]
    ratio = float(np.median(times.inside)) / reference
    return ", ".join([f"{_milliseconds(times.total)} **{ratio:.0f} ×**", *notes])


def _milliseconds(seconds: list[float]) -> str:
    p50, p99 = 1e3 * np.percentile(seconds, [50, 99])
    return f"{p50:.3g} ({p99:.3g})"


def write(page: Path, lines: list[str]) -> None:
    """Put the table between the page's two marks."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    page.write_text("\n".join([before + BEGIN, *lines, END + after]), encoding="utf-8")


def draw(path: Path, meeting: Meeting, sizes: list[Size]) -> None:
    """Median times over the number of candidates, a panel for each number of knots."""
    candidates, knots = (sorted({size[axis] for size in sizes}) for axis in (0, 1))
    figure, panels = plt.subplots(1, len(knots), sharey=True, figsize=(2.6 * len(knots), 3.4), squeeze=False)
    for panel, count in zip(panels[0], knots, strict=True):
        curves = {ENUMERATION: meeting.own, **meeting.peers}
        for name, times in curves.items():
            known = [c for c in candidates if (c, count) in times and times[c, count].total]
            p50, p99 = (1e3 * np.array([np.percentile(times[c, count].total, q) for c in known]) for q in (50, 99))
            width = 2.5 if name == ENUMERATION else 1.2
            (line,) = panel.loglog(known, p50, marker="o", markersize=3, linewidth=width, label=name)
            panel.loglog(known, p99, linestyle=":", linewidth=0.8, color=line.get_color())
        panel.set_title(f"{count} knot{'s' if count > 1 else ''}", fontsize=10)
        panel.set_xticks(candidates, [str(c) for c in candidates])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
        panel.set_xlabel("candidates")
    panels[0, 0].set_ylabel("time of a solve [ms]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.9))
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
