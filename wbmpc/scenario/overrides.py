"""Changes to a scenario by dotted path: `--set tasks.0.target.0=0.45`, counterfactuals and sweeps."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any

from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario.wording import KeyPath, describe, dotted_path, items, near_misses
from wbmpc.scenario.yaml_reader import parse_value


class UnknownPath(LookupError):
    """A dotted path leads nowhere; the text says where it ends and what it may have meant."""


def parse_overrides(arguments: Iterable[str]) -> dict[str, Any]:
    """Parse `KEY=VALUE` arguments; values are YAML: `0.45`, `true`, `left`, `null`, `[0.4, 0, 0.3]`.

    Raises:
        ScenarioError: no "=", an empty or repeated key, or a value that is not YAML.
    """
    overrides: dict[str, Any] = {}
    for argument in arguments:
        key, equals, text = argument.partition("=")
        key = key.strip()
        if not equals or not key:
            raise ScenarioError([Problem(f"--set {argument}", "expected KEY=VALUE, such as seed=3")])
        if key in overrides:
            raise ScenarioError([Problem(f"--set {key}", "given twice")])
        try:
            overrides[key] = parse_value(text)
        except ScenarioError as error:
            raise ScenarioError([Problem(f"--set {key}", error.problems[0].message)]) from None
    return overrides


def apply_overrides(document: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of a document with some values replaced, in the order given.

    Paths are dotted, list items by index. All of a path but its last key must exist in the document; use a document
    with its defaults written out (`Scenario.to_document`). Whether the last key and the value are right is left to
    the schema.

    Raises:
        ScenarioError: a path leads nowhere; one problem per path, near misses named.
    """
    changed, problems = copy.deepcopy(dict(document)), []
    for key, value in overrides.items():
        try:
            set_value(changed, key, value)
        except UnknownPath as error:
            problems.append(Problem(f"--set {key}", str(error)))
    if problems:
        raise ScenarioError(problems)
    return changed


def set_value(document: Any, key: str, value: Any) -> None:
    """Replace one value in place.

    Raises:
        UnknownPath: the path leads nowhere.
    """
    path = key_path(document, key)
    parent = document
    for part in path[:-1]:
        if parent[part] is None:
            parent[part] = {}  # an optional block that is off: setting a part of it turns it on
        parent = parent[part]
    parent[path[-1]] = copy.deepcopy(value)


def key_path(document: Any, key: str) -> KeyPath:
    """ "tasks.0.target.0" -> ("tasks", 0, "target", 0); the last key of a mapping may be new.

    Raises:
        UnknownPath: the path leads nowhere.
    """
    path: list[str | int] = []
    parts = key.split(".")
    node = document
    for index, text in enumerate(parts):
        is_last = index == len(parts) - 1
        part = _part(node, text, is_last=is_last, path=tuple(path))
        path.append(part)
        node = node.get(part) if isinstance(node, dict) else node[part]
        if node is None and not is_last:
            node = {}
    return tuple(path)


def _part(node: Any, text: str, *, is_last: bool, path: KeyPath) -> str | int:
    where = f" in {dotted_path(path)}" if path else ""
    if isinstance(node, list):
        if not text.isascii() or not text.isdigit() or int(text) >= len(node):
            raise UnknownPath(f"'{text}' is not an index{where}, which has {items(len(node))}, counted from 0")
        return int(text)
    if not isinstance(node, dict):
        raise UnknownPath(f"{dotted_path(path)} is {describe(node)} and has no part '{text}'")
    if not text:
        raise UnknownPath("empty part in the dotted path")
    if text not in node and not is_last:
        raise UnknownPath(f"unknown key {describe(text)}{where}" + near_misses(text, list(node)))
    return text
