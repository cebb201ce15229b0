"""Problems of stage 2 for its tests: standing, stepping, random."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from robots import at, standing_polygon, surena

from wbmpc.planner.horizontal_motion import ZmpModel
from wbmpc.planner.joint_velocities import JointVelocities, VelocityTasks
from wbmpc.planner.preview import Preview
from wbmpc.planner.settings import WholeBodySettings
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.planner.support_preview import MAX_FOOTSTEPS, SupportPreview
from wbmpc.planner.whole_body import HorizontalPlan, WholeBodyStage
from wbmpc.signals import GRAVITY, Vector

ROBOT = surena()
N, T = 16, 0.1
PREVIEW = Preview(steps=N, step=T)
SETTINGS = WholeBodySettings()
TAU = 0.01  # [s]
MARGIN = 0.018  # [m]


@dataclass(frozen=True)
class Problem:
    """The arguments of one solve."""

    state: Vector
    zmp: ZmpModel
    support: SupportPreview
    com_band: Vector
    tasks: VelocityTasks
    urgency: float = 1.0


def standing(growth: float = 0.0) -> SupportPreview:
    """Both feet in the home posture over the whole horizon, the inset growing [m/s]."""
    polygon = standing_polygon(margin=MARGIN)
    polygons = tuple(polygon.shrunk(growth * t) for t in PREVIEW.times)
    return SupportPreview.standing(polygons, rest=polygons[-1])


def velocity_tasks(rng: np.random.Generator | None = None) -> VelocityTasks:
    """Standing feet and no wish at the home posture, or random wishes at a random posture."""
    nj = ROBOT.nj
    q = ROBOT.home_q.copy()
    if rng is not None:
        q = ROBOT.integrate(q, np.concatenate([np.zeros(6), rng.uniform(-0.3, 0.3, nj)]))
    kinematics = at(q)

    def random(size: int, scale: float) -> Vector:
        return np.zeros(size) if rng is None else rng.uniform(-scale, scale, size)

    return VelocityTasks(
        com_jacobian=kinematics.com_jacobian,
        com_correction=random(3, 0.05),
        com_vertical_velocity=float(random(1, 0.1)[0]),
        foot_jacobian=np.vstack([kinematics.jacobian(frame) for frame in ROBOT.sole_frames]),
        foot_velocity=np.concatenate([np.zeros(6), random(6, 0.2)]),  # the right foot swings
        hand_jacobian=np.vstack([kinematics.jacobian(frame)[:3] for frame in ROBOT.palm_frames]),
        hand_velocity=random(6, 0.2),
        hand_active=np.zeros(2) if rng is None else rng.choice([0.0, 1.0], 2),
        torso_jacobian=kinematics.jacobian(ROBOT.torso_frame)[3:],
        torso_velocity=random(3, 0.2),
        posture_velocity=np.concatenate([np.zeros(6), random(nj, 0.3)]),
        posture_weight=np.ones(6 + nj) if rng is None else rng.uniform(0.5, 30.0, 6 + nj),
        lower=np.concatenate([np.full(6, -5.0), np.full(nj, -3.0) if rng is None else rng.uniform(-3.0, 0.0, nj)]),
        upper=np.concatenate([np.full(6, 5.0), np.full(nj, 3.0) if rng is None else rng.uniform(0.0, 3.0, nj)]),
    )


def still(**changes: Any) -> Problem:
    """Standing at rest over the middle of the feet."""
    support = standing()
    centre = support.centres[0]
    problem = Problem(
        state=np.array([[centre[0], 0.0, 0.0], [centre[1], 0.0, 0.0]]),
        zmp=ZmpModel(np.ones(N), np.full(N, 0.264 / GRAVITY), np.zeros((N, 2))),
        support=support,
        com_band=np.tile([-np.inf, np.inf], (2, N, 1)),
        tasks=velocity_tasks(),
    )
    return replace(problem, **changes)


def random_problem(seed: int, *, walking: bool) -> Problem:
    """Random wishes and a random state; `walking`: over random footsteps, with bounds and places that bind."""
    rng = np.random.default_rng(seed)
    state = np.column_stack([rng.uniform(-0.02, 0.04, 2), rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.2, 0.2, 2)])
    middle = np.linspace(state[:, 0], rng.uniform([-0.1, -0.1], [0.1, 0.1]), N).T  # (2, N)
    band = np.stack([middle - rng.uniform(0.005, 0.1, (2, 1)), middle + rng.uniform(0.005, 0.1, (2, 1))], axis=2)
    band[0, : rng.integers(N), 0] = -np.inf
    band[1, rng.integers(N) :] = [-np.inf, np.inf]
    return Problem(
        state=state,
        zmp=ZmpModel(rng.uniform(0.9, 1.2, N), rng.uniform(0.02, 0.03, N), rng.uniform(-0.01, 0.01, (N, 2))),
        support=_footsteps(rng) if walking else standing(growth=0.008),
        com_band=band,
        tasks=velocity_tasks(rng),
        urgency=float(rng.choice([1.0, 20.0])),
    )


def _footsteps(rng: np.random.Generator) -> SupportPreview:
    """Left and right by turns, three knots each on one foot, then two on both: any numbers will do."""
    m = MAX_FOOTSTEPS
    places = np.column_stack([0.04 * np.arange(m + 1), np.where(np.arange(m + 1) % 2, -0.045, 0.045)])
    places += rng.uniform(-0.01, 0.01, places.shape)
    yaws = rng.uniform(-0.3, 0.3, m + 1)
    corners = [
        foot_corners(position=place, yaw=yaw, half_extents=ROBOT.sole_half_extents)
        for place, yaw in zip(places, yaws, strict=True)
    ]
    polygons, shift, centring = [], np.zeros((N, m)), np.zeros(N)
    for k in range(N):
        stance, double = min(k // 5, m), k % 5 > 2  # place 0 is where a foot stands already
        feet = [stance, min(stance + 1, m)] if double else [stance]
        for foot in feet:
            if foot:
                shift[k, foot - 1] += 1.0 / len(feet)
        centring[k] = 0.0 if double else rng.uniform(0.0, 1.0)
        polygons.append(
            SupportPolygon.of_corners(np.vstack([corners[f] for f in feet]), margin=0.005 + 0.002 * k, plane_height=0.0)
        )
    rest = SupportPolygon.of_corners(np.vstack(corners[-2:]), margin=0.02, plane_height=0.0)
    limit = rng.choice([0.0, 0.01, 0.3], (m, 2))
    turn = np.array([[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in yaws[:-1]])
    return replace(
        SupportPreview.standing(tuple(polygons), rest=rest),
        shift=shift,
        centring=centring,
        rest_shift=np.array([0.0, 0.0, 0.5, 0.5]),
        footsteps=places[1:],
        placement_axes=turn,
        placement_lower=rng.uniform(-0.02, -0.001, (m, 2)),
        placement_upper=rng.uniform(0.001, 0.02, (m, 2)),
        lower=-limit,
        upper=limit,
        com_velocity=rng.uniform(-0.1, 0.1, (N, 2)),
    )


def stage(*, ask_shift: bool, backend: str = "daqp") -> WholeBodyStage:
    joints = JointVelocities(ROBOT.nv, SETTINGS, backend=backend)
    return WholeBodyStage(PREVIEW, SETTINGS, joints, backend=backend, ask_shift=ask_shift)


def arguments(problem: Problem) -> dict[str, Any]:
    """Everything but the state."""
    names = (name for name in problem.__dataclass_fields__ if name != "state")
    return {name: getattr(problem, name) for name in names} | {"velocity_time": TAU}


def solve(problem: Problem, *, ask_shift: bool = False, using: WholeBodyStage | None = None) -> HorizontalPlan:
    """The plan of `using`, or of a new stage."""
    plan, solution = (using or stage(ask_shift=ask_shift)).solve(problem.state, **arguments(problem))
    assert plan is not None, solution.status.name
    return plan
