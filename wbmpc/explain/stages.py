"""What the stages of one plan were made of, out of what was heard of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbmpc.explain.force_terms import choice_program, force_program
from wbmpc.explain.height_terms import height_program
from wbmpc.explain.motion_terms import MotionProgram
from wbmpc.explain.program import Active, Optimum, Program
from wbmpc.planner.listening import Call
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import PlannerSettings
from wbmpc.qp import QpSolution
from wbmpc.robot import Robot
from wbmpc.signals import PlanReport, SolveStatus, Vector

TITLES = {
    "height": "stage 1: CoM height",
    "need": "stage 2, ΔZ free: is a contact needed?",
    "choice": "stage 3: which contact?",
    "forces": "stage 3: what forces?",
    "motion": "stage 2, ΔZ = 0: the motion to execute",
}


@dataclass(frozen=True, slots=True)
class StageTerms:
    """One solve of one stage."""

    stage: str  # a key of TITLES
    status: SolveStatus
    iterations: int
    costs: Mapping[str, float]  # by term; empty when the solve failed
    optimum: Optimum | None

    @property
    def objective(self) -> float:
        """All terms together."""
        return sum(self.costs.values())

    @property
    def active(self) -> Sequence[Active]:
        """Constraints that hold the solution back, the strongest first."""
        return self.optimum.active if self.optimum else ()


class Solved:
    """A plan whose stages were listened to."""

    def __init__(self, report: PlanReport, calls: Sequence[Call], settings: PlannerSettings, robot: Robot) -> None:
        self.report = report
        self._calls, self._settings, self._robot = calls, settings, robot
        self._preview = Preview(steps=settings.horizon_steps, step=settings.horizon_step)

    def stages(self) -> list[StageTerms]:
        """Every stage that was asked, in the order of the planner."""
        found = []
        for stage, solve in (
            ("height", self._height),
            ("need", self._motion),
            ("choice", self._choice),
            ("forces", self._forces),
            ("motion", self._motion),
        ):
            call = self._last(stage, "plan" if stage == "height" else "solve")
            if call is not None:
                found.append(solve(call))
        return found

    # ------------------------------------------------------------------ one stage each

    def _last(self, stage: str, method: str) -> Call | None:
        return next((c for c in reversed(self._calls) if (c.stage, c.method) == (stage, method)), None)

    def _height(self, call: Call) -> StageTerms:
        program = height_program(self._preview, self._settings.height, *call.arguments, **call.named)
        return _terms(call, program, call.answer[1], call.answer[1].x)

    def _motion(self, call: Call) -> StageTerms:
        plan, solution = call.answer
        form = MotionProgram(
            self._preview,
            self._settings.whole_body,
            *call.arguments,
            asked=call.stage == "need",
            joint_names=tuple(self._robot.joint_names),
            **call.named,
        )
        return _terms(call, form.program, solution, None if plan is None else form.point(plan))

    def _choice(self, call: Call) -> StageTerms:
        (need, options), answer = call.arguments, call.answer
        taken = [i for i, option in enumerate(options) if option.held or i in answer.winners]
        program = choice_program(need, [options[i] for i in taken], self._settings.contact, mass=self._robot.mass)
        x = answer.forces[taken].ravel() if np.isfinite(answer.objective) else None
        return _terms(call, program, answer.solution, x)

    def _forces(self, call: Call) -> StageTerms:
        (need, patches, caps), (forces, solution) = call.arguments, call.answer
        there = [patch if cap.any() else None for patch, cap in zip(patches, caps, strict=True)]
        program = force_program(need, there, caps, self._settings.contact, mass=self._robot.mass)
        kept = [i for i, patch in enumerate(there) if patch is not None]
        return _terms(call, program, solution, None if forces is None else forces[kept].ravel())


def _terms(call: Call, program: Program, solution: QpSolution, x: Vector | None) -> StageTerms:
    if x is None or not solution.solved:
        return StageTerms(call.stage, solution.status, solution.iterations, {}, None)
    return StageTerms(call.stage, solution.status, solution.iterations, _soft(program.costs(x)), program.optimum(x))


def _soft(costs: dict[str, float]) -> dict[str, Any]:
    """Without what is hard and therefore costs nothing."""
    return {name: cost for name, cost in costs.items() if name not in ("friction cone", "force cap")}
