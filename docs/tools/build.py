"""Builds the documentation site: gathers the pages, renders them strictly, checks what came out.

Pages are written for the repository, so their links lead to files anywhere in it. The site holds what they lead to: a
Markdown file as a page, any other file as a listing of its text.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from time import sleep

from docs.tools.check_site import problems_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
STAGED = ROOT / "build" / "docs"  # `docs_dir` of zensical.toml
SITE = ROOT / "site"
PAGES_FROM_ELSEWHERE = {"README.md": "readme.md", "models/README.md": "robot_model.md", "CHANGELOG.md": "changelog.md"}
LANGUAGES = {".py": "python", ".yaml": "yaml", ".xml": "xml", ".toml": "toml"}
ASSETS = {".css", ".js", ".woff", ".txt"}
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s#]+)(#[^)\s]*)?(?=\))")


def main(arguments: list[str]) -> int:
    """Exit code: 0, or 1 when the renderer warns or a link, a page of the navigation or a picture is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--serve", action="store_true", help="serve the pages and render them anew when they change")
    if parser.parse_args(arguments).serve:
        return serve()
    stage()
    shutil.rmtree(SITE, ignore_errors=True)
    if zensical("build", "--strict", "--clean").wait():
        return 1
    problems = problems_of(SITE, ROOT / "zensical.toml", STAGED)
    print("\n".join(problems) or f"{SITE.relative_to(ROOT)}/index.html: complete, opens without a network")
    return 1 if problems else 0


def zensical(*arguments: str) -> subprocess.Popen[bytes]:
    """The renderer in the repository's root, where it finds the Markdown extension beside this file."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
    return subprocess.Popen([Path(sys.executable).parent / "zensical", *arguments], cwd=ROOT, env=environment)


def serve() -> int:
    """Until Ctrl-C: the pages at localhost:8000, gathered again every second."""
    stage()
    server = zensical("serve")
    try:
        while server.poll() is None:
            sleep(1)
            stage()
    except KeyboardInterrupt:
        server.terminate()
    return server.wait()


def stage() -> None:
    """Make `STAGED` the site's source; files that have not changed are left alone."""
    sources = {path: path.relative_to(DOCS).as_posix() for path in sorted(DOCS.rglob("*.md"))}
    sources |= {ROOT / path: page for path, page in PAGES_FROM_ELSEWHERE.items()}
    wanted: dict[str, bytes] = {}

    def place_of(target: Path) -> str | None:
        """Where a file of the repository is in the site; None: nowhere."""
        if target in sources:
            return sources[target]
        if not (target.is_file() and target.is_relative_to(ROOT)):
            return None
        if target.is_relative_to(DOCS):
            place = target.relative_to(DOCS).as_posix()
            wanted[place] = target.read_bytes()
            return place
        inside = target.relative_to(ROOT).as_posix()
        wanted[f"source/{inside}.md"] = listing(inside, target.read_text(encoding="utf-8")).encode()
        return f"source/{inside}.md"

    for source, page in sources.items():
        wanted[page] = relinked(source, page, place_of).encode()
    for asset in [path for path in (DOCS / "tools").glob("*") if path.suffix in ASSETS]:
        wanted[f"tools/{asset.name}"] = asset.read_bytes()
    write(STAGED, wanted)


def relinked(source: Path, page: str, place_of: Callable[[Path], str | None]) -> str:
    """The text of a page with every relative link leading to where its target is in the site."""

    def moved(match: re.Match[str]) -> str:
        place = place_of((source.parent / match[1]).resolve())
        if place is None:
            return match[0]  # the renderer says that it is broken
        return os.path.relpath(place, Path(page).parent).replace(os.sep, "/") + (match[2] or "")

    return LINK.sub(moved, source.read_text(encoding="utf-8"))


def listing(path: str, text: str) -> str:
    """A page that shows a file which is no page."""
    fence = "`" * 4
    language = LANGUAGES.get(Path(path).suffix, "text")
    return f"---\nsearch:\n  exclude: true\n---\n\n# {path}\n\n{fence}{language}\n{text}\n{fence}\n"


def write(folder: Path, wanted: Mapping[str, bytes]) -> None:
    """Make the folder's files those of `wanted`, by path."""
    for path in [path for path in folder.rglob("*") if path.is_file()]:
        if path.relative_to(folder).as_posix() not in wanted:
            path.unlink()
    for place, content in wanted.items():
        path = folder / place
        if not path.is_file() or path.read_bytes() != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
