"""What a scenario may write under `checks:` and `universal:`; one frozen model per check, told apart by `kind`.

Lengths in metres, times in seconds, forces as a fraction of body weight, torques as a fraction of the servo's limit.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from wbmpc.checks.settings.common import CheckSettings, HoldSettings, WindowSettings
from wbmpc.checks.settings.hands import (
    BothHands,
    BraceForce,
    ContactPatches,
    ContactSequence,
    HandForceCaps,
    HandImpact,
    HandsFreeAtEnd,
    Reach,
    Withdrawn,
)
from wbmpc.checks.settings.lift import ComDrop, ComInBand, Lifted
from wbmpc.checks.settings.motion import (
    Arrived,
    Climbed,
    ComBeyondToes,
    ComHeight,
    ComOutsideStance,
    FootMoved,
    Footsteps,
    PushRecovery,
    TorquePeak,
    Travelled,
    UprightAtEnd,
)
from wbmpc.checks.settings.universal import (
    Completed,
    DeclaredContacts,
    MomentumBalance,
    NoFall,
    Penetration,
    SolverFailures,
    SpeedLimit,
    TorqueLimit,
    UniversalSettings,
)

ScenarioCheck = Annotated[
    Reach
    | Withdrawn
    | ComBeyondToes
    | BraceForce
    | TorquePeak
    | ContactPatches
    | ComHeight
    | UprightAtEnd
    | PushRecovery
    | Footsteps
    | Travelled
    | Arrived
    | Lifted
    | ComDrop
    | ComInBand
    | Climbed
    | FootMoved
    | ComOutsideStance
    | ContactSequence
    | BothHands
    | HandImpact
    | HandForceCaps
    | HandsFreeAtEnd,
    Field(discriminator="kind"),
]

__all__ = [
    "Arrived",
    "BothHands",
    "BraceForce",
    "CheckSettings",
    "Climbed",
    "ComBeyondToes",
    "ComDrop",
    "ComHeight",
    "ComInBand",
    "ComOutsideStance",
    "Completed",
    "ContactPatches",
    "ContactSequence",
    "DeclaredContacts",
    "FootMoved",
    "Footsteps",
    "HandForceCaps",
    "HandImpact",
    "HandsFreeAtEnd",
    "HoldSettings",
    "Lifted",
    "MomentumBalance",
    "NoFall",
    "Penetration",
    "PushRecovery",
    "Reach",
    "ScenarioCheck",
    "SolverFailures",
    "SpeedLimit",
    "TorqueLimit",
    "TorquePeak",
    "Travelled",
    "UniversalSettings",
    "UprightAtEnd",
    "WindowSettings",
    "Withdrawn",
]
