"""Whether a counterfactual ended as its scenario declares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from wbmpc.scenario import Counterfactual


class Named(Protocol):
    """A check's result, as far as it matters here."""

    @property
    def name(self) -> str:
        """Unique in its run."""
        ...


class Judged(Protocol):
    """A verdict, as far as it matters here."""

    @property
    def passed(self) -> bool:
        """Whether all checks passed."""
        ...

    @property
    def failing(self) -> tuple[str, ...]:
        """Names of the failed checks."""
        ...

    @property
    def checks(self) -> Sequence[Named]:
        """All of them."""
        ...


def ending(verdict: Judged) -> str:
    """How a run ended, in words: "passes", or "fails" and what."""
    return "passes" if verdict.passed else f"fails {', '.join(verdict.failing)}".rstrip()


def objection(counterfactual: Counterfactual, verdict: Judged) -> str | None:
    """What is wrong with the outcome; None when it is the declared one.

    Expected to pass: every check passes. Expected to fail: some check fails, and all of `failing` are among those.
    """
    failing = verdict.failing
    if counterfactual.expect == "pass":
        return None if verdict.passed else f"expected to pass, but failed {', '.join(failing)}"
    if verdict.passed:
        return "expected to fail, but passed"
    known = {check.name for check in verdict.checks}
    absent = [name for name in counterfactual.failing if name not in known]
    if absent:
        return f"expected to fail {', '.join(absent)}, but there is no such check: {', '.join(sorted(known))}"
    kept = [name for name in counterfactual.failing if name not in failing]
    if kept:
        return f"expected to fail {', '.join(kept)}, but failed only {', '.join(failing)}"
    return None
