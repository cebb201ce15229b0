"""Stacks with counts as a flame graph in SVG: width is time, a function stands on the one that called it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape
from zlib import crc32

Stack = tuple[str, ...]  # from the outermost function in

WIDTH, ROW, LETTER = 1200, 17, 6.3  # [px] picture, row, mean letter
LEAST = 2e-3  # share of the total below which a function is not drawn


@dataclass
class _Node:
    count: int = 0
    callees: dict[str, _Node] = field(default_factory=dict)


def flame_graph(stacks: Counter[Stack]) -> str:
    """The picture's text."""
    root = _Node()
    for stack, count in stacks.items():
        node = root
        node.count += count
        for name in stack:
            node = node.callees.setdefault(name, _Node())
            node.count += count
    boxes = list(_boxes(root, 0.0, 0, root.count))
    height = ROW * (1 + max((depth for _, _, depth, _ in boxes), default=0))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}"',
        ' font-family="monospace" font-size="10.5">',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for name, left, depth, share in boxes:
        width, top = share * WIDTH, height - ROW * (depth + 1)
        shown = name.removeprefix("wbmpc.")
        letters = int((width - 4) / LETTER)
        shown = shown if len(shown) <= letters else shown.rsplit(".", 1)[-1][:letters] if letters > 2 else ""
        lines.append(
            f'<g><title>{escape(name)}: {100 * share:.1f} %</title><rect x="{left * WIDTH:.1f}" y="{top}" '
            f'width="{max(width - 0.5, 0.5):.1f}" height="{ROW - 1}" rx="1" fill="{_colour(name)}"/>'
            f'<text x="{left * WIDTH + 2:.1f}" y="{top + 12}">{escape(shown)}</text></g>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _boxes(node: _Node, left: float, depth: int, total: int) -> Iterator[tuple[str, float, int, float]]:
    """Name, left edge and share of the total, and depth of every function drawn, widest first among siblings."""
    for name, callee in sorted(node.callees.items(), key=lambda item: -item[1].count):
        share = callee.count / total
        if share >= LEAST:
            yield name, left, depth, share
            yield from _boxes(callee, left, depth + 1, total)
        left += share


def _colour(name: str) -> str:
    """One hue for each module, so that the blocks of the loop can be told apart; libraries are grey."""
    if not name.startswith("wbmpc."):
        return "#d5d5d5"
    hue = crc32(".".join(name.split(".")[:2]).encode()) % 360
    return f"hsl({hue}, 60%, 75%)"
