"""The JSON Schema of scenario files, for editors, and look-ups in it for messages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.wording import KeyPath


def scenario_json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a scenario file; every key's description states its unit."""
    schema = Scenario.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "wbmpc scenario"}


def keys_allowed_at(path: KeyPath, data: Any) -> list[str]:
    """The keys that the mapping at `path` may have; `data` is the document, which decides unions by their `kind`."""
    return sorted(_node_at(path, data).get("properties", {}))


def items_expected_at(path: KeyPath, data: Any) -> int | None:
    """The length that the list at `path` must have, None when it is free."""
    length = _node_at(path, data).get("minItems")
    return length if isinstance(length, int) and "prefixItems" in _node_at(path, data) else None


def is_union_at(path: KeyPath, data: Any) -> bool:
    """Whether the mapping at `path` is one of several models told apart by `kind`."""
    return "discriminator" in _node_at(path, data, resolve_last=False)


@lru_cache(maxsize=1)
def _schema() -> dict[str, Any]:
    return scenario_json_schema()


def _node_at(path: KeyPath, data: Any, *, resolve_last: bool = True) -> Mapping[str, Any]:
    node: Mapping[str, Any] = _schema()
    for part in path:
        node = _resolve(node, data)
        data = _child(data, part)
        if isinstance(part, int):
            node = node["prefixItems"][part] if part < len(node.get("prefixItems", ())) else node.get("items", {})
        else:
            free = [
                *node.get("patternProperties", {}).values(),
                node.get("additionalProperties"),
            ]  # of a mapping by name
            node = node.get("properties", {}).get(part) or free[0] or {}
    return _resolve(node, data) if resolve_last else node


def _child(data: Any, part: str | int) -> Any:
    try:
        return data[part]
    except (KeyError, IndexError, TypeError):
        return None


def _resolve(node: Any, data: Any) -> Mapping[str, Any]:
    """Follow references, optional values and unions until a plain schema is left."""
    while isinstance(node, Mapping):
        if "$ref" in node:
            node = _schema()["$defs"][node["$ref"].rsplit("/", 1)[-1]]
        elif "discriminator" in node:
            kind = data.get("kind") if isinstance(data, Mapping) else None
            mapping = node["discriminator"]["mapping"]
            node = {"$ref": mapping[kind]} if isinstance(kind, str) and kind in mapping else {}
        elif "anyOf" in node:
            node = next((choice for choice in node["anyOf"] if choice.get("type") != "null"), {})
        else:
            return node
    return {}
