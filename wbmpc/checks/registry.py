"""All checks by kind, and their evaluation in order: the universal ones first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from wbmpc.checks.actuators import SpeedLimitCheck, TorqueLimitCheck, TorquePeakCheck
from wbmpc.checks.balance import ComBeyondToesCheck, ComOutsideStanceCheck
from wbmpc.checks.contacts import DeclaredContactsCheck, PenetrationCheck
from wbmpc.checks.context import CheckContext
from wbmpc.checks.footsteps import FootstepsCheck
from wbmpc.checks.hand_contacts import ContactPatchesCheck, ContactSequenceCheck
from wbmpc.checks.hand_forces import (
    BothHandsCheck,
    BraceForceCheck,
    HandForceCapsCheck,
    HandImpactCheck,
    HandsFreeAtEndCheck,
)
from wbmpc.checks.lift import ComDropCheck, ComInBandCheck, LiftedCheck
from wbmpc.checks.momentum import MomentumBalanceCheck
from wbmpc.checks.posture import ComHeightCheck, CompletedCheck, NoFallCheck, UprightAtEndCheck, WithdrawnCheck
from wbmpc.checks.push import PushRecoveryCheck
from wbmpc.checks.reach import ReachCheck
from wbmpc.checks.result import CheckResult, failed
from wbmpc.checks.settings import CheckSettings, UniversalSettings
from wbmpc.checks.solvers import SolverFailuresCheck
from wbmpc.checks.whereabouts import ArrivedCheck, ClimbedCheck, FootMovedCheck, TravelledCheck
from wbmpc.jit import trim
from wbmpc.strict import StrictModel


class Check(Protocol):
    """One check, made from its settings."""

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        """Compare the run with the threshold; `name` goes into the result."""
        ...


CHECKS: dict[str, Any] = {  # kind -> class; a class takes its own settings model
    "completed": CompletedCheck,
    "no_fall": NoFallCheck,
    "declared_contacts": DeclaredContactsCheck,
    "penetration": PenetrationCheck,
    "torque_limit": TorqueLimitCheck,
    "speed_limit": SpeedLimitCheck,
    "solver_failures": SolverFailuresCheck,
    "momentum_balance": MomentumBalanceCheck,
    "reach": ReachCheck,
    "withdrawn": WithdrawnCheck,
    "com_beyond_toes": ComBeyondToesCheck,
    "brace_force": BraceForceCheck,
    "torque_peak": TorquePeakCheck,
    "contact_patches": ContactPatchesCheck,
    "com_height": ComHeightCheck,
    "upright_at_end": UprightAtEndCheck,
    "push_recovery": PushRecoveryCheck,
    "footsteps": FootstepsCheck,
    "travelled": TravelledCheck,
    "arrived": ArrivedCheck,
    "climbed": ClimbedCheck,
    "foot_moved": FootMovedCheck,
    "com_outside_stance": ComOutsideStanceCheck,
    "contact_sequence": ContactSequenceCheck,
    "both_hands": BothHandsCheck,
    "hand_impact": HandImpactCheck,
    "hand_force_caps": HandForceCapsCheck,
    "lifted": LiftedCheck,
    "com_drop": ComDropCheck,
    "com_in_band": ComInBandCheck,
    "hands_free_at_end": HandsFreeAtEndCheck,
}


def evaluate_checks(
    context: CheckContext, *, universal: UniversalSettings, checks: Sequence[CheckSettings]
) -> list[CheckResult]:
    """Every check of a run: the universal ones under their kind, then `checks` under their name or kind.

    Names are unique: a second check of one name gets `name_2`.
    """
    configs = [(field, getattr(universal, field)) for field in UniversalSettings.model_fields]
    configs += [(config.name or _kind(config), config) for config in checks]
    results: list[CheckResult] = []
    used: set[str] = set()
    for wanted, config in configs:
        name = _unused(wanted, used)
        if context.recorder.ticks == 0:
            results.append(failed(name, 0.0, "1", "the run has no ticks"))
        else:
            check: Check = CHECKS[_kind(config)](config)
            results.append(check.evaluate(context, name))
            trim()  # the next check need not find what this one has freed still taken
    return results


def _kind(config: StrictModel) -> str:
    return str(config.kind)  # type: ignore[attr-defined]  # every member of the unions has one


def _unused(name: str, used: set[str]) -> str:
    candidate, count = name, 1
    while candidate in used:
        count += 1
        candidate = f"{name}_{count}"
    used.add(candidate)
    return candidate
