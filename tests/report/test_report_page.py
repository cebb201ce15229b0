"""The page: what is there is shown, what is missing is said, nothing is loaded, no text becomes markup."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from report_case import NASTY, Page, check, write
from typer.testing import CliRunner, Result

from wbmpc.cli import app


def report(*words: Any) -> Result:
    return CliRunner().invoke(app, ["report", *map(str, words), "--jobs", "1"])


def page_of(folder: Path, *words: Any) -> Page:
    result = report(folder, *words)
    assert result.exit_code == 0, result.output
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def states(page: Page) -> dict[str, str]:
    """By run, as the overview counts them."""
    rows = [found["data-state"] for found in page.all("tr") if "data-state" in found]
    names = [found["data-key"].rsplit("/", 1)[1] for found in page.all("th", scope="row") if "data-key" in found]
    return dict(zip(names, rows, strict=True))


def test_verdicts_alone_make_a_page(tmp_path: Path) -> None:
    write(tmp_path, "good")
    write(tmp_path, "bad", checks=[check("reach", passed=False, value=0.9, first_violation=1.25)])
    page = page_of(tmp_path)
    assert states(page) == {"good": "passed", "bad": "failed"}
    assert "fails reach" in page.text
    assert "first at 1.25 s" in page.text
    assert "There is no recording of this run" in page.text
    assert len(page.all("details", class_="run")) == 2
    assert len(page.all("tr", class_="failed")) == 1


def test_nothing_is_loaded_from_anywhere(tmp_path: Path) -> None:
    write(tmp_path, "good")
    page = page_of(tmp_path)
    for _, attributes in page.elements:
        for name in ("src", "href", "srcset", "data", "action", "poster", "background"):
            assert attributes.get(name, "#").startswith(("#", "data:")), attributes
    assert not page.all("link")
    assert not re.search(r"@import|url\(|https?://", page.source)
    (policy,) = [m["content"] for m in page.all("meta") if m.get("http-equiv") == "Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert "script-src 'sha256-" in policy


def test_the_policy_lets_exactly_the_pages_own_script_run(tmp_path: Path) -> None:
    import hashlib
    from base64 import b64encode

    write(tmp_path, "good")
    page = page_of(tmp_path)
    (script,) = re.findall(r"<script>(.*?)</script>", page.source, re.DOTALL)
    assert f"'sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" in page.source


def test_what_runs_are_called_and_say_stays_text(tmp_path: Path) -> None:
    write(
        tmp_path,
        "nasty",
        checks=[check(NASTY, passed=False, message=NASTY, unit=NASTY)],
        triage={"cause": NASTY, "time": 1.5, "message": NASTY},
        versions={NASTY: NASTY},
        metrics={NASTY: 1.0},
        seed=NASTY,
    )
    (tmp_path / "a<b>&c.json").write_text((tmp_path / "nasty.json").read_text())
    page = page_of(tmp_path, "--title", NASTY)
    assert len(page.all("script")) == 1
    assert not page.all("b", class_="") or all("style" in found for found in page.all("b"))
    assert NASTY in page.text
    assert "a<b>&c" in page.text


def test_the_first_cause_is_shown_when_the_verdict_tells_it(tmp_path: Path) -> None:
    write(tmp_path, "told", triage={"cause": "late_contact", "time": 2.5, "message": "the hand came late", "more": [1]})
    write(tmp_path, "untold", triage=None)
    page = page_of(tmp_path)
    assert len(page.all("aside", class_="triage")) == 1
    for words in ("the hand came late", "late_contact", "2.5"):
        assert words in page.text


@pytest.mark.parametrize(
    "document",
    [
        {"checks": []},
        {"checks": [], "passed": True},
        {"checks": [{}], "passed": False},
        {"checks": [{"value": None, "threshold": 0, "name": None}, 3, "x"], "passed": False, "metrics": None},
        {"checks": [check("a", value=None)], "passed": False, "solver": {"plan": None, "stage1": {}}, "timing": [1]},
        {"checks": [check("a", value="x", threshold=True)], "passed": False, "triage": "it fell", "versions": 3},
        {"checks": [check("a", value=1e300, threshold=-1e-300)], "passed": False, "solver": [], "metrics": {"x": {}}},
    ],
)
def test_a_verdict_with_missing_or_odd_keys_is_taken(tmp_path: Path, document: dict[str, Any]) -> None:
    (tmp_path / "odd.json").write_text(json.dumps(document))
    page = page_of(tmp_path)
    assert states(page) == {
        "odd": "unfinished" if "passed" not in document else ["failed", "passed"][document["passed"]]
    }


def test_bars_show_the_value_in_halves_of_the_scale(tmp_path: Path) -> None:
    rows = [check("half", value=0.2), check("far", value=9.0), check("none", threshold=0.0), check("nan", value=None)]
    write(tmp_path, "bars", checks=rows)
    page = page_of(tmp_path)
    assert [found["style"] for found in page.all("b") if "style" in found] == ["width:25.0%", "width:100.0%"]
    assert len(page.all("i", class_="over")) == 1


def test_what_cannot_be_read_is_one_line_here_and_there(tmp_path: Path) -> None:
    write(tmp_path, "good")
    (tmp_path / "broken.rrd").write_bytes(b"hello")
    (tmp_path / "broken.json").write_text('{"checks": [')
    (tmp_path / "good.sweep.json").write_text('{"results": []}')  # no run, and no mistake
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x80")
    result = report(tmp_path)
    assert result.exit_code == 0
    lines = [line for line in result.stderr.splitlines() if str(tmp_path) in line and ": " in line]
    assert sorted(line.split(": ")[0] for line in lines) == sorted(
        str(tmp_path / name) for name in ("binary.json", "broken.json", "broken.rrd")
    )
    page = Page((tmp_path / "report.html").read_text())
    assert page.text.count("Not readable:") == 3
    assert states(page) == {"good": "passed"}


@pytest.mark.parametrize("content", [None, b"hello"])
def test_without_one_run_there_is_no_page(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "a.rrd").write_bytes(content)
    result = report(tmp_path)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"no run in {tmp_path}" if content is None else f"{tmp_path / 'a.rrd'}: not a readable")
    assert not (tmp_path / "report.html").exists()


def test_bad_arguments_are_one_line_and_exit_2(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("")
    (tmp_path / "b.json").write_text("{}")
    for path, message in [
        ("absent", "no such file or folder"),
        ("a.txt", "neither a recording"),
        ("b.json", "not the verdict of a run"),
    ]:
        result = report(tmp_path / path)
        assert result.exit_code == 2
        (line,) = result.stderr.splitlines()
        assert message in line
    write(tmp_path, "good")
    result = report(tmp_path / "good.json", "--out", tmp_path / "a.txt" / "page.html")
    assert (result.exit_code, result.stderr.splitlines()[0][:13]) == (2, "cannot write ")


def test_runs_of_one_name_in_two_folders_are_two_runs(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder, "same")
    page = page_of(tmp_path)
    assert len(page.all("details", class_="run")) == 2
    assert len({found["id"] for found in page.all("details", class_="run")}) == 2


def test_the_page_can_be_read_by_machines_that_read_aloud(tmp_path: Path) -> None:
    write(tmp_path, "good")
    page = page_of(tmp_path)
    assert page.all("html", lang="en")
    assert all("scope" in found for found in page.all("th"))
    assert all(found.get("alt") for found in page.all("img"))
    assert all(found.get("aria-label") or found.get("aria-hidden") for found in page.all("svg"))
    assert all(found.get("aria-label") for found in page.all("input"))
    ids = [found["id"] for _, found in page.elements if "id" in found]
    assert len(ids) == len(set(ids))
    for link in page.all("a"):
        assert not link["href"].startswith("#") or link["href"][1:] in ids


def _luminance(colour: str) -> float:
    """Relative luminance of #rgb or #rrggbb (WCAG 2.2)."""
    digits = colour.lstrip("#")
    digits = digits if len(digits) == 6 else "".join(2 * digit for digit in digits)
    channels = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def _contrast(a: str, b: str) -> float:
    dark, light = sorted(map(_luminance, (a, b)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
def test_colours_stand_out_as_wcag_asks(scheme: int) -> None:
    import wbmpc.report

    style = (Path(wbmpc.report.__file__).parent / "templates" / "style.css").read_text()
    colours = dict(re.findall(r"--([\w-]+): (#\w+);", re.findall(r":root \{(.*?)\}", style, re.DOTALL)[scheme]))
    for text in ("text", "soft", "link"):
        for ground in ("page", "card", "sunk"):
            assert _contrast(colours[text], colours[ground]) >= 4.5, (text, ground)
    for state in ("passed", "failed", "unfinished"):
        assert _contrast(colours[state], colours[f"{state}-bg"]) >= 4.5, state
    for ink in ("measured", "planned", "limit", "fault", "left", "right", "x", "y"):
        assert _contrast(colours[ink], colours["card"]) >= 3.0, ink
