"""Other settings for a planner that has a past: what would it decide now, had it these from now on?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from wbmpc.planner.planner import Planner
from wbmpc.scenario import PatchPose

# What follows from the settings alone, wherever it stands: the settings themselves, the stages, and numbers made of
# settings. Everything else is the past. tests/planner/test_graft.py goes through all settings.
FROM_SETTINGS = frozenset(
    {
        *("_settings", "_pulls", "_weights", "_margin", "_slots"),
        *("_height_stage", "_need_stage", "_motion_stage", "_choice", "_force_stage"),
    }
)


def graft(planner: Planner, fresh: Planner) -> None:
    """Give `planner` the settings and the patches' friction and force cap of `fresh`; its past stays.

    Both must be of the same robot, tasks, patches, obstacles, loads and horizon. Parts of `fresh` are taken over, so
    that it must not be used any more. The stages' warm starts are among these: a first guess and not a result.
    A hand that is on an urgent way keeps that way's pace, and a foot in the air its step.
    """
    patches = {candidate.patch.name: candidate.patch for candidate in fresh._contacts.candidates.all}
    for mine, other in list(_pairs(planner, fresh, set())):
        for name in _names(mine):
            value = getattr(mine, name, None)
            if isinstance(value, PatchPose):
                setattr(mine, name, patches[value.name])
            elif name in FROM_SETTINGS:
                setattr(mine, name, getattr(other, name))


def forbid(planner: Planner, patch: str) -> None:
    """Never choose the patch of this name from now on; a hand that is on its way there, or there, is left alone."""
    planner._contacts.candidates.forbid(patch)


def _pairs(mine: Any, other: Any, seen: set[int]) -> Iterator[tuple[Any, Any]]:
    """Every part of one planner with the part that stands in the same place of another, where both have it."""
    if isinstance(mine, list | tuple) and isinstance(other, list | tuple):
        for pair in zip(mine, other, strict=False):
            yield from _pairs(*pair, seen)
        return
    ours = type(mine).__module__.startswith("wbmpc.planner") and type(mine) is type(other)
    if not ours or id(mine) in seen:
        return
    seen.add(id(mine))
    yield mine, other
    for name in _names(mine):
        yield from _pairs(getattr(mine, name, None), getattr(other, name, None), seen)


def _names(part: Any) -> list[str]:
    """Attributes of an object with or without slots."""
    return list(vars(part)) if hasattr(part, "__dict__") else list(getattr(type(part), "__slots__", ()))
