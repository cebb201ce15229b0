"""docs/ci.md: its workflow is one, and names only commands, options, targets and files that exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

import pytest_wbmpc
from wbmpc.commands.pytest_scenarios import MARKERS, looks_like_scenario

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def workflow() -> dict[str, Any]:
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    read: dict[str, Any] = YAML(typ="safe").load(block)
    return read


@pytest.fixture(scope="module")
def options() -> set[str]:
    parser = pytest.Parser(_ispytest=True)
    pytest_wbmpc.pytest_addoption(parser)
    return {name for group in parser._groups for option in group.options for name in option.names()}


def test_the_workflow_has_what_github_asks_for(workflow: dict[str, Any]) -> None:
    assert set(workflow) == {"name", "on", "jobs"}
    (job,) = workflow["jobs"].values()
    assert {"runs-on", "steps"} <= set(job)
    for step in job["steps"]:
        assert len({"uses", "run"} & set(step)) == 1, step
        if "uses" in step:
            assert re.fullmatch(r"actions/[a-z-]+@v\d+", step["uses"])


def test_its_commands_exist(workflow: dict[str, Any], options: set[str]) -> None:
    (job,) = workflow["jobs"].values()
    lines = [shlex.split(step["run"]) for step in job["steps"] if "run" in step]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    assert {words[1] for words in lines if words[0] == "make"} <= targets
    (run,) = [words for words in lines if words[0] == ".venv/bin/pytest"]
    assert {word for word in run if word.startswith("--wbmpc")} <= options
    uploads = [step["with"]["path"] for step in job["steps"] if "upload-artifact" in step.get("uses", "")]
    assert uploads == [run[run.index("--wbmpc-out") + 1]]
    assert run[run.index("--junitxml") + 1].startswith(f"{uploads[0]}/")
    (cache,) = [step["with"] for step in job["steps"] if "actions/cache@" in step.get("uses", "")]
    for pattern in re.findall(r"'([^']+)'", cache["key"]):
        assert list(ROOT.glob(pattern)), pattern
    assert job["env"]["NUMBA_CACHE_DIR"].rpartition("/")[2] in cache["path"].split()


def test_the_page_has_every_option_and_mark(options: set[str]) -> None:
    assert {f"`{option}" for option in options if f"`{option}" not in PAGE} == set()
    for marker in MARKERS:
        assert f"`{marker.partition(':')[0]}`" in PAGE


def test_a_workflow_is_no_scenario(tmp_path: Path) -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "workflow.yaml"
    path.write_text(block)
    assert not looks_like_scenario(path)
