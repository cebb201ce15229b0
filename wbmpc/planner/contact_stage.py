"""Stage 3's two problems by name of their solver: by enumeration and knot by knot, or as the plain (MI)QPs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from wbmpc.planner.contact_choice import Choice, ContactChoice, Option
from wbmpc.planner.contact_force import ContactForce, Need
from wbmpc.planner.contact_sets import ContactSets
from wbmpc.planner.knot_forces import KnotForces
from wbmpc.planner.settings import ContactSettings, PlannerSettings
from wbmpc.qp import QpSolution
from wbmpc.scenario import PatchPose
from wbmpc.signals import Vector

ENUMERATION = "enumeration"


class ChoosesContacts(Protocol):
    """Which contacts: `ContactChoice`, whose docstrings hold, or `ContactSets`."""

    def solve(self, need: Need, options: Sequence[Option], *, left: Vector) -> Choice:
        """See `ContactChoice.solve`."""
        ...

    def costs(
        self, need: Need, options: Sequence[Option], sets: Sequence[tuple[int, ...]], *, left: Vector
    ) -> list[tuple[float, Vector]]:
        """See `ContactChoice.costs`."""
        ...


class PlansForces(Protocol):
    """What forces: `ContactForce`, whose docstring holds, or `KnotForces`."""

    def solve(self, need: Need, patches: Sequence[PatchPose | None], caps: Vector) -> tuple[Vector | None, QpSolution]:
        """See `ContactForce.solve`."""
        ...


def make_contact_choice(backend: str, options: int, settings: ContactSettings, *, mass: float) -> ChoosesContacts:
    """Stage 3's choice among at most `options`; `backend` is ENUMERATION or a key of MIQP_BACKENDS."""
    if backend == ENUMERATION:
        return ContactSets(options, settings, mass=mass)
    return ContactChoice(options, settings, mass=mass, backend=backend)


def make_force_stage(settings: PlannerSettings, *, mass: float, steps: int, contacts: int) -> PlansForces:
    """Stage 3's forces at `steps` knots: the plain QP when the choice is a plain MIQP."""
    if settings.miqp_backend == ENUMERATION:
        return KnotForces(steps, settings.contact, mass=mass, contacts=contacts)
    return ContactForce(steps, settings.contact, mass=mass, contacts=contacts, backend=settings.qp_backend)
