"""Random but realistic questions to stage 3: a small robot that leans out of its feet, tables and walls in reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbmpc.planner.contact_choice import ContactChoice, Option
from wbmpc.planner.contact_force import Need
from wbmpc.planner.settings import ContactSettings
from wbmpc.planner.support import SupportPolygon, foot_corners
from wbmpc.qp import QuadraticProgram
from wbmpc.scenario import PatchPose
from wbmpc.signals import GRAVITY, SIDES, Vector

MASS = 3.43  # [kg] of SURENA-MINI
SETTINGS = ContactSettings()
LEFTWARDS = np.array([0.0, 1.0])
_FEET = [  # standing, as in the model's home posture
    foot_corners(position=np.array([0.0, y]), yaw=0.0, half_extents=np.array([0.06, 0.035])) for y in (0.04, -0.04)
]
POLYGON = SupportPolygon.of_corners(np.vstack(_FEET), margin=0.018, plane_height=0.0)


@dataclass(frozen=True)
class Question:
    """One firing of stage 3."""

    need: Need
    options: list[Option]


def ask(seed: int, *, options: int, knots: int) -> Question:
    """A CoM that drifts out over one to four centimetres beyond the feet, and `options` places for the hands.

    Two thirds are tables, level or not, one third walls; every patch is offered to both hands, prices are distances
    from where the palms hang. Half of the questions have patches so weak that one is seldom enough.
    """
    rng = np.random.default_rng([seed, options, knots])
    weakest, strongest = (3.0, 25.0) if seed % 2 else (2.0, 5.0)  # [N]
    given: list[Option] = []
    for number in range((options + 1) // len(SIDES)):
        side = float(rng.choice([-1.0, 1.0]))
        normal = rng.normal(size=3) * [0.2, 0.2, 0.0] + [0.0, 0.0, 1.0]
        position = np.array([rng.uniform(0.05, 0.35), side * rng.uniform(0.0, 0.28), rng.uniform(0.10, 0.30)])
        if rng.random() < 1.0 / 3.0:
            normal, position[1] = np.array([0.0, -side, 0.0]), side * rng.uniform(0.15, 0.30)
        patch = PatchPose(
            f"patch_{number}", "object", position, normal / np.linalg.norm(normal),
            friction=rng.uniform(0.3, 0.9), force_cap=rng.uniform(weakest, strongest),
        )  # fmt: skip
        for hand in range(len(SIDES)):
            palm = np.array([0.02, 0.12 if hand == 0 else -0.12, 0.16])
            given.append(Option(patch, hand, SETTINGS.distance_cost * float(np.linalg.norm(position - palm))))
    start, drift, sideways = rng.uniform(0.010, 0.025), rng.uniform(0.0, 0.015), rng.uniform(-0.03, 0.03)
    lift = rng.uniform(-0.3, 0.3, knots)
    return Question(lean(start, drift=drift, sideways=sideways, knots=knots, lift=lift), given[:options])


def lean(start: float, *, drift: float, sideways: float, knots: int, lift: Vector | float = 0.0) -> Need:
    """The ZMP without contact, `start` [m] beyond the feet and drifting on and sideways, and the shift back into them.

    `lift` is c̈_z [m/s²] at every knot.
    """
    front = float(POLYGON.offsets[np.argmax(POLYGON.normals[:, 0])])
    share = np.linspace(0.0, 1.0, knots)
    zmp = np.column_stack([front + start + drift * share, sideways * share])
    wanted = np.array([POLYGON.nearest(point) for point in zmp])
    return Need(
        delta_z=wanted - zmp,
        zmp=zmp,
        weight=MASS * (GRAVITY + lift) * np.ones(knots),
        polygons=(POLYGON,) * knots,
        phantom=np.zeros((knots, 2)),
    )


class ScaledProblem:
    """The MIQP of `ContactChoice` with forces in weights and moments in metres, as well scaled as the kernels' own.

    Solvers of absolute tolerances would otherwise be asked for newtons at costs of a thousandth.
    """

    def __init__(self, choice: ContactChoice) -> None:
        source, unit = choice.problem, MASS * GRAVITY
        self._source, self._unit = source, unit
        self.problem = QuadraticProgram(
            source.variables, source.rows, unit**2 * source.soft_weight, source.binary.tolist()
        )

    def refresh(self) -> None:
        """Take the posed numbers over."""
        source, scaled, unit, binary = self._source, self.problem, self._unit, self._source.binary
        scaled.copy_from(source)
        forces = np.ones(source.variables, dtype=bool)
        forces[binary] = False
        scaled.hessian[np.ix_(forces, forces)] *= unit**2
        of_forces = source.matrix[:, forces].any(axis=1)  # the others are sums over binaries
        scaled.matrix[np.ix_(of_forces, binary)] /= unit
        scaled.lower[of_forces] /= unit
        scaled.upper[of_forces] /= unit
