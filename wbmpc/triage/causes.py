"""The kinds of causes, what a detector finds, and the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Cause(StrEnum):
    """What went wrong first."""

    NON_FINITE = "non-finite"
    LATE_PLAN = "late plan"
    STAGE_INFEASIBLE = "stage infeasible"
    CONTACT_NOT_MADE = "contact not made"
    SLIP = "slip"
    SELF_COLLISION = "self-collision"
    COLLISION = "collision"
    TORQUE_SATURATION = "torque saturation"
    JOINT_LIMIT = "joint limit"
    PUSH = "push"
    BALANCE_LOST = "balance lost"
    UNREACHABLE = "unreachable"


# Cause -> the tab of the viewer and, in it or in the 3D scene, what to look at (plots by title, entities by path).
LOOK_AT: dict[Cause, str] = {
    Cause.NON_FINITE: "tab Tracker, Joint velocity; /world/disturbance; NAME.last_states.npz",
    Cause.LATE_PLAN: "tab Timing, Plan in use; tab Tracker, CoM error",
    Cause.STAGE_INFEASIBLE: "tab Solvers, Solver status; tab Stage 3, why each candidate lost",
    Cause.CONTACT_NOT_MADE: "tab Contacts, Contact phases and the hand's or foot's force; /world/patches",
    Cause.SLIP: "tab Contacts, the foot's or hand's force; /world/contacts, an arrow on the edge of its friction cone",
    Cause.SELF_COLLISION: "the 3D scene, /world/contacts; tab Contacts, Penetration",
    Cause.COLLISION: "the 3D scene, /world/contacts; tab Contacts, Penetration",
    Cause.TORQUE_SATURATION: "tab Tracker, Torque / limit and CoM error",
    Cause.JOINT_LIMIT: "tab Tracker, Joint position minus reference and CoM error; the 3D scene",
    Cause.PUSH: "/world/disturbance; tab Overview, ZMP x and y",
    Cause.BALANCE_LOST: "tab Overview, ZMP x and y; tab Planner, CoM x and y; /world/support_polygon",
    Cause.UNREACHABLE: "tab Overview, Palm error; tab Planner, ΔZ and Progress; tab Stage 3",
}


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that went wrong in a stretch of time."""

    cause: Cause
    start: float  # [s]
    end: float  # [s] inf: it never got right again
    what: str  # one clause: who, where, how much
    firm: bool = True  # False: runs that pass live with it too; a cause only where there is no firm one


@dataclass(frozen=True, slots=True)
class Triage:
    """The first cause of a failed run."""

    cause: Cause
    time: float  # [s] when it began
    message: str
    found: Sequence[Finding]  # everything that was found, in order of time, until the robot was down

    @property
    def look_at(self) -> str:
        """Where in the viewer."""
        return LOOK_AT[self.cause]

    def as_dict(self) -> dict[str, Any]:
        """`triage` of NAME.json."""
        found = [{"cause": str(f.cause), "time": f.start, "message": f.what} for f in self.found]
        return {
            "cause": str(self.cause),
            "time": self.time,
            "message": self.message,
            "look_at": self.look_at,
            "found": found,
        }
