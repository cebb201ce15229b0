"""Recordings, verdicts and pages for the tests of the report: a made-up robot's run is enough for most of them."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

NASTY = """<script>alert("x")</script> & 'quoted' <b>"""
VOID = {"meta", "img", "input", "source", "path", "circle", "rect", "polyline", "br", "link"}


def check(name: str, **changes: Any) -> dict[str, Any]:
    row = {"name": name, "passed": True, "value": 0.2, "threshold": 0.4, "unit": "m", "message": "as measured"}
    return {**row, "first_violation": None, **changes}


def verdict(name: str, *, checks: list[dict[str, Any]] | None = None, **changes: Any) -> dict[str, Any]:
    checks = [check("reach")] if checks is None else checks
    document = {
        "scenario": name,
        "seed": 3,
        "passed": all(row["passed"] for row in checks),
        "checks": checks,
        "metrics": {"simulated_time": 2.0, "hand_contacts": 1.0, "torque_peak_fraction": 0.5},
        "solver": {"tracker": {"solves": 2000, "failures": 0, "p50": 1e-4, "p99": 2e-4, "max": 5e-3}},
        "timing": {"real_time_factor": 1.5},
        "versions": {"mujoco": "4.0.0"},
        "state_sha256": "ab" * 32,
    }
    return {**document, **changes}


def write(folder: Path, name: str, **changes: Any) -> Path:
    path = folder / f"{name}.json"
    path.write_text(json.dumps(verdict(name, **changes)), encoding="utf-8")
    return path


class Page(HTMLParser):
    """A page taken apart: its elements with their attributes, its text, and whether every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.source = text
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert not self._open, f"not closed: {self._open}"

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attributes}))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attributes}))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self._open, f"</{tag}> closes nothing"
            assert self._open.pop() == tag, f"</{tag}> in the wrong place"

    def handle_data(self, data: str) -> None:
        if not self._open or self._open[-1] not in ("script", "style"):
            self.text += data

    def all(self, tag: str, **attributes: str) -> list[dict[str, str]]:
        """Attributes of every element of this name that has the given classes and values (class_: one class)."""
        wanted = attributes.pop("class_", None)
        return [
            found
            for name, found in self.elements
            if name == tag
            and (wanted is None or wanted in found.get("class", "").split())
            and all(found.get(key) == value for key, value in attributes.items())
        ]
