"""Who touched what, and when: one lane for each hand and foot, for stage 3 and for pushes, over the time of the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wbmpc.checks.stretches import stretches
from wbmpc.figures.panels import HANDS, STANCE_SHARE, Ink
from wbmpc.figures.trace import Trace
from wbmpc.report.plots import time_range
from wbmpc.rerun_sink.reading import Recording
from wbmpc.signals import SIDES, ContactPhase, SolveStatus

_LEAST_LABEL = 9.0  # [%] of the width: a narrower block has no room for its name
_LEAST_WIDTH = 0.15  # [%] a narrower block would not be seen
# How strongly a phase is coloured: on its way, in touch, and on its way back.
_WAY = {
    ContactPhase.NEEDED: "faint",
    ContactPhase.CHOSEN: "faint",
    ContactPhase.APPROACHING: "faint",
    ContactPhase.SENSED: "half",
    ContactPhase.LOADED: "full",
    ContactPhase.QUIET: "half",
    ContactPhase.UNLOADED: "half",
    ContactPhase.RELEASED: "faint",
}


@dataclass(frozen=True, slots=True)
class Block:
    """A stretch of time in a lane."""

    start: float  # [%]
    width: float  # [%]
    ink: str
    strength: str  # faint, quarter, half or full
    text: str  # "" where there is no room
    title: str


@dataclass(frozen=True, slots=True)
class Lane:
    """One row."""

    name: str
    blocks: Sequence[Block]


def lanes_of(recording: Recording, trace: Trace) -> list[Lane]:
    """Hands, feet, stage 3, pushes; hands that never do anything, and pushes that there were none of, are left out."""
    start, end = time_range(trace.time)
    lanes = [Lane(f"{side} hand", list(_hand(recording, i, side, (start, end)))) for i, side in enumerate(SIDES)]
    lanes += [Lane(f"{side} foot", list(_foot(trace, i))) for i, side in enumerate(SIDES)]
    fired = _states(recording, "/solver_status/stage3", end)
    lanes.append(
        Lane(
            "stage 3",
            [
                _block(
                    (a, b),
                    (start, end),
                    Ink.PLANNED,
                    "half" if word == SolveStatus.SOLVED.name else "full",
                    "",
                    word.lower(),
                )
                for a, b, word in fired
                if word != SolveStatus.NOT_RUN.name
            ],
        )
    )
    lanes.append(Lane("push", [_block(span, (start, end), Ink.FAULT, "full", "", "push") for span in trace.pushes]))
    return [lane for lane in lanes if lane.blocks]


def _hand(recording: Recording, hand: int, side: str, whole: tuple[float, float]) -> Iterator[Block]:
    for start, end, word in _states(recording, f"/contact_phase/{side}", whole[1]):
        phase, _, patch = word.partition(" ")
        name = phase.upper()
        if name in ContactPhase.__members__ and ContactPhase[name] != ContactPhase.NONE:
            yield _block((start, end), whole, HANDS[hand], _WAY[ContactPhase[name]], patch.strip("()"), word)


def _foot(trace: Trace, foot: int) -> Iterator[Block]:
    load = np.nan_to_num(trace.sole_force[:, foot])
    for first, stop in stretches(load > STANCE_SHARE * max(load.max(), 1e-9)):
        span = float(trace.time[first]), float(trace.time[stop - 1])
        yield _block(span, time_range(trace.time), HANDS[foot], "quarter", "", "stance")


def _states(recording: Recording, entity: str, end: float) -> Iterator[tuple[float, float, str]]:
    """Start, end [s] and word of each state of a lane of the recording, up to `end`."""
    times, words = recording.words(entity, "state")
    stops = [*(float(t) for t in times[1:]), end]
    for start, stop, word in zip(times, stops, words, strict=False):
        if stop > start:
            yield float(start), stop, word


def _block(
    span: tuple[float, float], whole: tuple[float, float], ink: str, strength: str, text: str, title: str
) -> Block:
    share = 100 / (whole[1] - whole[0])
    width = max(share * (span[1] - span[0]), _LEAST_WIDTH)
    return Block(
        start=round(share * (span[0] - whole[0]), 3),
        width=round(width, 3),
        ink=ink,
        strength=strength,
        text=text if width >= _LEAST_LABEL else "",
        title=f"{title}, {span[0]:.2f} to {span[1]:.2f} s",
    )
