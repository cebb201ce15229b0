"""Checks of a reach: how close, how far out, and how hard the brace pushes while it is held."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial import ConvexHull

from wbmpc.checks import settings
from wbmpc.checks.context import CheckContext
from wbmpc.checks.posture import CONTACT_FORCE
from wbmpc.checks.result import CheckResult, at_least, at_most, failed, first_time
from wbmpc.signals import SIDES, Vector

POLYGON_PERIOD = 0.01  # [s] the support polygon is evaluated this often: it moves slowly, and costs a kinematics


def palm_error(context: CheckContext, target: tuple[float, float, float] | None) -> Vector:
    """(n, 2) [m] distance of each palm from the target, the scenario's (nearest, if there are several) by default."""
    targets = context.facts.reach_targets if target is None else (np.array(target),)
    palms = context.recorder.palm_position  # (n, 2, 3)
    return np.min([np.linalg.norm(palms - point, axis=2) for point in targets], axis=0)


def best_hold(error: Vector, width: int) -> tuple[float, int, slice]:
    """The window of `width` ticks, and the hand, with the smallest largest error.

    Args:
        error: (n, 2) with n >= width.

    Returns:
        Largest error in the window, side index of the hand, and the window's ticks.
    """
    # maximum_filter1d centres its window; `origin` makes entry k cover ticks k .. k + width - 1.
    largest = maximum_filter1d(error, width, axis=0, origin=-(width // 2))[: len(error) - width + 1]
    largest = np.where(np.isfinite(largest), largest, np.inf)
    start, hand = np.unravel_index(np.argmin(largest), largest.shape)
    return float(largest[start, hand]), int(hand), slice(int(start), int(start) + width)


def _hold(
    context: CheckContext, target: tuple[float, float, float] | None, hold: float
) -> tuple[float, int, slice] | str:
    """`best_hold` of the run, or the reason why there is none."""
    width = context.ticks(hold) + 1  # fence posts: `hold` seconds have one tick more than steps
    if target is None and not context.facts.reach_targets:
        return "the scenario has no reach task and the check no target"
    if context.recorder.ticks < width:
        return f"the run is shorter than the hold of {hold:g} s"
    return best_hold(palm_error(context, target), width)


class ReachCheck:
    """min over hands and windows of length `hold` of the largest |palm − target| in the window."""

    def __init__(self, config: settings.Reach) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        found = _hold(context, self.config.target, self.config.hold)
        if isinstance(found, str):
            return failed(name, self.config.max, "m", found)
        error, hand, window = found
        message = f"{SIDES[hand]} hand, held {self.config.hold:g} s from t = {context.time[window.start]:.2f} s"
        return at_most(name, error, self.config.max, "m", message, when=float(context.time[window.start]))


class ComBeyondToesCheck:
    """min over the best hold of the distance of the CoM's ground projection outside the support polygon of the feet.

    The polygon is the hull of the true sole corners of the feet that touch the world: the planner's is not trusted.
    """

    def __init__(self, config: settings.ComBeyondToes) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        found = _hold(context, self.config.target, self.config.hold)
        if isinstance(found, str):
            return failed(name, self.config.min, "m", found)
        _, _, window = found
        ticks = range(window.start, window.stop, context.ticks(POLYGON_PERIOD))
        touching = np.linalg.norm(context.sole_force, axis=2) > CONTACT_FORCE  # (n, 2)
        if not all(touching[k].any() for k in ticks):
            return failed(name, self.config.min, "m", "no foot touches the ground during the hold")
        outside = np.array([self._distance(context, k, touching[k]) for k in ticks])
        when = first_time(context.time[list(ticks)], ~(outside >= self.config.min))
        message = f"outside the feet for {self.config.hold:g} s from t = {context.time[window.start]:.2f} s"
        return at_least(name, float(outside.min()), self.config.min, "m", message, when=when)

    @staticmethod
    def _distance(context: CheckContext, tick: int, touching: Vector) -> float:
        corners = context.facts.sole_vertices(context.recorder.qpos[tick])[touching]  # (1 or 2, k, 3)
        return distance_outside(context.recorder.com[tick, :2], corners.reshape(-1, 3)[:, :2])


class BraceForceCheck:
    """min over the best hold of the hands' contact forces along their patches' normals, over the body weight."""

    def __init__(self, config: settings.BraceForce) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        found = _hold(context, self.config.target, self.config.hold)
        if isinstance(found, str):
            return failed(name, self.config.min, "1", found)
        _, _, window = found
        normal = np.zeros((context.recorder.ticks, len(SIDES), 3))
        for tick in range(window.start, window.stop):
            for side, patch in enumerate(context.patch_of_tick[tick]):
                if patch:
                    normal[tick, side] = context.facts.patch_normal[patch]
        push = np.einsum("nsx,nsx->n", context.palm_force, normal)[window] / context.body_weight  # (w,)
        when = first_time(context.time[window], ~(push >= self.config.min))
        message = f"of body weight, mean {push.mean():.3f}, from t = {context.time[window.start]:.2f} s"
        return at_least(name, float(push.min()), self.config.min, "1", message, when=when)


def distance_outside(point: Vector, vertices: Vector) -> float:
    """Distance [m] of `point` (2,) from the convex hull of `vertices` (k, 2): positive outside, negative inside."""
    hull = ConvexHull(vertices)
    corners = vertices[hull.vertices]  # counter-clockwise
    edge = np.roll(corners, -1, axis=0) - corners
    along = np.clip(np.einsum("ij,ij->i", point - corners, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
    distance = np.linalg.norm(corners + along[:, None] * edge - point, axis=1).min()
    inside = (hull.equations[:, :2] @ point + hull.equations[:, 2] <= 0.0).all()
    return float(-distance if inside else distance)
