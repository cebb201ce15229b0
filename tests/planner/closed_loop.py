"""The planner in a loop with its own plan: the robot is where the joint reference is, boxes push back on palms."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from robots import ROOT, at, palms, surena

from wbmpc.planner.plan import Plan
from wbmpc.planner.planner import Planner
from wbmpc.scenario import Scenario, load_scenario, resolve_patches
from wbmpc.signals import ContactPhase, HandMode, PlanReport, RobotState, Vector

ROBOT = surena()
PERIOD = 0.01  # [s]
STIFFNESS = 3000.0  # [N/m]


def scenario(name: str, **changes: object) -> Scenario:
    """A shipped scenario; a change's key is a dotted path with __ for the dots."""
    overrides = {key.replace("__", "."): value for key, value in changes.items()}
    return load_scenario(ROOT / "scenarios" / f"{name}.yaml", overrides=overrides)


@dataclass
class Run:
    """What happened, plan by plan."""

    plans: list[Plan] = field(default_factory=list)
    palms: list[Vector] = field(default_factory=list)

    @property
    def reports(self) -> list[PlanReport]:
        return [plan.report for plan in self.plans]

    @property
    def events(self) -> list[str]:
        return [event for report in self.reports for event in report.events]

    @property
    def fired(self) -> list[PlanReport]:
        return [report for report in self.reports if report.candidates]

    def phases(self, side: int) -> list[ContactPhase]:
        """The hand's phases in order, repetitions left out."""
        all_phases = [ContactPhase(report.contact_phase[side]) for report in self.reports]
        return [p for k, p in enumerate(all_phases) if k == 0 or all_phases[k - 1] != p]


def make_planner(given: Scenario) -> Planner:
    return Planner(
        ROBOT, given.planner, tasks=given.tasks, patches=resolve_patches(given), q=ROBOT.home_q, period=PERIOD
    )


def state_at(time: float, q: Vector, v: Vector, palm_force: Vector | None = None) -> RobotState:
    return RobotState(
        time=time,
        q=q,
        v=v,
        sole_wrench_in_world=np.zeros((2, 6)),
        palm_force_in_world=np.zeros((2, 3)) if palm_force is None else palm_force,
        mass_scale=1.0,
    )


def run(given: Scenario, seconds: float, *, table: bool = True) -> Run:
    """Plan every 10 ms; the robot follows q̇ without error, a palm on a box feels what the plan asks of it.

    `table`: whether the boxes are where the planner believes them to be, or nowhere.
    """
    planner, out = make_planner(given), Run()
    boxes = [box for box in given.world.objects.values() if table and box.present]
    q, v, force = ROBOT.home_q.copy(), np.zeros(ROBOT.nv), np.zeros((2, 3))
    for k in range(round(seconds / PERIOD)):
        plan = planner.solve(state_at(k * PERIOD, q, v, force))
        out.plans.append(plan)
        q, v = ROBOT.integrate(q, PERIOD * plan.velocity), plan.velocity
        np.clip(q[7:], ROBOT.joint_lower, ROBOT.joint_upper, out=q[7:])
        where = palms(q)
        out.palms.append(where)
        force = np.zeros((2, 3))
        for side, palm in enumerate(where):
            box = next((box for box in boxes if _over(palm, box.centre, box.size)), None)
            if box is None:
                continue
            depth = box.centre[2] + box.size[2] / 2 - (palm[2] - ROBOT.palm_radius)
            pressed = STIFFNESS * max(depth, 0.0)
            if plan.hand_mode[side] == HandMode.CONTACT:  # the tracker would press with the planned force
                pressed = max(pressed, float(plan.hand_force[side, 2]))
            force[side, 2] = pressed if depth > -0.002 else 0.0
    return out


def com_of(plan: Plan) -> Vector:
    """CoM (3,) of the plan's joint reference."""
    return at(plan.q).com


def _over(palm: Vector, centre: Vector, size: Vector) -> bool:
    return bool((np.abs(palm[:2] - np.array(centre)[:2]) <= np.array(size)[:2] / 2).all())
