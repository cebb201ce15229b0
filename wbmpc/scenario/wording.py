"""The words of error messages: values as YAML shows them, dotted paths, and near misses."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

KeyPath = tuple[str | int, ...]
"""A path inside a document: ("tasks", 0, "target", 2)."""


def dotted_path(path: KeyPath) -> str:
    """("tasks", 0, "target") -> "tasks.0.target"."""
    return ".".join(str(part) for part in path)


def describe(value: Any) -> str:
    """A value as a message shows it: in YAML's words, short."""
    if value is None or isinstance(value, bool):
        return {None: "nothing (null)", True: "true", False: "false"}[value]
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list | tuple):
        return "a list"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:56]}...{text[-1]}"


def items(count: int) -> str:
    """1 -> "1 item", 3 -> "3 items"."""
    return f"{count} item{'' if count == 1 else 's'}"


def closest(word: str, choices: Iterable[str]) -> str | None:
    """The choice that a mistyped word most likely means, None when none is similar."""
    matches = difflib.get_close_matches(word, sorted(choices), n=1, cutoff=0.6)
    return matches[0] if matches else None


def near_misses(word: str, choices: Iterable[str]) -> str:
    """A hint for a mistyped word: ", did you mean 'friction'?", or the choices, or nothing when there are none."""
    choices = sorted(choices)
    match = closest(word, choices)
    if match:
        return f", did you mean '{match}'?"
    return f", choices: {', '.join(choices)}" if choices else ""
