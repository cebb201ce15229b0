"""docs/paper.md names files, functions and tests: all of them exist, and every equation of the paper has its row."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`((?:wbmpc|tests|scenarios)/[\w/]+\.(?:py|yaml)[\w.:]*)`", PAGE)))

# every label of the paper's source
LABELS = [
    "Newton-Euler1",
    "Newton-Euler2",
    "Combining-Nwtn-Eulr",
    "ZMP-eq",
    "simplify-ZMPeq",
    "state-eq",
    "c-hat-z",
    "N-preview-Cz",
    "N-preview-dpt(Cz)",
    "N-preview-ddot(Cz)",
    "P_as&P_au",
    "QP1",
    "ZMP_k",
    "ak_bk_qk",
    "ZMP_k+1",
    "Pz-eqs",
    "ZMP-constraint",
    "DeltaZ",
    "DeltaZ_k",
    "ZMP-constraints-in-N-horizon",
    "formul",
    "neweq",
    "QP2",
    "fig1",
    "fig2",
    "fig3",
    "fig4",
]


def names_in(path: Path) -> set[str]:
    """Functions, classes and `Class.method`s of a file."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{inner.name}" for inner in node.body if isinstance(inner, ast.FunctionDef)}
    return names


@pytest.mark.parametrize("named", NAMED)
def test_what_the_page_names_exists(named: str) -> None:
    file, _, name = named.partition("::" if "::" in named else ":")
    path = ROOT / file
    assert path.is_file(), f"docs/paper.md names {file}"
    if name:
        assert name in names_in(path), f"docs/paper.md names {named}"


def test_the_page_names_enough_to_be_worth_reading() -> None:
    assert len(NAMED) > 30
    assert sum("::" in named for named in NAMED) > 20


@pytest.mark.parametrize("label", LABELS)
def test_every_label_of_the_paper_has_a_row(label: str) -> None:
    first_cells = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("|")]
    cited = {part.split(" ")[0] for cell in first_cells for part in cell.strip().split(", ")}
    assert label in cited


def test_rows_of_equations_name_an_implementation_and_a_test() -> None:
    table = PAGE.split("## Equations")[1].split("## Figures")[0]
    rows = [line.split(" | ") for line in table.splitlines() if line.startswith("| ") and "[M]" not in line]
    assert len(rows) > 18
    for row in rows:
        assert "`wbmpc/" in row[2], row[0]
        assert "`tests/" in row[3], row[0]
