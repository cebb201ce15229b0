"""Writes docs/reference/: scenario files and checks from the schema, the command line from its own definition.

`make reference` calls it; a test holds the pages to it.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import typer
from typer.main import get_command

from docs.tools.schema_tables import Schema, Section
from wbmpc.checks.registry import CHECKS
from wbmpc.checks.settings import UniversalSettings
from wbmpc.cli import app
from wbmpc.commands.exits import ExitCode
from wbmpc.scenario import scenario_json_schema

FOLDER = Path(__file__).parents[1] / "reference"
MADE = "<!-- made by `make reference`: do not edit -->\n"

SCENARIO = """\
# Scenario files

Every key that a scenario file may have, from the JSON Schema that `wbmpc schema` prints. A key that is not here is an
error, and so is text for a number: `wbmpc validate` says where, and what was meant.

Headings are dotted paths, which `--set`, counterfactuals and sweeps take. Items of a list have their index there and
their kind here: the x of a reach's target, `tasks.reach.target` below, is `tasks.0.target.0`. NAME is a name that you
choose. Units are SI; a key without one is a number, a ratio or no number at all.
"""
CHECKS_PAGE = """\
# Checks

What a run is judged by. The first eight are on in every scenario, under `universal:`, and none can be switched off;
the others are listed under `checks:`. Each entry says what the check asks for, then which number it compares, then its
keys. What the results mean: [results.md](../results.md); how to write one: [a check](../extend/check.md).
"""
CLI = """\
# Command line

Every command with its options, as `wbmpc COMMAND --help` prints them. Exit codes are the same for all of them:
"""


def scenario_schema() -> Schema:
    """The schema of scenario files; the models of checks belong to the checks' own page."""
    root = scenario_json_schema()
    # The title of a model is its class name.
    elsewhere = {root["$defs"][_model(kind)]["title"]: f"checks.md#{kind}" for kind in CHECKS}
    return Schema(root, elsewhere | {"UniversalSettings": "checks.md#universal"})


def _model(kind: str) -> str:
    """Name of the settings model of a check."""
    name = inspect.signature(CHECKS[kind]).parameters["config"].annotation
    return str(getattr(name, "__name__", name)).rsplit(".", 1)[-1]


def scenario_page() -> str:
    """docs/reference/scenario.md."""
    schema = scenario_schema()
    sections = list(schema.sections((), "The file", schema.root))
    return (
        "\n\n".join([MADE + SCENARIO.rstrip(), *(schema.markdown(s, 2 if len(s.path) < 2 else 3) for s in sections)])
        + "\n"
    )


def checks_page() -> str:
    """docs/reference/checks.md."""
    schema = scenario_schema()
    models = schema.root["$defs"]
    universal = Section(("universal",), "On in every scenario", models["UniversalSettings"])
    parts = [MADE + CHECKS_PAGE.rstrip(), schema.markdown(universal, 2)]
    parts += [_check(schema, kind, ("universal", kind)) for kind in UniversalSettings.model_fields]
    parts.append("## Listed by a scenario")
    parts += [_check(schema, kind, ("checks", kind)) for kind in CHECKS if kind not in UniversalSettings.model_fields]
    return "\n\n".join(parts) + "\n"


def _check(schema: Schema, kind: str, path: tuple[str, ...]) -> str:
    section = Section(path, f"`{kind}`", schema.root["$defs"][_model(kind)])
    compared = f"*Compared:* {inspect.cleandoc(CHECKS[kind].__doc__)}"
    return schema.markdown(section, 3, anchor=kind, more=compared)


def cli_page() -> str:
    """docs/reference/cli.md."""
    group = get_command(app)
    codes = [f"| {code.value} | {code.name.lower().replace('_', ' ')} |" for code in ExitCode]
    parts = [MADE + CLI.rstrip(), "| exit code | |\n|---|---|\n" + "\n".join(codes)]
    parts.append("## wbmpc\n\n" + options_of(group, typer.Context(group, info_name="wbmpc")))
    for name, command in group.commands.items():
        with typer.Context(command, info_name=f"wbmpc {name}") as context:
            usage = " ".join(["wbmpc", name, *command.collect_usage_pieces(context)])
            parts.append(
                f"## wbmpc {name}\n\n{command.help}\n\n```text\n{usage}\n```\n\n{options_of(command, context)}"
            )
    return "\n\n".join(parts) + "\n"


def options_of(command: Any, context: typer.Context) -> str:
    """The table of a command's arguments and options."""
    rows = ["| option | meaning |", "|---|---|"]
    for parameter in command.get_params(context):
        names, words = parameter.get_help_record(context) or ("", "")
        cells = [" ".join(text.split()).replace("|", "\\|") for text in (names, words)]
        if cells[0] != "--help":
            rows.append(f"| `{cells[0]}` | {cells[1].replace('[', chr(92) + '[')} |")  # a bracket begins no link
    return "\n".join(rows)


PAGES = {"scenario.md": scenario_page, "checks.md": checks_page, "cli.md": cli_page}


def main() -> None:
    """Write the pages."""
    FOLDER.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
