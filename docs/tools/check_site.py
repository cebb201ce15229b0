"""What must hold of the built site: pages are in the navigation, links arrive, nothing is loaded from elsewhere."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

LOADED = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src", "video": "src"}
UNLOADED_RELATIONS = {"canonical", "next", "prev", "alternate"}  # a <link> that says something and fetches nothing


class Page(HTMLParser):
    """The anchors of an HTML page, what it links to and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[key] for key in ("id", "name") if key in values}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        if values.get(LOADED.get(tag, "")) and not UNLOADED_RELATIONS & set(values.get("rel", "").split()):
            self.loads.append(values[LOADED[tag]])


def problems_of(site: Path, config: Path, pages: Path) -> list[str]:
    """One line for each thing that is wrong with a built site.

    Args:
        site: the folder of the HTML files.
        config: zensical.toml, whose `nav` must name every page.
        pages: the folder of the Markdown files; those under source/ are listings and need no place in the navigation.
    """
    there = [path.relative_to(pages).as_posix() for path in sorted(pages.rglob("*.md"))]
    navigation = list(nav_pages(tomllib.loads(config.read_text(encoding="utf-8"))["project"]["nav"]))
    problems = navigation_problems(navigation, [page for page in there if not page.startswith("source/")])
    built = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    for path, page in built.items():
        place = path.relative_to(site).as_posix()
        if place == "404.html":
            continue  # its links are absolute: it is shown at any address
        outside = [load for load in page.loads if urlsplit(load).scheme not in ("", "data") or load.startswith("//")]
        problems += [f"{place}: loads {load} from elsewhere" for load in outside]
        for link in [*page.links, *(load for load in page.loads if load not in outside)]:
            problem = link_problem(link, path, built)
            if problem:
                problems.append(f"{place}: {problem}")
    return problems


def nav_pages(entry: Any) -> Iterator[str]:
    """The pages that a navigation names, in order."""
    if isinstance(entry, str):
        yield entry
    else:
        for inner in entry.values() if isinstance(entry, dict) else entry:
            yield from nav_pages(inner)


def navigation_problems(navigation: list[str], pages: list[str]) -> list[str]:
    """Pages that the navigation lacks, names twice or invents."""
    lacking = [
        f"{page}: not in the navigation, put it into `nav` of zensical.toml" for page in pages if page not in navigation
    ]
    invented = [f"zensical.toml: `nav` names {page}, which is no page" for page in navigation if page not in pages]
    twice = [f"zensical.toml: `nav` names {page} twice" for page in set(navigation) if navigation.count(page) > 1]
    return [*lacking, *invented, *sorted(twice)]


def link_problem(link: str, path: Path, built: dict[Path, Page]) -> str:
    """Why a link of the page at `path` does not arrive; "" when it does, or leads out of the site."""
    parts = urlsplit(link)
    if parts.scheme or link.startswith("//"):
        return ""
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if target.is_dir():
        target /= "index.html"
    if not target.is_file():
        return f"{link} leads nowhere"
    fragment = unquote(parts.fragment)
    if fragment and not fragment.startswith("__") and target in built and fragment not in built[target].anchors:
        return f"{link}: no such anchor"
    return ""
