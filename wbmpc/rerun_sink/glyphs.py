"""Only text that the viewer can draw: rerun 0.41 does not show an unknown character as a box, it ends itself."""

from __future__ import annotations

import re
import unicodedata

# Found by trying, in the viewer's proportional and its fixed-width font: Latin, Greek, and the signs of formulas.
_LATIN_AND_GREEK = "\x20-\x7e\xa1-\xac\xae-\u0148\u014a-\u017f\u0391-\u03a1\u03a3-\u03c9"
_PUNCTUATION = "‐‑–—‘’‚“”„†‡•…‰′″‹›"
_SIGNS = "⁰⁴⁵⁶⁷⁸⁹⁺₀₁₂₃₄₅₆₇₈₉←↑→↓≤≥≠≈−·√∞±×∑∂∫∆‖✓"
_UNDRAWABLE = re.compile(f"[^\n{_LATIN_AND_GREEK}{_PUNCTUATION}{_SIGNS}]")


def drawable(text: str) -> str:
    """`text` with "?" for every character that would end the viewer; tabs become spaces."""
    return _UNDRAWABLE.sub("?", unicodedata.normalize("NFC", text).expandtabs(4))
