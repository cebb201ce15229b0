"""A Markdown extension: `$…$`, `$$…$$` and ```math fences become MathML when the site is built.

Browsers draw MathML themselves: no script and no font comes from elsewhere, and a formula is text that can be searched
and read aloud. LaTeX that the converter does not know ends the build.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from markdown import Extension, Markdown
from markdown.treeprocessors import Treeprocessor
from math_core import LatexToMathML

CONVERTER = LatexToMathML()


def mathml(latex: str, *, block: bool) -> str:
    """MathML of a formula. Raises math_core.LatexError at a command or brace that it cannot read."""
    return CONVERTER.convert_with_local_state(latex.strip(), displaystyle=block)


def fence(source: str, language: str, css_class: str, options: Any, md: Markdown, **_: Any) -> str:
    """A ```math fence, for pymdownx.superfences."""
    return f'<div class="formula">{mathml(source, block=True)}</div>'


class Formulas(Treeprocessor):
    """Turns what pymdownx.arithmatex (generic mode) found, `\\(…\\)` in a span or `\\[…\\]` in a div, into MathML."""

    def run(self, root: Element) -> None:
        for node in root.iter():
            if node.get("class") == "arithmatex":
                block, latex = node.tag == "div", "".join(node.itertext()).strip()
                node.text = self.md.htmlStash.store(mathml(latex[2:-2], block=block))
                node.set("class", "formula")


class MathmlExtension(Extension):
    """After the inline patterns have run, before the text is written out."""

    def extendMarkdown(self, md: Markdown) -> None:
        md.treeprocessors.register(Formulas(md), "mathml", 5)


def makeExtension(**options: Any) -> MathmlExtension:
    """What Markdown calls to load the extension."""
    return MathmlExtension(**options)
