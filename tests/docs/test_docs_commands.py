"""What the documents show works: commands are run, files written and scenarios validated, Python executed.

blocks.py says what a block is, program.py what stands in for a program, what is shortened and what is only parsed. The
log of what was done is printed (`pytest tests/docs -rP`).
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import sleep
from typing import Any

import pytest
from blocks import DOCUMENTS, ROOT, Block, Command, blocks_of, taken_for_granted
from ruamel.yaml import YAML
from workspace import Workspace, patched

from wbmpc.scenario import Scenario
from wbmpc.scenario.validate import validate

WARM = Path(__file__).parent / "warm.py"
TESTED = ("sh", "python", "yaml", "diff")
WITH_BLOCKS = [path for path in DOCUMENTS if any(block.language in TESTED for block in blocks_of(path))]
LEAST = {
    "name": "least",
    "duration": 60.0,
    "tasks": [{"kind": "stand"}],
    "checks": [{"kind": "upright_at_end"}],
}


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where warm.py listens, once it does."""
    address = tmp_path_factory.mktemp("warm") / "socket"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, WARM, address], env=environment) as process:
        while not address.exists():
            assert process.poll() is None, "warm.py has ended"
            sleep(0.1)
        yield str(address)
        process.terminate()


@pytest.mark.parametrize("document", WITH_BLOCKS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_the_document_shows_works(document: Path, tmp_path: Path, server: str) -> None:
    blocks = blocks_of(document)
    workspace = Workspace(tmp_path, blocks, server)
    for line in taken_for_granted(blocks):
        expect(workspace, Command(line, "short", None))
    done: set[Command] = set()
    for block in blocks:
        workspace.write(block)
        if block.language == "python" and not block.title:
            (tmp_path / "block.py").write_text(block.text, encoding="utf-8")
            expect(workspace, Command("python block.py", "whole", None))
        for command in block.commands if block.language == "sh" else []:
            if command not in done:
                expect(workspace, command)
                done.add(command)
    print(workspace.log.read_text(encoding="utf-8"))


def expect(workspace: Workspace, command: Command) -> None:
    """Run it; it must end as it says, but that a shortened run does not fail of itself: program.py."""
    result = workspace.run(command)
    allowed = {0, 1} if command.mode == "short" and command.exit_code == 1 else {command.exit_code or 0}
    assert result.returncode in allowed, f"{command.line}: {result.returncode}\n{result.stdout}\n{result.stderr}"
    assert "Traceback" not in result.stderr, result.stderr


def scenarios_of(document: Path) -> dict[str, dict[str, Any]]:
    """The scenarios, and parts of one, that a document shows: what has a key of a scenario besides a name."""
    texts: dict[str, str] = {}
    for place, block in enumerate(block for block in blocks_of(document) if block.language == "yaml"):
        title = block.title or f"block {place}"
        texts[title] = texts.get(title, "") + block.text
    found = {title: YAML(typ="safe", pure=True).load(text) for title, text in texts.items()}
    return {title: data for title, data in found.items() if (set(data) - {"name"}) & set(Scenario.model_fields)}


@pytest.mark.parametrize("document", WITH_BLOCKS, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_scenarios_of_the_document_are_valid(document: Path) -> None:
    changes_the_schema = any(block.title.startswith("wbmpc/") for block in blocks_of(document))
    for title, data in scenarios_of(document).items() if not changes_the_schema else ():  # then a command validates
        scenario, findings = validate(data if "tasks" in data else LEAST | data, source=Path(title))
        assert scenario is not None, f"{title}: {findings}"


def test_the_blocks_of_the_tutorial_are_found() -> None:
    """A file in parts, a mode, an exit code: the tutorial has each."""
    tutorial = ROOT / "docs" / "tutorial.md"
    assert set(scenarios_of(tutorial)["shelf.yaml"]) == {
        *("name", "duration", "world", "patches", "tasks", "checks", "counterfactuals", "sweep")
    }
    commands = [command for block in blocks_of(tutorial) if block.language == "sh" for command in block.commands]
    assert {command.mode for command in commands} == {"short", "whole"}
    assert {command.exit_code for command in commands} == {None, 1, 2}
    assert any("--azimuth" in command.line and "--time" in command.line for command in commands)  # over two lines


@pytest.mark.parametrize(
    "line", ["wbmpc run gone.yaml", "wbmpc validate --gone", "make gone", "gone", "rerun gone.rrd", "python -c 1/0"]
)
def test_a_command_that_does_not_work_is_found(line: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        expect(Workspace(tmp_path, []), Command(line, "short", None))


def test_a_change_that_does_not_fit_is_found() -> None:
    assert patched("a\nb\nc\n", " a\n-b\n+B\n") == "a\nB\nc\n"
    with pytest.raises(AssertionError, match="found 0 times"):
        patched("a\n", "-b\n+c\n")
    with pytest.raises(AssertionError, match="found 2 times"):
        patched("a\na\n", "-a\n+b\n")


def test_recordings_that_nobody_made_are_made_first() -> None:
    lines = (
        "wbmpc plot out/reach.rrd out/other.rrd\nwbmpc run scenarios/walk.yaml\nwbmpc replay out/walk.rrd\n"
        "wbmpc compare old/walk.rrd out/hole.patches_absent.rrd\n"
    )
    assert taken_for_granted([Block("sh", "", lines, "short")]) == [
        "wbmpc run scenarios/reach.yaml --out out",
        "wbmpc run scenarios/walk.yaml --out old",
        "wbmpc run scenarios/hole.yaml --out out --counterfactuals",
    ]
