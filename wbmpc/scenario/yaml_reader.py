"""YAML text -> plain data with positions.

The text is composed to nodes rather than loaded, since nodes know where they stand. YAML 1.2 only: `on`, `yes` and
`1:30` are text, and 1e-3 is a number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario.document import Document, Mark
from wbmpc.scenario.text_file import line_and_column, read_text
from wbmpc.scenario.wording import KeyPath, describe, dotted_path

MAX_NODES = 100_000  # aliases can make a short text expand without end
MAX_DEPTH = 40


def read_document(path: str | Path) -> Document:
    """Read one YAML file.

    Raises:
        ScenarioError: the file is missing, too long, not UTF-8 text, or not a YAML 1.2 mapping.
    """
    name = str(path)
    return parse_document(name, read_text(Path(path), name))


def parse_document(name: str, text: str) -> Document:
    """Parse YAML text whose root must be a mapping; see `read_document`."""
    root = _compose(name, text)
    document = Document(name, text, None)
    if root is None:
        raise ScenarioError([document.problem_at(Mark(0, 0), "the file is empty, expected a mapping of scenario keys")])
    data = _Builder(document).build(root, (), _mark(root))
    if not isinstance(data, dict):
        raise ScenarioError([document.problem((), f"expected a mapping of scenario keys, got {describe(data)}")])
    return Document(name, text, data, document.key_marks, document.value_marks)


def parse_value(text: str) -> Any:
    """One YAML value, as given on a command line: `0.45`, `true`, `left`, `[0.4, 0, 0.3]`.

    Raises:
        ScenarioError: the text is not one YAML value; the problem's place is empty.
    """
    try:
        root = _compose("", text)
        document = Document("", text, None)
        return None if root is None else _Builder(document).build(root, (), _mark(root))
    except ScenarioError as error:
        raise ScenarioError([Problem("", error.problems[0].message)]) from None


def _compose(name: str, text: str) -> Node | None:
    yaml = YAML(typ="safe", pure=True)
    document = Document(name, text, None)
    try:
        root: Node | None = yaml.compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = Mark(mark.line, mark.column) if mark else Mark(0, 0)
        raise ScenarioError([document.problem_at(where, f"not valid YAML: {error.problem or error.context}")]) from None
    except ReaderError as error:
        place = line_and_column(text, error.position)
        raise ScenarioError([Problem(f"{name}:{place}", f"character not allowed: #x{error.character:04x}")]) from None
    except RecursionError:
        raise ScenarioError([document.problem_at(Mark(0, 0), "nested too deeply")]) from None
    except (YAMLError, ValueError, NotImplementedError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ScenarioError([document.problem_at(Mark(0, 0), f"not valid YAML: {reason}")]) from None
    if yaml.resolver.processing_version not in (None, (1, 2)):
        raise ScenarioError([document.problem_at(Mark(0, 0), "YAML 1.2 only, remove the %YAML directive")])
    return root


def _mark(node: Node) -> Mark:
    return Mark(node.start_mark.line, node.start_mark.column)


class _Builder:
    """Nodes -> plain data, noting the marks in the document on the way."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._open: set[int] = set()  # ids of the nodes on the way from the root, to see a node inside itself
        self._count = 0

    def build(self, node: Node, path: KeyPath, use: Mark) -> Any:
        """`use` is where the node is mentioned: for an alias that differs from where it is written."""
        self._count += 1
        if self._count > MAX_NODES:
            raise self._error(use, f"aliases expand to more than {MAX_NODES} values")
        if len(path) > MAX_DEPTH:
            raise self._error(use, f"nested deeper than {MAX_DEPTH} levels")
        if isinstance(node, ScalarNode):
            self._document.value_marks[path] = use if node.value == "" and not node.style else _mark(node)
            return self._scalar(node)
        if id(node) in self._open:
            raise self._error(use, f"{dotted_path(path)}: recursive reference, the alias contains itself")
        self._document.value_marks[path] = _mark(node)
        self._open.add(id(node))
        data = self._mapping(node, path) if isinstance(node, MappingNode) else self._sequence(node, path)
        self._open.remove(id(node))
        return data

    def _sequence(self, node: Node, path: KeyPath) -> list[Any]:
        assert isinstance(node, SequenceNode)
        self._check_tag(node, "seq")
        return [self.build(item, (*path, index), _mark(item)) for index, item in enumerate(node.value)]

    def _mapping(self, node: MappingNode, path: KeyPath) -> dict[str, Any]:
        self._check_tag(node, "map")
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = key_node.value
            if key_node.tag == "tag:yaml.org,2002:merge":
                raise self._error(_mark(key_node), f"{dotted_path((*path, '<<'))}: merge keys are not supported")
            if not isinstance(key_node, ScalarNode) or key_node.tag != "tag:yaml.org,2002:str":
                shown = describe(self._scalar(key_node)) if isinstance(key_node, ScalarNode) else "a list or mapping"
                raise self._error(_mark(key_node), f"{dotted_path(path) or 'root'}: a key must be text, got {shown}")
            inner = (*path, key)
            if key in data:
                first = self._document.key_marks[inner].line + 1
                raise self._error(_mark(key_node), f"{dotted_path(inner)}: duplicate key, first on line {first}")
            self._document.key_marks[inner] = _mark(key_node)
            data[key] = self.build(value_node, inner, _mark(key_node))
        return data

    def _scalar(self, node: ScalarNode) -> Any:
        kind, text = str(node.tag).removeprefix("tag:yaml.org,2002:"), node.value
        if kind in ("str", "timestamp", "value"):  # the last two are YAML 1.1 conveniences: plain text here
            return text
        try:
            if kind == "null":
                return None
            if kind == "bool":
                return {"true": True, "false": False}[text.lower()]
            if kind == "int":
                return _integer(text.replace("_", ""))
            if kind == "float":
                return _float(text.replace("_", "").lower())
        except (ValueError, KeyError):
            raise self._error(_mark(node), f"cannot read {describe(text)} as {kind}") from None
        raise self._error(_mark(node), f"unknown tag {node.tag}")

    def _check_tag(self, node: Node, expected: str) -> None:
        if node.tag != f"tag:yaml.org,2002:{expected}":
            raise self._error(_mark(node), f"unknown tag {node.tag}")

    def _error(self, mark: Mark, message: str) -> ScenarioError:
        return ScenarioError([self._document.problem_at(mark, message)])


def _integer(text: str) -> int:
    digits = text.lstrip("+-").lower()
    base = {"0x": 16, "0o": 8, "0b": 2}.get(digits[:2], 10)
    return int(text, base)


def _float(text: str) -> float:
    special = {".inf": "inf", "+.inf": "inf", "-.inf": "-inf", ".nan": "nan"}
    return float(special.get(text, text))
