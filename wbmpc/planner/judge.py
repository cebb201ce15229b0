"""Whether the tasks need a contact, and which: stage 2 with ΔZ free and everything at full pace, then stage 3."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wbmpc.planner.com_height import HeightPlan
from wbmpc.planner.contact_force import Need
from wbmpc.planner.contacts import NOT_RUN, Contacts
from wbmpc.planner.gait import Gait
from wbmpc.planner.horizontal_motion import Motion, ZmpModel
from wbmpc.planner.references import Paths, References
from wbmpc.planner.settings import PlannerSettings
from wbmpc.planner.support import SupportPolygon
from wbmpc.planner.support_preview import SupportPreview
from wbmpc.planner.tasks import Tasks
from wbmpc.planner.zmp_model import need_at_rest, need_of, shift_to_rest
from wbmpc.record import record
from wbmpc.signals import Firing, StageReport, Vector


@record
class Judgement:
    """What stages 2 and 3 say to the need for a contact."""

    delta_z: Vector  # (N, 2) [m] the shift asked for; 0 when nobody was asked
    firing: Firing | None = None
    stage3: StageReport = NOT_RUN


class _End(NamedTuple):
    """Where a task ends."""

    com: Vector  # (3,) [m]
    polygon: SupportPolygon
    shift: Vector  # (2,) [m] see `shift_to_rest`


class Judge:
    """Asks stage 2 what the tasks would need if nothing held them up, and leaves the rest to the contacts."""

    def __init__(
        self, settings: PlannerSettings, *, gait: Gait, references: References, contacts: Contacts, tasks: Tasks
    ) -> None:
        self._settings, self._margin = settings, settings.whole_body.zmp_margin
        self._gait, self._references, self._contacts, self._tasks = gait, references, contacts, tasks
        self._end: _End | None = None  # as last looked at

    def judge(
        self,
        time: float,
        times: Vector,
        paths: Paths,
        ask: Callable[[Vector], Motion | None],
        *,
        height: HeightPlan,
        model: ZmpModel,
        carried: Vector,
        support: SupportPreview,
        palms: Vector,
        mass: float,
        events: list[str],
    ) -> Judgement:
        """Judge one plan's need and plan the forces of the contacts there are.

        Args:
            time: now [s]; `times` (N,): the knots [s from now].
            paths: what the tasks ask for at full pace.
            ask: stage 2 with ΔZ free, given where the CoM may be (2, N, 2) [m].
            model: the ZMP without contact, what the hands carry included; `carried` (2, N, 3) [N]: its forces.
            support: at full pace.
            palms: measured (2, 3) [m].
            mass: [kg].
        """
        if not self._settings.contact_stage:
            return Judgement(np.zeros((len(times), 2)))
        contacts, references, gait = self._contacts, self._references, self._gait
        wish = ask(references.com_band(contacts, paths, gait.shares(times, 1.0)))
        if wish is None:
            return Judgement(np.zeros((len(times), 2)))
        need = need_of(
            *(wish, height, model),
            carried=carried,
            polygons=support.polygons,
            mass=mass,
            exact=self._settings.formulation == "exact",
        )
        firing, stage3 = contacts.plan(
            *(time, need),
            goal=self._goal_need(mass),
            binding=gait.stride is not None,
            palms=palms,
            hand_taken=self._tasks.hands_taken,
            polygon=gait.present_polygon(self._margin),
            spent=references.spent(contacts),
            events=events,
        )
        return Judgement(wish.delta_z.copy(), firing, stage3)

    def _goal_need(self, mass: float) -> Need | None:
        """The need where the current task ends, on the feet that will carry it; None without such a task."""
        com = self._references.goal_com
        if com is None:
            return None
        polygon, end = self._gait.goal_polygon(self._margin), self._end
        if end is None or end.com is not com or end.polygon is not polygon:
            end = self._end = _End(com, polygon, shift_to_rest(com, polygon))
        return need_at_rest(com, polygon=polygon, shift=end.shift, mass=mass)
