"""What the documents show as code: their fenced blocks, and the command lines in those of the shell.

A block may have a title, as in ```yaml title="shelf.yaml": its text is that file, and blocks of one title are the
file's parts, one after the other. A comment before a block of the shell says how it is tested, when not as the others:

    <!-- test: whole -->             runs last as long as they say, and exit codes count
    <!-- test: parse, REASON -->     nothing runs; programs, options and make targets must exist
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(
    r"(?:<!-- test: (?P<mode>whole|parse)(?:, (?P<reason>[^>]*))? -->\n+)?"
    r"^(?P<ticks>```+)(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?[^\n]*\n(?P<text>.*?)^(?P=ticks)$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A fenced block of a document."""

    language: str
    title: str  # "" when it has none
    text: str
    mode: str  # short, whole or parse

    @property
    def commands(self) -> list[Command]:
        """The command lines of a block of the shell; a line that ends in a backslash goes on."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [Command.read(line, self.mode) for line in lines if line.strip() and not line.lstrip().startswith("#")]


@dataclass(frozen=True)
class Command:
    """A line of the shell."""

    line: str
    mode: str
    exit_code: int | None  # that its comment names; None: no word about it

    @classmethod
    def read(cls, line: str, mode: str) -> Command:
        """`# exit code 1: ...` behind a command says how it ends."""
        text, _, comment = line.partition("  #")
        named = re.search(r"exit code (\d+)", comment)
        return cls(text.strip(), mode, int(named[1]) if named else None)


def blocks_of(document: Path) -> list[Block]:
    """The blocks of a document, in order."""
    found = FENCE.finditer(document.read_text(encoding="utf-8"))
    return [Block(m["language"], m["title"] or "", m["text"], m["mode"] or "short") for m in found]


def taken_for_granted(blocks: list[Block]) -> list[str]:
    """Commands that make the results of shipped scenarios which are read before any command has made them."""
    made: set[Path] = set()
    needed: list[str] = []
    for words in (command.line.split() for block in blocks if block.language == "sh" for command in block.commands):
        for path in map(Path, words):
            name, _, changed = path.stem.partition(".")
            if path.suffix == ".yaml" and words[1:2] == ["run"]:
                made.add(Path("out") / name)
            elif path.suffix in (".rrd", ".json") and path.parent / path.stem not in made:
                made.add(path.parent / path.stem)
                scenario = ROOT / "scenarios" / f"{name}.yaml"
                if not scenario.exists() or path.is_relative_to("scenarios"):
                    continue
                if not changed:
                    needed.append(f"wbmpc run scenarios/{name}.yaml --out {path.parent}")
                elif f"\n  {changed}:\n" in scenario.read_text(encoding="utf-8"):
                    needed.append(f"wbmpc run scenarios/{name}.yaml --out {path.parent} --counterfactuals")
    return needed
