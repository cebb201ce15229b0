"""Checks of how hard the hands push: enough to brace, not more than allowed, not at all at the end."""

from __future__ import annotations

import numpy as np

from wbmpc.checks import settings
from wbmpc.checks.blocks import lengths
from wbmpc.checks.context import TOUCH, CheckContext
from wbmpc.checks.hand_contacts import hand_contacts
from wbmpc.checks.hold import best_hold, find_hold_of_body
from wbmpc.checks.result import CheckResult, at_least, at_most, failed, first_time
from wbmpc.signals import SIDES

IMPACT_TIME = 0.2  # [s] after which a contact is no longer an impact
MEAN_TIME = 0.01  # [s] over which a contact's force is averaged: single ticks of a stiff contact mean little


class BraceForceCheck:
    """min over the hold of the hands' contact forces along their patches' normals, over the body weight."""

    def __init__(self, config: settings.BraceForce) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        window = find_hold_of_body(context, self.config)
        if isinstance(window, str):
            return failed(name, self.config.min, "1", window)
        push = context.palm_push[window].sum(axis=1) / context.body_weight  # (w,)
        when = first_time(context.time[window], ~(push >= self.config.min))
        message = f"of body weight, mean {push.mean():.3f}, from t = {context.time[window.start]:.2f} s"
        return at_least(name, float(push.min()), self.config.min, "1", message, when=when)


class BothHandsCheck:
    """max over windows of length `hold` of the smallest normal force in it of either hand, over the body weight."""

    def __init__(self, config: settings.BothHands) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        width = context.ticks(self.config.hold) + 1  # fence posts
        if context.recorder.ticks < width:
            return failed(name, self.config.min, "1", f"the run is shorter than the hold of {self.config.hold:g} s")
        push = context.palm_push.min(axis=1) / context.body_weight  # (n,)
        weakest, _, window = best_hold(-push[:, None], width)
        message = f"of body weight by each hand for {self.config.hold:g} s from t = {context.time[window.start]:.2f} s"
        return at_least(name, 0.0 - weakest, self.config.min, "1", message, when=None)


class HandImpactCheck:
    """max over ticks and palms of the magnitude of the world's force on the palm, over the body weight."""

    def __init__(self, config: settings.HandImpact) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        share = lengths(context.palm_force) / context.body_weight  # (n, 2)
        tick, side = np.unravel_index(np.argmax(share), share.shape)
        touched = share[tick, side] > 0.0
        message = f"of body weight, {SIDES[side]} palm, t = {context.time[tick]:.3f} s" if touched else "never touched"
        when = first_time(context.time, ~(share <= self.config.max).all(axis=1))
        return at_most(name, float(share[tick, side]), self.config.max, "1", message, when=when)


class HandForceCapsCheck:
    """max over the hand contacts, their first 0.2 s left out, of the mean normal force less the patch's cap [N].

    The patch is the one last chosen for the hand; contacts before any was chosen are not judged here.
    """

    def __init__(self, config: settings.HandForceCaps) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        names, code = context.patch_codes
        ticks = np.arange(context.recorder.ticks)[:, None]
        latest = np.maximum.accumulate(np.where(code >= 0, ticks, -1), axis=0)  # (n, 2) tick of the last choice
        code = np.where(latest >= 0, np.take_along_axis(code, np.maximum(latest, 0), axis=0), -1)
        caps = np.array([*(context.facts.patch_force_cap[patch] for patch in names), np.inf])
        width = context.ticks(MEAN_TIME)
        from scipy.ndimage import uniform_filter1d  # scipy: 25 MB that many runs do without

        # `origin` makes the filter's window end at the tick instead of surrounding it.
        mean = uniform_filter1d(context.push_along(code), width, axis=0, origin=(width - 1) // 2, mode="constant")
        excess = np.full(code.shape, -np.inf)
        for contact in hand_contacts(context):
            # The first mean that is judged holds no force of the impact.
            judged = slice(contact.start + context.ticks(IMPACT_TIME) + width - 1, contact.stop)
            excess[judged, contact.side] = (mean - caps[code])[judged, contact.side]
        tick, side = np.unravel_index(np.argmax(excess), excess.shape)
        if excess[tick, side] == -np.inf:
            return at_most(name, 0.0, self.config.margin, "N", "no hand contact lasted", when=None)
        message = f"{SIDES[side]} hand on {names[code[tick, side]]}, cap {caps[code[tick, side]]:g} N"
        message = f"{message}, t = {context.time[tick]:.3f} s"
        when = first_time(context.time, ~(excess <= self.config.margin).all(axis=1))
        return at_most(name, float(excess[tick, side]), self.config.margin, "N", message, when=when)


class HandsFreeAtEndCheck:
    """Time [s] since the last touch of any palm; since the beginning when there was none."""

    def __init__(self, config: settings.HandsFreeAtEnd) -> None:
        self.config = config

    def evaluate(self, context: CheckContext, name: str) -> CheckResult:
        touched = np.flatnonzero((lengths(context.palm_force) > TOUCH).any(axis=1))
        last = int(touched[-1]) if touched.size else -1
        free = (context.recorder.ticks - 1 - last) * context.facts.timestep
        message = f"last touch at t = {context.time[last]:.3f} s" if touched.size else "no palm ever touched anything"
        when = float(context.time[last]) if touched.size else None
        return at_least(name, free, self.config.duration, "s", message, when=when)
