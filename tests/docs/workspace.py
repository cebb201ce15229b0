"""A folder in which a document's files are written and its commands run, as a reader would have it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from blocks import ROOT, Block, Command

PROGRAM = Path(__file__).parent / "program.py"
COPIED = ("scenarios", "models")  # may be written beside
SOURCES = ("wbmpc", "tests", "pyproject.toml")  # copied when the document changes them
WHOLE_SCENARIO = re.compile(r"^name: *(\w+)", re.MULTILINE)
PROGRAMS = ("wbmpc", "python", "make", "rerun", "pytest")
TIMEOUT = 600  # [s] of one command


class Workspace:
    """The folder of one document.

    Args:
        folder: empty.
        blocks: of the document; when one of them writes to the package, this is a copy of it.
    """

    def __init__(self, folder: Path, blocks: list[Block], server: str = "") -> None:
        """`server`: where warm.py listens; "" for none."""
        self.folder, self.log = folder, folder / "commands.log"
        own = any(block.title.startswith(("wbmpc/", "tests/")) for block in blocks)
        self.package, self._server = (folder, "") if own else (ROOT, server)
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name)
        for name in SOURCES if own else ():
            source = ROOT / name  # times are kept: the machine code of the hot loops stays valid
            shutil.copytree(source, folder / name) if source.is_dir() else shutil.copy2(source, folder / name)
        self.log.touch()
        self._bin = folder / ".venv" / "bin"
        self._bin.mkdir(parents=True)
        for name in PROGRAMS:
            program = self._bin / name
            script = f'#!/bin/sh\nDOCS_TEST_PROGRAM={name} exec "{sys.executable}" "{PROGRAM}" "$@"\n'
            program.write_text(script, encoding="utf-8")
            program.chmod(0o755)

    def write(self, block: Block) -> None:
        """A titled block: its file, or the next part of it; a change to a file; a whole scenario under its name."""
        name = WHOLE_SCENARIO.search(block.text)
        title = block.title or (f"{name[1]}.yaml" if block.language == "yaml" and name else "")
        if not title:
            return
        path = self.folder / title
        path.parent.mkdir(parents=True, exist_ok=True)
        if block.language == "diff":
            path.write_text(patched(path.read_text(encoding="utf-8"), block.text), encoding="utf-8")
        else:
            with path.open("a", encoding="utf-8") as file:
                file.write(block.text)

    def run(self, command: Command) -> subprocess.CompletedProcess[str]:
        """The command by a shell, in the folder."""
        environment = os.environ | {
            "PATH": f"{self._bin}:{os.environ['PATH']}",
            "PYTHONPATH": str(self.package),
            "DOCS_TEST_MODE": command.mode,
            "DOCS_TEST_LOG": str(self.log),
            "DOCS_TEST_ROOT": str(ROOT),
            "DOCS_TEST_SERVER": self._server,
        }
        return subprocess.run(
            ["bash", "-c", command.line],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )


def patched(text: str, change: str) -> str:
    """A text after a change: the lines with a blank or a minus are found once, those with a plus take their place."""
    lines = change.splitlines()
    before = "\n".join(line[1:] for line in lines if line[:1] in (" ", "-"))
    after = "\n".join(line[1:] for line in lines if line[:1] in (" ", "+"))
    assert text.count(before) == 1, f"found {text.count(before)} times:\n{before}"
    return text.replace(before, after)
