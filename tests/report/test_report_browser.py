"""The page in a real browser: its script runs, it fits a phone and paper, loads nothing and complains of nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Tab, a_tab
from report_case import check, write
from test_report_page import report

ROWS = "[...document.querySelectorAll('.overview tbody tr')]"
SHOWN = f"{ROWS}.filter((row) => row.checkVisibility()).map((row) => row.cells[0].innerText.trim())"
LONG = "what was found is told at some length, with_a_name_that_cannot_be_broken_anywhere, at t = 1.25 s"
# Elements whose right edge is beyond that of the window and that no scrolling box around them holds.
BEYOND = """[...document.querySelectorAll("main *")].filter((e) => e.checkVisibility() && !e.closest("svg, .hidden")
    && e.getBoundingClientRect().right > document.documentElement.clientWidth + 1
    && !(e.closest(".scroll") && getComputedStyle(e.closest(".scroll")).overflowX === "auto"))
    .map((e) => e.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs, one of which failed."""
    folder = tmp_path_factory.mktemp("page")
    for name, peak, passed in (("middle", 0.5, True), ("high", 0.9, False), ("low", 0.1, True)):
        metrics = {"simulated_time": 2.0, "torque_peak_fraction": peak}
        write(folder, name, checks=[check(f"reach_{name}", passed=passed, message=LONG)], metrics=metrics)
    assert report(folder).exit_code == 0
    return folder / "report.html"


@pytest.fixture(scope="module")
def tab() -> Iterator[Tab]:
    with a_tab() as found:
        yield found


def test_it_loads_nothing_and_complains_of_nothing(tab: Tab, page: Path) -> None:
    tab.open(page, width=1400)
    assert [url for url in tab.requests if not url.startswith("data:")] == [page.resolve().as_uri()]
    assert tab.complaints == []
    tab.run("fetch('https://example.org/').catch(() => null)")
    assert any("Content Security Policy" in text for text in tab.complaints), "its policy forbids what is not in it"


def test_a_column_sorts_up_down_and_back(tab: Tab, page: Path) -> None:
    tab.open(page, width=1400)
    as_it_was = tab.run(SHOWN)
    press = "document.querySelectorAll('.overview thead button')[6].click()"  # torque peak
    orders = [tab.run(f"{press}, {SHOWN}") for _ in range(3)]
    assert orders == [["low", "middle", "high"], ["high", "middle", "low"], as_it_was]


def test_runs_are_filtered_by_words_and_by_result(tab: Tab, page: Path) -> None:
    tab.open(page, width=1400)
    words = "(words.value = '{}', words.dispatchEvent(new Event('input')), " + SHOWN + ")"
    assert tab.run(words.format("reach_high")) == ["high"]
    assert tab.run(words.format("nothing like it")) == []
    assert tab.run("document.querySelector('.empty').checkVisibility()")
    assert len(tab.run(words.format(""))) == 3
    assert tab.run(f"document.querySelector('[data-state=failed]').click(), {SHOWN}") == ["high"]


def test_a_link_of_the_overview_opens_its_run(tab: Tab, page: Path) -> None:
    tab.open(page, width=1400)
    opened = "[...document.querySelectorAll('details.run')].map((run) => run.open)"
    before = tab.run(opened)
    assert before == [True, False, False]
    assert tab.run(f"document.querySelectorAll('.overview a')[2].click(), {opened}") == [True, False, True]


@pytest.mark.parametrize("width", [400, 800, 1400])
def test_nothing_is_beyond_the_edge(tab: Tab, page: Path, width: int) -> None:
    tab.open(page, width=width)
    assert tab.run("document.querySelectorAll('details').forEach((d) => (d.open = true))") is None
    assert tab.run(BEYOND) == []
    assert tab.run("document.documentElement.scrollWidth") <= width


def test_on_a_phone_what_was_found_needs_no_scrolling(tab: Tab, page: Path) -> None:
    tab.open(page, width=400)
    edges = "[...document.querySelectorAll('{}')].map((e) => e.getBoundingClientRect().right)"
    for part in (".run[open] td.message", ".overview .ending"):
        found = tab.run(edges.format(part))
        assert found
        assert max(found) <= 400


def test_on_paper_tables_are_whole_and_every_run_is_there(tab: Tab, page: Path) -> None:
    tab.open(page, width=718)  # A4 less its margins
    tab.run(f"{ROWS}[0].hidden = true")  # as a filter does
    tab.call("Emulation.setEmulatedMedia", media="print")
    try:
        tab.run("dispatchEvent(new Event('beforeprint'))")
        assert tab.run(BEYOND) == []
        assert len(tab.run(SHOWN)) == 3
        assert tab.run("[...document.querySelectorAll('.checks td.message')].every((e) => e.checkVisibility())")
    finally:
        tab.call("Emulation.setEmulatedMedia", media="")


def test_it_is_light_or_dark_as_the_browser_is(tab: Tab, page: Path) -> None:
    ground = []
    for dark in (False, True):
        tab.open(page, width=1400, dark=dark)
        red = tab.run("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]")
        ground.append(red)
    assert ground[0] > 200
    assert ground[1] < 60


def test_a_counterfactual_away_from_its_scenario_says_whose_it_is(tab: Tab, tmp_path: Path) -> None:
    for name in ("whole", "whole.part"):
        write(tmp_path, name)
    assert report(tmp_path).exit_code == 0
    tab.open(tmp_path / "report.html", width=1400)
    prefix = "getComputedStyle(document.querySelector('.variant a'), '::before').content"
    press = "document.querySelector('.overview thead button').click()"
    assert [tab.run(prefix), *(tab.run(f"{press}, {prefix}") for _ in range(3))] == [
        "none", '"whole."', '"whole."', "none"
    ]  # fmt: skip
    tab.run("(words.value = 'part', words.dispatchEvent(new Event('input')))")
    assert tab.run(prefix) == '"whole."'
