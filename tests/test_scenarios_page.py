"""docs/scenarios.md is the page that the scenario files make, and its pictures are there and small.

When this fails after a change of a scenario: `make pictures`.
"""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
from PIL import Image

from wbmpc.scenario import Scenario

DOCS = Path(__file__).parents[1] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "scenarios_page.py"))
SHIPPED: list[Scenario] = SCRIPT["shipped"]()
MOST_BYTES = 150_000


def test_the_page_is_up_to_date() -> None:
    assert SCRIPT["page"](SHIPPED) == (DOCS / "scenarios.md").read_text(encoding="utf-8"), "run `make pictures`"


@pytest.mark.parametrize("scenario", SHIPPED, ids=lambda scenario: scenario.name)
@pytest.mark.parametrize("kind", ["strip", "plot"])
def test_pictures_are_there_and_small(scenario: Scenario, kind: str) -> None:
    path = DOCS / "pictures" / f"{scenario.name}_{kind}.webp"
    assert path.exists(), "run `make pictures`"
    assert path.stat().st_size <= MOST_BYTES
    with Image.open(path) as picture:
        picture.verify()
        assert picture.width > 1000


def test_the_paper_comes_first_and_every_counterfactual_is_named() -> None:
    text = SCRIPT["page"](SHIPPED)
    headings = [line[3:] for line in text.splitlines() if line.startswith("## ")]
    assert sorted(headings) == sorted(scenario.name for scenario in SHIPPED)
    papers = {scenario.name: bool(scenario.paper) for scenario in SHIPPED}
    assert [papers[name] for name in headings] == sorted(papers.values(), reverse=True)
    for scenario in SHIPPED:
        for name in scenario.counterfactuals:
            assert f"- `{name}` " in text
