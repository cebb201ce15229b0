"""YAML text -> plain data with positions.

The text is composed to nodes rather than loaded, since nodes know where they stand. YAML 1.2 only: `on`, `yes` and
`1:30` are text, and 1e-3 is a number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import Node
from ruamel.yaml.reader import ReaderError

from wbmpc.errors import Problem, ScenarioError
from wbmpc.scenario.document import Document, Mark
from wbmpc.scenario.text_file import line_and_column, read_text
from wbmpc.scenario.wording import describe
from wbmpc.scenario.yaml_nodes import build_data


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
    data = build_data(root, document)
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
        return None if root is None else build_data(root, document)
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
        raise ScenarioError(
            [
                document.problem_at(
                    where, f"not valid YAML: {(error.problem or error.context or '').removeprefix('but ')}"
                )
            ]
        ) from None
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
