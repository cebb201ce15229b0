"""junit.xml: one suite per scenario run, one test case per check, so that any CI can show the results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from wbmpc.checks.result import CheckResult
from wbmpc.files import writing

# XML 1.0 has no way to write these, not even escaped.
_FORBIDDEN = {code: "?" for code in range(32) if chr(code) not in "\t\n\r"}


@dataclass(frozen=True, slots=True)
class Case:
    """One test case; `failure` is None when it passed."""

    name: str
    failure: str | None
    detail: str = ""  # of the failure: lines for whoever looks into it


@dataclass(frozen=True, slots=True)
class Suite:
    """One scenario."""

    name: str
    duration: float  # [s] wall time
    cases: Sequence[Case]


def case_of(check: CheckResult, detail: str = "") -> Case:
    """Test case of one check; `detail` is kept by a failing one."""
    if check.passed:
        return Case(check.name, None)
    when = "" if check.first_violation is None else f", first at t = {check.first_violation:.3f} s"
    text = f"value {check.value:.6g}, threshold {check.threshold:.6g} [{check.unit}]: {check.message}{when}"
    return Case(check.name, text, detail)


def write_junit(path: Path, suites: Sequence[Suite]) -> None:
    """Write all suites to `path`. Raises WbmpcError when that is impossible."""
    root = ElementTree.Element("testsuites", name="wbmpc")
    for suite in suites:
        failures = sum(case.failure is not None for case in suite.cases)
        element = ElementTree.SubElement(
            root,
            "testsuite",
            name=_clean(suite.name),
            tests=str(len(suite.cases)),
            failures=str(failures),
            errors="0",
            time=f"{suite.duration:.3f}",
        )
        for case in suite.cases:
            item = ElementTree.SubElement(element, "testcase", classname=_clean(suite.name), name=_clean(case.name))
            if case.failure is not None:
                ElementTree.SubElement(item, "failure", message=_clean(case.failure)).text = _clean(case.detail) or None
    ElementTree.indent(root)
    with writing(path):
        ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _clean(text: str) -> str:
    return text.translate(_FORBIDDEN)
