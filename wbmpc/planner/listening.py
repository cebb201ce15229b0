"""What the stages of a plan were asked and what they answered, for those who want to explain it."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from wbmpc.planner.planner import Planner
from wbmpc.record import record


@record
class Call:
    """One call of a stage."""

    stage: str  # height, need, motion, choice, forces
    method: str
    arguments: tuple[Any, ...]  # as they were before the call
    named: Mapping[str, Any]
    answer: Any


class _Listener:
    """Stands in for a stage: passes everything on, and keeps copies of what was said."""

    def __init__(self, stage: str, inner: Any, heard: list[Call]) -> None:
        self._stage, self._inner, self._heard = stage, inner, heard

    def __getattr__(self, method: str) -> Any:
        of_stage = getattr(self._inner, method)
        if not callable(of_stage):
            return of_stage

        def listened(*arguments: Any, **named: Any) -> Any:
            before = copy.deepcopy((arguments, named))
            answer = of_stage(*arguments, **named)
            self._heard.append(Call(self._stage, method, *before, copy.deepcopy(answer)))
            return answer

        return listened


@contextmanager
def listening(planner: Planner) -> Iterator[list[Call]]:
    """Every call of the five solvers of `planner` made inside, in order; nothing about the plans changes."""
    contacts = planner._contacts
    places: tuple[tuple[Any, str, str], ...] = (
        (planner, "_height_stage", "height"),
        (planner, "_need_stage", "need"),
        (planner, "_motion_stage", "motion"),
        (contacts, "_force_stage", "forces"),
        (contacts.candidates, "_choice", "choice"),
    )
    heard: list[Call] = []
    stages = [getattr(owner, name) for owner, name, _ in places]
    for (owner, name, stage), inner in zip(places, stages, strict=True):
        if inner is not None:  # no patch, no choice
            setattr(owner, name, _Listener(stage, inner, heard))
    try:
        yield heard
    finally:
        for (owner, name, _), inner in zip(places, stages, strict=True):
            setattr(owner, name, inner)
