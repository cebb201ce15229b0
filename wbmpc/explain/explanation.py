"""One recorded plan solved again, with or without a change, and everything that there is to say about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbmpc.explain.changes import Change
from wbmpc.explain.past import Past, new_planner
from wbmpc.explain.stages import TITLES, Solved, StageTerms
from wbmpc.planner.graft import forbid, graft
from wbmpc.planner.listening import listening
from wbmpc.planner.planner import Planner
from wbmpc.rerun_sink.snapshots import digest
from wbmpc.scenario import Scenario
from wbmpc.signals import SIDES, CandidateReport, ContactPhase, PlanReport, RobotState
from wbmpc.verdict import finite


@dataclass(frozen=True, slots=True)
class Variant:
    """A plan and what it was made of."""

    report: PlanReport
    stages: Sequence[StageTerms]

    @property
    def candidates(self) -> Sequence[CandidateReport]:
        """Every candidate when stage 3 fired, the chosen first, then the cheapest."""
        return sorted(self.report.candidates, key=lambda c: (not c.chosen, c.cost))

    def outcome(self) -> dict[str, str]:
        """What was decided, by quantity, as text."""
        report = self.report
        rows = {
            "stage 3": " and ".join(f"{c.patch}, {SIDES[c.hand]} hand" for c in self.candidates if c.chosen)
            or ("no candidate helps" if self.candidates else "did not fire"),
        }
        for i, side in enumerate(SIDES):
            phase = ContactPhase(int(report.contact_phase[i])).name.lower()
            rows[f"{side} hand"] = f"{phase} {report.contact_patch[i]}".strip()
            rows[f"{side} hand's force, knot 1 [N]"] = _vector(report.contact_force[i, 0], 2)
        rows["largest |ΔZ| [mm]"] = f"{1e3 * np.abs(report.delta_z).max():.2f}"
        for k, name in ((0, "first"), (-1, "last")):
            rows[f"CoM at the {name} knot [mm]"] = _vector(1e3 * report.com[k], 2)
            rows[f"ZMP at the {name} knot [mm]"] = _vector(1e3 * report.zmp[k], 2)
        rows["task progress"] = f"{report.progress:.3g}"
        return rows


@dataclass(frozen=True, slots=True)
class Explanation:
    """See `explain`."""

    time: float  # [s] of the snapshot
    index: int  # of the plan among the recorded ones
    identical: bool  # whether the plan is the recorded one to the bit
    parted: int | None  # first plan of the way there that was not the recorded one
    differences: Mapping[str, float]  # [m] from the recorded horizons as drawn, when not identical
    recorded: Variant
    changed: Variant | None
    change: Change | None

    def as_dict(self) -> dict[str, Any]:
        """For machines; plain numbers, lists and texts."""
        document = {
            "time": self.time,
            "plan": self.index,
            "identical": self.identical,
            "first_different_plan": self.parted,
            "differences": dict(self.differences),
            "changes": list(self.change.words) if self.change else [],
            "recorded": _as_dict(self.recorded),
            "changed": _as_dict(self.changed) if self.changed else None,
        }
        return dict(finite(document))


def explain(
    past: Past, index: int, change: Change | None = None, on_progress: Callable[[int], None] | None = None
) -> Explanation:
    """Solve recorded plan `index` again, from the same past, and once more with `change` in this one plan.

    The past is as recorded in either case: every plan before this one is made with the recorded scenario, from the
    recorded snapshots.
    """
    recorded = past.plans[index]
    planner, parted = past.planner_before(index, on_progress)
    scenario = past.run.scenario
    as_it_was = _solve(planner, recorded.state, scenario, past)
    identical = digest(as_it_was.report) == recorded.digest
    changed = None
    if change is not None:
        planner, _ = past.planner_before(index, on_progress)
        apply(change, planner, past)
        changed = _solve(planner, recorded.state, change.scenario, past)
    return Explanation(
        time=recorded.state.time,
        index=index,
        identical=identical,
        parted=parted,
        differences={} if identical else past.drawn_difference(as_it_was.report),
        recorded=as_it_was,
        changed=changed,
        change=change,
    )


def apply(change: Change, planner: Planner, past: Past) -> None:
    """Change the planner of a run from now on; its past stays."""
    before, after = past.run.scenario, change.scenario
    if (after.planner, after.patches) != (before.planner, before.patches):
        graft(planner, new_planner(change.scenario, past.robot))
    for patch in change.forbidden:
        forbid(planner, patch)


def _solve(planner: Planner, state: RobotState, scenario: Scenario, past: Past) -> Variant:
    with listening(planner) as calls:
        report = planner.solve(state).report
    solved = Solved(report, calls, scenario.planner, past.robot)
    return Variant(report, solved.stages())


def _vector(values: Any, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _as_dict(variant: Variant) -> dict[str, Any]:
    report = variant.report
    return {
        "digest": digest(report),
        "outcome": variant.outcome(),
        "plan": {
            name: np.asarray(getattr(report, name)).tolist()
            for name in (
                "com",
                "zmp",
                "delta_z",
                "contact_force",
                "contact_phase",
                "contact_patch",
                "progress",
                "events",
            )
        },
        "stages": [
            {
                "stage": stage.stage,
                "title": TITLES[stage.stage],
                "status": stage.status.name,
                "iterations": stage.iterations,
                "objective": stage.objective,
                "terms": dict(stage.costs),
                "stationarity": stage.optimum.residual if stage.optimum else None,
                "worth_of_shift": stage.optimum.worth if stage.optimum else None,
                "active": [
                    {name: getattr(a, name) for name in ("term", "label", "multiplier", "excess", "unit")}
                    for a in stage.active
                ],
            }
            for stage in variant.stages
        ],
        "candidates": [
            {
                "patch": c.patch,
                "hand": SIDES[c.hand],
                "chosen": c.chosen,
                "cost": c.cost,
                "parts": {part: getattr(c, f"{part}_cost") for part in ("way", "force", "shift")},
                "beside": list(c.beside),
                "reach_slack": c.reach_slack,
                "reach_limit": c.reach_limit,
                "friction_margin": c.friction_margin,
                "forces": c.forces.tolist(),
                "reason": c.reason,
            }
            for c in variant.candidates
        ],
    }
