"""Checks of the hands: where they reach, what they touch, how hard they push."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wbmpc.checks.settings.common import CheckSettings, HoldSettings
from wbmpc.strict import NonNegative, Positive


class Reach(HoldSettings):
    """One palm stays within `max` of the reach target during the whole hold."""

    kind: Literal["reach"]
    max: Positive = Field(description="[m] largest distance between palm and target")


class Withdrawn(CheckSettings):
    """During the last `duration` the robot stands upright, its CoM back where it started, no hand in contact."""

    kind: Literal["withdrawn"]
    com_tolerance: Positive = Field(default=0.02, description="[m] CoM's distance from where it started")
    min_torso_up: float = Field(default=0.9, gt=-1, lt=1, description="smallest cosine of the torso's tilt")
    duration: Positive = Field(default=0.5, description="[s] how long at the end")


class BraceForce(HoldSettings):
    """During the hold the hands' normal contact forces sum to at least `min` of the body weight."""

    kind: Literal["brace_force"]
    min: Positive = Field(description="smallest sum of the hands' normal forces, as a share of body weight")


class ContactPatches(CheckSettings):
    """Which patches the planner chose, and how many hand contacts were made.

    `max_count: 0` means: no hand ever touched anything and stage 3 never fired.
    """

    kind: Literal["contact_patches"]
    allowed: tuple[str, ...] | None = Field(default=None, description="patches that may be chosen; default: any")
    min_count: int = Field(default=0, ge=0, description="fewest hand contacts made")
    max_count: int | None = Field(default=None, ge=0, description="most hand contacts made; default: any number")


class ContactSequence(CheckSettings):
    """Hand contacts on chosen patches followed one another, each on another patch than the one before.

    Counted are contacts that carried load; a hand that comes back to the patch it has just left makes no new one.
    """

    kind: Literal["contact_sequence"]
    min_contacts: int = Field(ge=1, description="fewest contacts")
    hands_alternate: bool = Field(default=False, description="no two contacts in a row by one hand")
    released: bool = Field(default=True, description="no hand touches anything when the run ends")


class BothHands(CheckSettings):
    """Both hands push on their chosen patches at the same time."""

    kind: Literal["both_hands"]
    min: Positive = Field(description="of body weight, the normal force of each hand")
    hold: Positive = Field(description="[s] for so long without a break")


class HandImpact(CheckSettings):
    """No palm is ever hit harder than `max`; friction counts as well."""

    kind: Literal["hand_impact"]
    max: Positive = Field(description="largest force of a palm, as a share of body weight")


class HandForceCaps(CheckSettings):
    """0.2 s after it began, no hand contact pushes harder than its patch's `force_cap`, but for a margin.

    Judged is the normal force's mean over 10 ms.
    """

    kind: Literal["hand_force_caps"]
    margin: NonNegative = Field(description="[N] above the cap")


class HandsFreeAtEnd(CheckSettings):
    """No palm touches anything during the last `duration`."""

    kind: Literal["hands_free_at_end"]
    duration: Positive = Field(default=0.5, description="[s] how long at the end")
