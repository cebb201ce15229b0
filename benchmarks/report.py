"""What a benchmark answers: a section with tables, on the terminal and in docs/benchmarks.md."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import wrap

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table as RichTable

WIDTH = 120  # of a paragraph
MARK = "<!-- {} -->"  # line around a section, so that `write` replaces only what was measured anew


@dataclass
class Table:
    """One table; the first column is text, the others are numbers."""

    headers: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)
    title: str = ""


@dataclass
class Section:
    """What one part of `python -m benchmarks` has measured."""

    part: str  # its name on the command line
    title: str
    tables: list[Table] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # paragraphs: what was compared, what differs, what it means
    pictures: dict[str, str] = field(default_factory=dict)  # SVG by file name
    document: str = "benchmarks.md"  # in docs/

    def show(self, console: Console) -> None:
        """Print it."""
        console.rule(self.title, align="left")
        for table in self.tables:
            shown = RichTable(title=table.title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
            for i, header in enumerate(table.headers):
                shown.add_column(header, justify="right" if i else "left")
            for row in table.rows:
                shown.add_row(*row)
            console.print(shown)
        for note in self.notes:
            console.print(" ".join(note.split()), markup=False)

    def markdown(self, footer: str) -> str:
        """The section of docs/benchmarks.md; `footer` says where and how fast the machine was."""
        lines = [f"## {self.title}", "", f"`python -m benchmarks {self.part}`", ""]
        for table in self.tables:
            lines += [f"**{table.title}**", ""] if table.title else []
            lines += [_row(table.headers), _row(["---"] + ["---:"] * (len(table.headers) - 1))]
            lines += [*(_row(row) for row in table.rows), ""]
        for picture in self.pictures:
            lines += [f"![{self.title}](pictures/{picture})", ""]
        for note in self.notes:
            lines += [*wrap(" ".join(note.split()), WIDTH, break_on_hyphens=False), ""]
        return "\n".join([*lines, f"*{footer}*", ""])


def write(docs: Path, section: Section, footer: str) -> None:
    """Put the section in the place of its last measurement in its document, a new one at the end; and its pictures."""
    path = docs / section.document
    text = path.read_text(encoding="utf-8") if path.exists() else HEADS[section.document]
    begin, end = MARK.format(section.part), MARK.format(f"end of {section.part}")
    block = f"{begin}\n{section.markdown(footer)}{end}\n"
    pattern = re.compile(f"{re.escape(begin)}\n.*?{re.escape(end)}\n", re.DOTALL)
    text = pattern.sub(lambda _: block, text) if pattern.search(text) else f"{text}\n{block}"
    path.write_text(text, encoding="utf-8")
    for name, picture in section.pictures.items():
        (docs / "pictures").mkdir(exist_ok=True)
        (docs / "pictures" / name).write_text(picture, encoding="utf-8")


def machine() -> str:
    """Processor, cores and Python of this machine."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists() and (found := re.search(r"model name\s*: (.*)", info.read_text(encoding="utf-8"))):
        model = found[1].strip()
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}"


def micro(seconds: Sequence[float] | np.ndarray, percentile: float) -> str:
    """A percentile of `seconds` in µs."""
    value = 1e6 * float(np.percentile(seconds, percentile))
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"


def ratio(theirs: Sequence[Sequence[float]], ours: Sequence[Sequence[float]]) -> str:
    """How many times ours theirs takes: median over interleaved blocks of the ratio of p50s, and its 10–90 % range.

    Both hold one list of seconds for each block; the blocks of one index ran next to each other; one may have fewer.
    """
    ratios = [float(np.median(a) / np.median(b)) for a, b in zip(theirs, ours, strict=False)]
    if not ratios:
        return "–"
    low, middle, high = np.percentile(ratios, [10, 50, 90])
    digits = 2 if middle < 10.0 else 0
    return f"{middle:.{digits}f} ({low:.{digits}f}–{high:.{digits}f})"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


HEADS = {
    "benchmarks.md": """# Benchmarks

Written by `make bench`: every number below was measured by the command over it, peers and this project alternating
block by block in one run, the same answer checked first. A ratio is the median over the blocks of p50 against p50, its
10–90 % range in brackets. Trust ratios; microseconds belong to the machine, which a fixed numpy kernel (a 64 × 64
product and its Cholesky factor) describes under each part. Nothing here is asserted by a test.
""",
    "profile.md": """# Profile

Where one simulated second of `reach` goes, function by function; written by `make bench PARTS=profile`.
""",
}
