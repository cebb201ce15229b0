"""Validation errors -> messages in the words of the file: where, what was expected, what was given, near misses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from wbmpc.scenario.json_schema import items_expected_at, keys_allowed_at
from wbmpc.scenario.wording import KeyPath, describe, near_misses

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


@dataclass(frozen=True, slots=True)
class Finding:
    """One mistake in a document, before it is known which file or option it came from."""

    path: KeyPath
    message: str
    at_key: bool = False  # the key itself is wrong, or a key is missing in the block that the path's parent names


def diagnose(error: ValidationError, data: Any) -> list[Finding]:
    """The findings behind a validation error, consequences of another finding left out."""
    details = error.errors(include_url=False)
    located = [(_key_path(detail, data), detail) for detail in details]
    wrong_kinds = {
        path[:-1] for path, detail in located if path[-1:] == ("kind",) and detail["type"] == "literal_error"
    }
    findings: list[Finding] = []
    for path, detail in located:
        if path[:-1] in wrong_kinds and path[-1] != "kind":
            continue
        finding = _finding(path, detail, data)
        if finding.path not in [other.path for other in findings]:
            findings.append(finding)
    mistyped = {
        (*finding.path[:-1], match[1])
        for finding in findings
        if finding.at_key and (match := re.search(r"did you mean '(.+)'\?$", finding.message))
    }
    return [finding for finding in findings if not (finding.path in mistyped and "missing" in finding.message)]


def _key_path(detail: ErrorDetails, data: Any) -> KeyPath:
    """The error's path without the parts that name a union's member rather than a key."""
    path: list[str | int] = []
    parts: Sequence[str | int] = [part for part in detail["loc"] if part != "[key]"]
    for index, part in enumerate(parts):
        is_last = index == len(parts) - 1
        names_a_key = is_last and detail["type"] in ("missing", "extra_forbidden")
        if isinstance(data, dict) and data.get("kind") == part and not names_a_key:
            continue
        path.append(part)
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            data = None
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
        return Finding((*path, "kind"), f"unknown kind '{context['tag']}'" + near_misses(str(context["tag"]), choices))
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", str(context["expected"]))
        return Finding(path, f"expected {context['expected']}, got {describe(given)}" + _hint(given, choices))
    if kind == "finite_number":
        return Finding(path, f"must be a finite number, got {describe(given)}")
    if kind == "string_pattern_mismatch":
        return Finding(path, f"{describe(given)} is not a valid name: {_pattern_in_words(context['pattern'])}")
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
        bound = f"at least {context['min_length']}" if "min_length" in context else f"at most {context['max_length']}"
        return Finding(path, f"must have {bound} item(s), got {count}")
    return Finding(path, f"expected {expected} items, got {count}")


def _hint(given: Any, choices: list[str]) -> str:
    hint = near_misses(given, choices) if isinstance(given, str) else ""
    return hint if hint.startswith(", did") else ""


def _pattern_in_words(pattern: str) -> str:
    dash = ", '_' and '-'" if "-]" in pattern else " and '_'"
    begin = "a letter or digit" if "0-9]" in pattern.split("]")[0] + "]" else "a letter"
    return f"letters, digits{dash} only, at most 64, beginning with {begin}"
