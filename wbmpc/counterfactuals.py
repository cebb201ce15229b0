"""Whether a counterfactual ended as its scenario declares."""

from __future__ import annotations

from wbmpc.scenario import Counterfactual
from wbmpc.verdict import Verdict


def objection(counterfactual: Counterfactual, verdict: Verdict) -> str | None:
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
