"""Validation errors -> messages in the words of the file: where, what was expected, what was given, near misses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from wbmpc.scenario.json_schema import is_union_at, items_expected_at, keys_allowed_at
from wbmpc.scenario.wording import KeyPath, closest, describe, items, near_misses

EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
}
BOUNDS = {"greater_than": ("gt", ">"), "greater_than_equal": ("ge", "≥"), "less_than": ("lt", "<")} | {
    "less_than_equal": ("le", "≤")
}

MAX_FINDINGS = 100  # nobody mends more in one go


@dataclass(frozen=True, slots=True)
class Finding:
    """One mistake in a document, before it is known which file or option it came from."""

    path: KeyPath
    message: str
    at_key: bool = False  # the key itself is wrong, or a key is missing in the block that the path's parent names


def diagnose(error: ValidationError, data: Any) -> list[Finding]:
    """The findings behind a validation error, consequences of another finding left out."""
    details = error.errors(include_url=False)[:MAX_FINDINGS]
    located = [(_key_path(detail, data), detail) for detail in details]
    findings: dict[KeyPath, Finding] = {}
    for path, detail in located:
        if not _is_consequence(path, detail, located, data):
            finding = _finding(path, detail, data)
            findings.setdefault(finding.path, finding)
    return list(findings.values())


def _is_consequence(
    path: KeyPath, detail: ErrorDetails, located: list[tuple[KeyPath, ErrorDetails]], data: Any
) -> bool:
    """Whether another error explains this one: one mistake, one message."""
    for other_path, other in located:
        block, key = other_path[:-1], other_path[-1:]
        if other is detail:
            continue
        if key == ("kind",) and other["type"] == "literal_error" and path[: len(block)] == block:
            return True  # the kind is wrong, so that every other key of the block is judged by the wrong schema
        if detail["type"] == "too_short" and len(other_path) > len(path) and other_path[: len(path)] == path:
            return True  # pydantic counts valid items only
        is_mistyped = detail["type"] == "missing" and other["type"] == "extra_forbidden" and path[:-1] == block
        if is_mistyped and closest(str(key[0]), keys_allowed_at(block, data)) == path[-1]:
            return True
    return False


def _key_path(detail: ErrorDetails, data: Any) -> KeyPath:
    """The error's path without the parts that name a union's member rather than a key."""
    path: list[str | int] = []
    parts: Sequence[str | int] = [part for part in detail["loc"] if part != "[key]"]
    was_member = False
    for part in parts:
        # A key may have the same name as its block's kind: after the member's name comes a key, whatever its name.
        was_member = not was_member and is_union_at(tuple(path), data)
        if not was_member:
            path.append(part)
    return tuple(path)


def _finding(path: KeyPath, detail: ErrorDetails, data: Any) -> Finding:
    kind, given, context = detail["type"], detail.get("input"), detail.get("ctx", {})
    if kind == "extra_forbidden":
        return Finding(path, "unknown key" + near_misses(str(path[-1]), keys_allowed_at(path[:-1], data)), at_key=True)
    if kind == "missing" and isinstance(path[-1], str):
        return Finding(path, "required key is missing", at_key=True)
    if kind in ("missing", "too_long", "too_short"):
        return _wrong_length(path[:-1] if kind == "missing" else path, detail, data)
    if kind == "union_tag_not_found":
        return Finding((*path, "kind"), "required key is missing", at_key=True)
    if kind == "union_tag_invalid":
        choices = re.findall(r"'([^']*)'", str(context["expected_tags"]))
        return Finding(
            (*path, "kind"), f"unknown kind {describe(context['tag'])}" + near_misses(str(context["tag"]), choices)
        )
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", str(context["expected"]))
        return Finding(path, f"expected {context['expected']}, got {describe(given)}" + _hint(given, choices))
    if kind == "finite_number":
        return Finding(path, f"must be a finite number, got {describe(given)}")
    if kind == "string_pattern_mismatch":
        message = f"{describe(given)} is not a valid name: {_pattern_in_words(context['pattern'])}"
        return Finding(path, message, at_key=detail["loc"][-1] == "[key]")
    if kind == "string_too_short":
        return Finding(path, "must not be empty")
    if kind in EXPECTED:
        return Finding(path, f"expected {EXPECTED[kind]}, got {describe(given)}")
    if kind in BOUNDS:
        name, symbol = BOUNDS[kind]
        return Finding(path, f"must be {symbol} {context[name]:g}, got {describe(given)}")
    if kind == "value_error":
        return Finding(path, str(context["error"]))
    return Finding(path, detail["msg"])


def _wrong_length(path: KeyPath, detail: ErrorDetails, data: Any) -> Finding:
    given = detail["input"]
    count = len(given) if isinstance(given, list | dict) else detail.get("ctx", {}).get("actual_length")
    expected = items_expected_at(path, data)
    if expected is None:
        context = detail.get("ctx", {})
        least = "min_length" in context
        bound = f"at least {items(context['min_length'])}" if least else f"at most {items(context['max_length'])}"
        return Finding(path, f"must have {bound}, got {count}")
    return Finding(path, f"expected {items(expected)}, got {count}")


def _hint(given: Any, choices: list[str]) -> str:
    hint = near_misses(given, choices) if isinstance(given, str) else ""
    return hint if hint.startswith(", did") else ""


def _pattern_in_words(pattern: str) -> str:
    dash = ", '_' and '-'" if "-]" in pattern else " and '_'"
    begin = "a letter or digit" if "0-9]" in pattern.split("]")[0] + "]" else "a letter"
    return f"letters, digits{dash} only, at most 64, beginning with {begin}"
