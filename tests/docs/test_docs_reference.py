"""docs/reference/ is what schema, checks and command line make it, and has every key and option with an anchor.

When this fails after a change: `make reference`.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from typer.main import get_command

from docs.tools import reference
from docs.tools.schema_tables import allowed, split_unit
from wbmpc.checks.registry import CHECKS
from wbmpc.cli import app
from wbmpc.scenario import Scenario, scenario_json_schema

TEXT = {name: (reference.FOLDER / name).read_text(encoding="utf-8") for name in reference.PAGES}
SCHEMA = scenario_json_schema()
MODELS = {"Scenario": SCHEMA, **{name: node for name, node in SCHEMA["$defs"].items() if "properties" in node}}


@pytest.mark.parametrize("name", reference.PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    assert reference.PAGES[name]() == TEXT[name], "run `make reference`"


@pytest.mark.parametrize("name", ["scenario.md", "checks.md"])
def test_anchors_are_unique_and_links_arrive(name: str) -> None:
    anchors = Counter(re.findall(r'<a id="([^"]*)">', TEXT[name]))
    assert [anchor for anchor, count in anchors.items() if count > 1 or not anchor] == []
    for page, anchor in re.findall(r"\]\((\w+\.md)?#([^)]+)\)", TEXT[name]):
        assert f'<a id="{anchor}">' in TEXT[page or name], anchor


def test_every_key_of_the_schema_is_there() -> None:
    """Each model's keys, in a row of one of the two pages, as often as the schema's models say."""
    rows = Counter(re.findall(r"^\| (?:<a id=\"[^\"]+\"></a>)?`(\w+)` \|", "\n".join(TEXT.values()), re.MULTILINE))
    keys = Counter(key for node in MODELS.values() for key in node["properties"])
    assert {key: count for key, count in keys.items() if rows[key] != count} == {}


def test_every_key_says_what_it_is() -> None:
    """In words, beyond its unit; a key that holds a model may leave it to the model, `kind` to its check."""

    def words(node: dict[str, Any]) -> str:
        inner = SCHEMA["$defs"].get(node.get("$ref", "").rsplit("/", 1)[-1], {})
        return re.sub(r"\[[^\]]*\]", "", node.get("description") or inner.get("description", ""))

    dumb = [
        f"{model}.{key}"
        for model, node in MODELS.items()
        for key, value in node["properties"].items()
        if key != "kind" and not re.search(r"[A-Za-zα]{2}", words(value))
    ]
    assert dumb == []


def settings(value: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Dotted paths of the plain values of an effective scenario, as the page names them."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from settings(inner, (*path, key))
    else:
        yield path


def test_dotted_paths_of_a_scenario_are_anchors() -> None:
    """What `--set` takes is what the page calls a key: every setting of a scenario with nothing but defaults."""
    least = {"name": "a", "duration": 5.0, "tasks": [{"kind": "stand"}], "checks": [{"kind": "com_drop"}]}
    document = Scenario.model_validate_json(json.dumps(least)).to_document()
    paths = {".".join(path) for path in settings(document, ())}
    assert [path for path in sorted(paths) if f'<a id="{path}">' not in TEXT["scenario.md"] + TEXT["checks.md"]] == []
    assert len(paths) > 150


def test_every_check_has_its_section() -> None:
    for kind in CHECKS:
        assert f"### `{kind}`" in TEXT["checks.md"]


def test_every_command_and_option_is_there() -> None:
    for name, command in get_command(app).commands.items():
        section = TEXT["cli.md"].split(f"## wbmpc {name}\n")[1].split("\n## ")[0]
        for parameter in command.params:
            option = max(parameter.opts, key=len) if parameter.opts[0].startswith("-") else parameter.metavar
            assert f"`{option}" in section or option == "--help", (name, option)


@pytest.mark.parametrize(
    ("description", "unit", "words"),
    [
        ("[s] how long", "s", "How long."),
        ("Mass [kg]; null: it is fixed.", "kg", "Mass; null: it is fixed."),
        ("[cost / (m/s³)²] weight of the jerk", "cost / (m/s³)²", "Weight of the jerk."),
        ("Factor on all masses [-].", "1", "Factor on all masses."),
        ("N, knots of the preview", "", "N, knots of the preview."),
        ("Forward, left; at most 0.3 [m/s].", "", "Forward, left; at most 0.3 [m/s]."),
        ("", "", ""),
    ],
)
def test_the_unit_is_told_from_the_words(description: str, unit: str, words: str) -> None:
    assert split_unit(description) == (unit, words)


@pytest.mark.parametrize(
    ("node", "text"),
    [
        ({"exclusiveMinimum": 0, "maximum": 1}, "> 0, ≤ 1"),
        ({"minimum": 0, "exclusiveMaximum": 2**63}, f"≥ 0, < {2**63}"),
        ({"prefixItems": [{"minimum": 0}, {"minimum": 0}]}, "each ≥ 0"),
        ({"prefixItems": [{"minimum": 0}, {"minimum": 1}]}, ""),
        ({}, ""),
    ],
)
def test_ranges_are_those_of_the_schema(node: dict[str, Any], text: str) -> None:
    assert allowed(node) == text
