"""What the README names exists: files, pictures, make targets, commands, options, modules."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer
from PIL import Image
from typer.main import get_command

from wbmpc.checks.registry import CHECKS
from wbmpc.cli import app
from wbmpc.qp import MIQP_BACKENDS, QP_BACKENDS
from wbmpc.scenario import load_scenario

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
README = DOCUMENTS[0].read_text(encoding="utf-8")


def lines_of(document: Path) -> str:
    """Its text, with lines of the shell that go on in one."""
    return document.read_text(encoding="utf-8").replace("\\\n", "")


# A line of a shell block, or inline code, that begins with our command.
COMMANDS = sorted(
    {
        line.split("  #")[0].strip()
        for document in DOCUMENTS
        for line in re.findall(r"(?:^|`)(wbmpc [^`\n]+)", lines_of(document), re.MULTILINE)
    }
)


def fenced(language: str) -> list[str]:
    """The README's code blocks of one language."""
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(document):
    links = re.findall(r"\]\((?!https?://)([^)#]+)\)", document.read_text(encoding="utf-8"))
    missing = [link for link in links if not (document.parent / link).exists()]
    assert not missing


def test_pictures_are_shown_and_small():
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert shown
    for name in shown:
        with Image.open(ROOT / name) as picture:
            picture.verify()
            assert min(picture.size) >= 200
        assert (ROOT / name).stat().st_size < 300_000
        assert f"--out {name}" in README, "the README says how the picture was made"


def test_commands_are_found():
    assert len(COMMANDS) >= 6


@pytest.mark.parametrize("line", COMMANDS)
def test_command_and_its_options_exist(line):
    words = shlex.split(line.split(" > ")[0])[1:]
    group = get_command(app)
    if words[0].startswith("-"):
        owners = [group]
    else:
        names = re.findall(r"\w+", line)[1:] if "|" in line else [words[0]]  # "wbmpc run | validate" names two
        assert set(names) <= set(group.commands)
        owners = [group.commands[name] for name in names]
    options = {option for owner in owners for parameter in owner.params for option in parameter.opts}
    assert [word for word in words if re.match("--?[a-z]", word) and word not in options] == []


@pytest.mark.parametrize("line", [line for block in fenced("sh") for line in block.splitlines() if "wbmpc " in line])
def test_command_line_parses(line):
    """The whole line, values and all, by the command's own parser; nothing runs."""
    words = shlex.split(line.split("  #")[0].split(">")[0])[1:]
    command = get_command(app).commands[words[0]]
    try:
        command.make_context(words[0], words[1:])
    except typer.Exit:
        pytest.fail(f"{line}: the parser ended")


def test_make_targets_exist():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.MULTILINE))
    assert {"run", "test", "bench"} <= named <= targets


def test_scenario_of_the_readme_is_valid(tmp_path):
    (block,) = fenced("yaml")
    path = tmp_path / "my_reach.yaml"
    path.write_text(block, encoding="utf-8")
    assert load_scenario(path).name == "my_reach"


def test_map_is_the_tree():
    (block,) = re.findall(r"```\n(wbmpc/\n.*?)```", README, re.DOTALL)
    mapped = set(re.findall(r"[\w.]+\.(?:py|xml)\b|\w+(?=/)", block))
    package = ROOT / "wbmpc"
    tree = {path.name for folder in (ROOT, package, ROOT / "models") for path in folder.iterdir()}
    inner = {path.name for folder in package.iterdir() if folder.is_dir() for path in folder.iterdir()}
    assert mapped - tree - inner == set()
    shown = {path.name for folder in (package, package / "planner") for path in folder.iterdir()}
    helpers = {"errors.py", "rotations.py", "strict.py", "versions.py", "settings.py"}  # need no word in a map
    assert {name for name in shown if not name.startswith("_")} - helpers - mapped == set()


def test_paths_of_the_table_exist():
    rows = README[README.index("| To add | touch |") : README.index("## Not there yet")]
    paths = re.findall(r"`(wbmpc/[\w./]+)`", rows)
    assert len(paths) >= 6
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_backends_named_are_the_backends():
    section = README[README.index("## QP backends") : README.index("## The map")]
    for name in [*QP_BACKENDS, *MIQP_BACKENDS]:
        assert f"`{name}`" in section, name


def test_checks_are_documented():
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    assert [kind for kind in CHECKS if f"| `{kind}` |" not in text] == []
