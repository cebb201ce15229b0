"""Declared pushes, and whether feet that stand could have taken them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wbmpc.checks.context import CheckContext
from wbmpc.checks.stretches import joined
from wbmpc.triage.balance import capture_point, capture_rate, margin, support_points
from wbmpc.triage.causes import Cause, Finding

STANDING = 0.5  # [s] both soles have touched for so long: no step is under way that could catch the push


def pushes(context: CheckContext) -> Iterator[Finding]:
    """Every push; firm when its impulse alone takes the capture point of a standing robot out of its contacts.

    A horizontal impulse J moves the capture point by J / (m ω) (linear inverted pendulum).
    """
    force = context.recorder.external_force
    capture, rate = capture_point(context), capture_rate(context)
    for first, stop in joined(np.any(force != 0.0, axis=1), 2):
        impulse = force[first:stop, :2].sum(axis=0) * context.facts.timestep
        size = float(np.linalg.norm(impulse))
        if size == 0.0:
            continue
        shift = size / (context.facts.mass * rate[first])
        room = margin(support_points(context, first), capture[first], impulse[None] / size)
        stood = context.sole_touching[max(0, first - context.ticks(STANDING)) : first + 1].all()
        what = (
            f"a push of {size:.3g} N·s moves the capture point by {1e2 * shift:.3g} cm; "
            f"the contacts that carry the robot end {1e2 * max(room, 0.0):.0f} cm away"
        )
        start, end = float(context.time[first]), float(context.time[stop - 1])
        yield Finding(Cause.PUSH, start, end, what, firm=bool(stood and shift > room))
