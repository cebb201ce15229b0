"""The JSON Schema of scenario files as Markdown: one section a model, one row a key, an anchor each."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Node = Mapping[str, Any]
UNIT = re.compile(r"^\[([^\]]+)\]\s*|(?<!\d)\s\[([^\]]+)\](?=[.,;]|$)")
WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "null": "null"}
HEAD = "| key | meaning | value | unit | default |\n|---|---|---|---|---|"


@dataclass(frozen=True)
class Section:
    """One model of the schema where a scenario file has it."""

    path: tuple[str, ...]  # dotted path, with NAME for a free name and the kind for an item of a list
    title: str
    node: Node


class Schema:
    """A JSON Schema (draft 2020-12) as pydantic writes it.

    Args:
        root: the schema.
        elsewhere: names of models that another page describes.
    """

    def __init__(self, root: Node, elsewhere: Mapping[str, str]) -> None:
        self.root = root
        self.elsewhere = elsewhere

    def resolved(self, node: Node) -> Node:
        """The model or type that a node stands for: references followed, `null` of an optional one left out."""
        if "$ref" in node:
            return self.resolved(self.root["$defs"][node["$ref"].rsplit("/", 1)[-1]])
        choices = [choice for choice in node.get("anyOf", ()) if choice.get("type") != "null"]
        return self.resolved(choices[0]) if len(choices) == 1 else node

    def sections(self, path: tuple[str, ...], title: str, node: Node) -> Iterator[Section]:
        """The section of a model, then those of the models inside, in the order of their keys."""
        yield Section(path, title, node)
        for key, inner in node["properties"].items():
            for tail, child in self._models_of(self.resolved(inner)):
                if child.get("title") not in self.elsewhere:
                    inside = (*path, key, *tail)
                    yield from self.sections(inside, f"`{'.'.join(inside)}`", child)

    def _models_of(self, node: Node) -> Iterator[tuple[tuple[str, ...], Node]]:
        """The models that a value holds, and where below it."""
        if "properties" in node:
            yield (), node
        for inner in node.get("patternProperties", {}).values():
            yield from ((("NAME", *tail), model) for tail, model in self._models_of(self.resolved(inner)))
        items = node.get("items", {})
        if "discriminator" in items:
            for kind, reference in items["discriminator"]["mapping"].items():
                yield (kind,), self.resolved({"$ref": reference})
        elif items:
            name = self.resolved(items).get("properties", {}).get("kind", {}).get("const", "N")
            yield from (((name, *tail), model) for tail, model in self._models_of(self.resolved(items)))

    def described(self, node: Node) -> str:
        """What a key says of itself, or else the model that it holds."""
        return node.get("description") or self.resolved(node).get("description", "")

    def markdown(self, section: Section, level: int, *, anchor: str | None = None, more: str = "") -> str:
        """A section: anchor (its path, if none is given), heading, the model's own words, more of them, its keys."""
        rows = [self._row(section, key, node) for key, node in section.node["properties"].items()]
        words = section.node.get("description", "")
        anchor = ".".join(section.path) if anchor is None else anchor
        mark = f'<a id="{anchor}"></a>' if anchor else ""
        parts = [mark, f"{'#' * level} {section.title}", words, more, "\n".join([HEAD, *rows])]
        return "\n\n".join(part for part in parts if part)

    def _row(self, section: Section, key: str, node: Node) -> str:
        anchor = ".".join((*section.path, key))
        default = self._default(node) if key not in section.node.get("required", ()) else "**needed**"
        unit, meaning = split_unit(self.described(node) or ("Which one it is." if key == "kind" else ""))
        mark = "" if self._has_section(node) else f'<a id="{anchor}"></a>'  # the section has the anchor
        value = ", ".join(text for text in (self._type(node, anchor), allowed(self.resolved(node))) if text)
        cells = (meaning, value, unit, default)
        return f"| {mark}`{key}` | " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    def _has_section(self, node: Node) -> bool:
        inner = self.resolved(node)
        return "properties" in inner and inner.get("title") not in self.elsewhere

    def _default(self, node: Node) -> str:
        if "properties" in self.resolved(node) and node.get("default") is not None:
            return "as below"
        return f"`{json.dumps(node['default'], ensure_ascii=False)}`" if "default" in node else "as below"

    def _type(self, node: Node, anchor: str) -> str:
        """In words; a model is a link to its section."""
        optional = any(choice.get("type") == "null" for choice in node.get("anyOf", ()))
        inner = self.resolved(node)
        page = self.elsewhere.get(inner.get("title", ""))
        words = f"[mapping]({page})" if page else self._plain_type(inner, anchor)
        return f"{words}, or null" if optional else words

    def _plain_type(self, node: Node, anchor: str) -> str:
        if "const" in node:
            return f"`{node['const']}`"
        if "enum" in node:
            return "one of " + ", ".join(f"`{value}`" for value in node["enum"])
        if "properties" in node:
            return f"[mapping](#{anchor})"
        if node.get("type") == "object":
            free = [*node.get("patternProperties", {}).values(), *[node.get("additionalProperties") or {}]]
            inside = self.resolved(free[0]) if free else {}
            value = f"[mapping](#{anchor}.NAME)" if "properties" in inside else self._plain_type(inside, anchor)
            return f"{value} by name"
        if node.get("type") == "array":
            return self._list_type(node, anchor)
        return WORDS.get(node.get("type", ""), "any value")

    def _list_type(self, node: Node, anchor: str) -> str:
        if "prefixItems" in node:
            return (
                f"list of {len(node['prefixItems'])} {self._plain_type(self.resolved(node['prefixItems'][0]), anchor)}s"
            )
        items = self.resolved(node["items"])
        if "discriminator" in items:
            kinds = items["discriminator"]["mapping"].items()
            pages = {kind: self.elsewhere.get(self.resolved({"$ref": ref})["title"]) for kind, ref in kinds}
            return "list of " + ", ".join(f"[{kind}]({page or f'#{anchor}.{kind}'})" for kind, page in pages.items())
        models = list(self._models_of(node))
        return (
            f"list of [mappings](#{'.'.join((anchor, *models[0][0]))})"
            if models
            else "list of " + self._plain_type(items, anchor)
        )


def split_unit(description: str) -> tuple[str, str]:
    """The unit in brackets of a description, "" when it has none, and the rest as a sentence."""
    found = UNIT.search(description)
    unit = (found[1] or found[2]) if found else ""
    words = (UNIT.sub("", description, count=1) if found else description).strip().replace("\n", " ")
    sentence = words[:1].upper() + words[1:] if not words.startswith(("d of", "e_", "α")) else words
    return {"-": "1"}.get(unit, unit), sentence.rstrip(".") + "." if sentence else ""


def allowed(node: Node) -> str:
    """Which values a type takes, beyond the type itself."""
    if "prefixItems" in node:
        ranges = {allowed(item) for item in node["prefixItems"]}
        return f"each {ranges.pop()}" if len(ranges) == 1 and ranges != {""} else ""
    least, most = node.get("minimum"), node.get("maximum")
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    bounds = [
        f"{sign} {value}" for sign, value in zip("≥>≤<", (least, above, most, below), strict=True) if value is not None
    ]
    if node.get("pattern"):
        bounds.append(f"`{node['pattern']}`")
    if node.get("minLength") or node.get("minItems"):
        bounds.append("not empty")
    return ", ".join(bounds)
