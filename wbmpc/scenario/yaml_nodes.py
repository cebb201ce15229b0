"""YAML nodes -> plain data: mappings, lists, and the scalars of YAML 1.2's core schema."""

from __future__ import annotations

from typing import Any

from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from wbmpc.errors import ScenarioError
from wbmpc.scenario.document import Document, Mark
from wbmpc.scenario.wording import KeyPath, describe, dotted_path

MAX_NODES = 20_000  # aliases can make a short text expand without end
MAX_DEPTH = 40
TAG = "tag:yaml.org,2002:"


def build_data(root: Node, document: Document) -> Any:
    """The plain data of a node; the marks of all its parts are written to `document`.

    Raises:
        ScenarioError: a key is not text or comes twice, an alias contains itself, or a tag is not of the core schema.
    """
    return _Builder(document).build(root, (), _mark(root))


def _mark(node: Node) -> Mark:
    return Mark(node.start_mark.line, node.start_mark.column)


class _Builder:
    def __init__(self, document: Document) -> None:
        self._document = document
        self._open: set[int] = set()  # ids of the nodes on the way from the root, to see a node inside itself
        self._count = 0

    def build(self, node: Node, path: KeyPath, use: Mark) -> Any:
        """`use` is where the node is mentioned: for an alias that differs from where it is written."""
        self._count += 1
        if self._count > MAX_NODES:
            raise self._error(use, (), f"more than {MAX_NODES} values, aliases counted as often as they are used")
        if len(path) > MAX_DEPTH:
            raise self._error(use, (), f"nested deeper than {MAX_DEPTH} levels")
        if id(node) in self._open:
            raise self._error(use, path, "recursive reference, the alias contains itself")
        is_absent = isinstance(node, ScalarNode) and node.value == "" and not node.style  # "key:" and nothing behind
        self._document.value_marks[path] = use if is_absent else _mark(node)
        self._open.add(id(node))
        data = self._data(node, path)
        self._open.remove(id(node))
        return data

    def _data(self, node: Node, path: KeyPath) -> Any:
        if isinstance(node, MappingNode) and node.tag == TAG + "map":
            return self._mapping(node, path)
        if isinstance(node, SequenceNode) and node.tag == TAG + "seq":
            return [self.build(item, (*path, index), _mark(item)) for index, item in enumerate(node.value)]
        if not isinstance(node, ScalarNode):
            raise self._error(_mark(node), path, f"unknown tag {str(node.tag).replace(TAG, '!!')}")
        try:
            return _scalar(str(node.tag), node.value)
        except ValueError as error:
            raise self._error(_mark(node), path, str(error)) from None

    def _mapping(self, node: MappingNode, path: KeyPath) -> dict[str, Any]:
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            mark, key = _mark(key_node), key_node.value
            if key_node.tag == TAG + "merge":
                raise self._error(mark, (*path, "<<"), "merge keys are not supported")
            if key_node.tag != TAG + "str":
                raise self._error(
                    mark, path, f"a key must be text, got {key if isinstance(key, str) else describe(key)}"
                )
            inner = (*path, key)
            if key in data:
                first = self._document.key_marks[inner].line + 1
                raise self._error(mark, inner, f"duplicate key, first on line {first}")
            self._document.key_marks[inner] = mark
            data[key] = self.build(value_node, inner, mark)
        return data

    def _error(self, mark: Mark, path: KeyPath, message: str) -> ScenarioError:
        return ScenarioError([self._document.problem_at(mark, f"{dotted_path(path)}: {message}" if path else message)])


def _scalar(tag: str, text: str) -> Any:
    """Raises ValueError with a message for the user."""
    kind = tag.removeprefix(TAG)
    try:
        match kind:
            case "str" | "timestamp" | "value":  # the last two are conveniences of YAML 1.1: plain text here
                return text
            case "null":
                return None
            case "bool":
                return {"true": True, "false": False}[text.lower()]
            case "int":
                return _integer(text.replace("_", ""))
            case "float":
                return _float(text.replace("_", "").lower())
    except (ValueError, KeyError):
        raise ValueError(f"cannot read {describe(text)} as {kind}") from None
    raise ValueError(f"unknown tag {tag.replace(TAG, '!!')}")


def _integer(text: str) -> int:
    digits = text.lstrip("+-").lower()
    base = {"0x": 16, "0o": 8, "0b": 2}.get(digits[:2], 10)
    return int(text, base)


def _float(text: str) -> float:
    special = {".inf": "inf", "+.inf": "inf", "-.inf": "-inf", ".nan": "nan"}
    return float(special.get(text, text))
