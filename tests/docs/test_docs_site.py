"""The site's navigation, and the check of a built site: it finds what is wrong. `make docs` builds the real one."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from blocks import ROOT

from docs.tools import build
from docs.tools.check_site import nav_pages, navigation_problems, problems_of

NAVIGATION = 'nav = [{"A" = "index.md"}, {"More" = [{"B" = "more/b.md"}]}]'


def test_every_page_is_in_the_navigation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "STAGED", tmp_path)
    build.stage()
    staged = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.md")]
    pages = [page for page in staged if not page.startswith("source/")]
    config = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))
    assert navigation_problems(list(nav_pages(config["project"]["nav"])), sorted(pages)) == []


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A built site of two pages without a mistake."""
    (tmp_path / "zensical.toml").write_text(f"[project]\n{NAVIGATION}\n", encoding="utf-8")
    for folder in ("pages/more", "pages/source", "site/more"):
        (tmp_path / folder).mkdir(parents=True)
    for page in ("index.md", "more/b.md", "source/listing.md"):
        (tmp_path / "pages" / page).write_text("text", encoding="utf-8")
    index = '<a href="more/b.html#there">b</a> <a href="https://example.org">out</a> <img src="more/a.png">'
    (tmp_path / "site/index.html").write_text(index, encoding="utf-8")
    (tmp_path / "site/more/b.html").write_text('<p id="there"><a href="../index.html">a</a></p>', encoding="utf-8")
    (tmp_path / "site/more/a.png").touch()
    return tmp_path


def found(site: Path) -> list[str]:
    return problems_of(site / "site", site / "zensical.toml", site / "pages")


def test_a_sound_site_has_no_problems(site: Path) -> None:
    assert found(site) == []


@pytest.mark.parametrize(
    ("html", "problem"),
    [
        ('<a href="gone.html">x</a>', "gone.html leads nowhere"),
        ('<a href="more/b.html#gone">x</a>', "more/b.html#gone: no such anchor"),
        ('<a href="#gone">x</a>', "#gone: no such anchor"),
        ('<img src="gone.png">', "gone.png leads nowhere"),
        ('<script src="https://example.org/a.js"></script>', "loads https://example.org/a.js from elsewhere"),
        ('<link rel="stylesheet" href="//example.org/a.css">', "loads //example.org/a.css from elsewhere"),
    ],
)
def test_what_is_broken_is_named(site: Path, html: str, problem: str) -> None:
    (site / "site/index.html").write_text(html, encoding="utf-8")
    assert found(site) == [f"index.html: {problem}"]


def test_a_page_that_nobody_finds_is_named(site: Path) -> None:
    (site / "pages/lost.md").write_text("text", encoding="utf-8")
    (site / "pages/more/b.md").unlink()
    lost, gone = found(site)
    assert lost.startswith("lost.md: not in the navigation")
    assert gone == "zensical.toml: `nav` names more/b.md, which is no page"


def test_links_out_of_the_documents_lead_to_listings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file elsewhere in the repository is shown as a page; a folder or a file that is not there is left alone."""
    for name, text in {"docs/a.md": "[s](../run.yaml#x) [r](../README.md) [g](../gone.py)", "run.yaml": "k: 1"}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "README.md").write_text("[a](docs/a.md)", encoding="utf-8")
    monkeypatch.setattr(build, "ROOT", tmp_path)
    monkeypatch.setattr(build, "DOCS", tmp_path / "docs")
    monkeypatch.setattr(build, "STAGED", tmp_path / "staged")
    monkeypatch.setattr(build, "PAGES_FROM_ELSEWHERE", {"README.md": "readme.md"})
    build.stage()
    assert (tmp_path / "staged/a.md").read_text() == "[s](source/run.yaml.md#x) [r](readme.md) [g](../gone.py)"
    assert (tmp_path / "staged/readme.md").read_text() == "[a](a.md)"
    assert "````yaml\nk: 1\n````" in (tmp_path / "staged/source/run.yaml.md").read_text()
    (tmp_path / "docs/a.md").write_text("no links", encoding="utf-8")
    build.stage()
    assert not (tmp_path / "staged/source/run.yaml.md").exists()
