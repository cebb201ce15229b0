"""Runs -> HTML. The templates place and escape; the page loads nothing, which its own policy forbids."""

from __future__ import annotations

import hashlib
from base64 import b64encode
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import YamlLexer

from wbmpc.report.find import Unreadable
from wbmpc.report.run import FAILED, PASSED, UNFINISHED, Run
from wbmpc.report.verdicts import numbers, shown, triage_rows
from wbmpc.versions import versions

TEMPLATES = Path(__file__).parent / "templates"


def page(runs: Sequence[Run], unreadable: Sequence[Unreadable], *, title: str, made: datetime) -> str:
    """The whole document."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["shown"] = shown
    script = (TEMPLATES / "page.js").read_text(encoding="utf-8")
    states = Counter(run.state for run in runs)
    return environment.get_template("page.html").render(
        title=title,
        made=made.strftime("%Y-%m-%d %H:%M"),
        version=versions()["wbmpc"],
        runs=_dressed(runs),
        unreadable=unreadable,
        count={state: states[state] for state in (PASSED, FAILED, UNFINISHED)},
        folders=len({run.folder for run in runs}),
        simulated=sum(_simulated(run) or 0.0 for run in runs),
        style=Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        script=Markup(script),
        script_hash=f"sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}",
    )


def _dressed(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """The runs with what only the page needs: anchors, groups, tables."""
    names = {(run.folder, run.name) for run in runs}
    return [_dress(run, f"run-{k}", (run.folder, run.parent) in names) for run, k in zip(runs, count(1))]


def _dress(run: Run, anchor: str, parent_shown: bool) -> dict[str, Any]:
    fields = {
        name: getattr(run, name) for name in (*Run.__dataclass_fields__, "parent", "variant", "state", "headline")
    }
    timing = [(name, value) for name, value in numbers(run.verdict, "timing") if value is not None]  # of its own clock
    return fields | {
        "anchor": anchor,
        "grouped": bool(run.variant) and parent_shown,
        "row": _row(run),
        "triage": triage_rows(run.verdict),
        "tables": [("Metrics", numbers(run.verdict, "metrics")), ("Timing", timing)],
        "versions": numbers(run.verdict, "versions"),
        "scenario_html": Markup(highlight(run.scenario, YamlLexer(), HtmlFormatter(nowrap=True))),
        "scenario_uri": f"data:text/yaml;base64,{b64encode(run.scenario.encode()).decode()}",
    }


def _row(run: Run) -> list[Any]:
    """The overview's numbers; None where one is not known."""
    verdict = run.verdict
    metrics, timing = dict(numbers(verdict, "metrics")), dict(numbers(verdict, "timing"))
    plan = next((row.p99 for row in run.solver.rows if row.name == "plan"), None) if run.solver else None
    share = metrics.get("torque_peak_fraction")
    torque = 100 * share if isinstance(share, int | float) else None
    return [_simulated(run), timing.get("real_time_factor"), plan, torque, metrics.get("hand_contacts")]


def _simulated(run: Run) -> float | None:
    """[s]"""
    found = dict(numbers(run.verdict, "metrics")).get("simulated_time")
    if isinstance(found, int | float):
        return float(found)
    return run.motion.end - run.motion.start if run.motion else None
