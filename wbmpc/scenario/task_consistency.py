"""What no single key of a task can say: times in order, tasks within the run, one task for the feet at a time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator

from wbmpc.scenario.diagnosis import Finding
from wbmpc.scenario.schema.scenario import Scenario
from wbmpc.scenario.schema.tasks import (
    ComHeightTask,
    ExcursionTask,
    FootworkTask,
    GoTask,
    LeanTask,
    LiftTask,
    Task,
    WalkTask,
)
from wbmpc.scenario.wording import KeyPath


def find_task_inconsistencies(scenario: Scenario) -> Iterator[Finding]:
    """Every contradiction within the tasks, and between them and the run's duration."""
    for index, task in enumerate(scenario.tasks):
        path: KeyPath = ("tasks", index)
        yield from _inside_one_task(path, task)
        if task.end > scenario.duration:
            yield Finding(path, f"ends at {task.end:g} s, the run already at {scenario.duration:g} s (duration)")
    heights = [index for index, task in enumerate(scenario.tasks) if isinstance(task, ComHeightTask)]
    if len(heights) > 1:
        yield Finding(("tasks", heights[1]), f"a second com_height task, first is tasks.{heights[0]}")
    yield from _footwork(scenario.tasks)
    yield from _leans(scenario.tasks)
    yield from _lifts(scenario.tasks)


def _inside_one_task(path: KeyPath, task: Task) -> Iterator[Finding]:
    if isinstance(task, ExcursionTask) and task.arrive_by <= task.start:
        message = f"must be later than start ({task.start:g} s), got {task.arrive_by:g} s"
        yield Finding((*path, "arrive_by"), message)
    elif isinstance(task, ComHeightTask):
        yield from _in_order((*path, "waypoints"), [waypoint.time for waypoint in task.waypoints], "waypoint")
    elif isinstance(task, WalkTask):
        yield from _in_order((*path, "commands"), [command.time for command in task.commands], "command")
    elif isinstance(task, GoTask) and task.longest_step < task.step_length:
        message = f"must not be less than step_length ({task.step_length:g} m), got {task.longest_step:g} m"
        yield Finding((*path, "longest_step"), message)


def _in_order(path: KeyPath, times: list[float], what: str) -> Iterator[Finding]:
    for index, (before, after) in enumerate(itertools.pairwise(times), start=1):
        if after <= before:
            message = f"must be later than the {what} before it ({before:g} s), got {after:g} s"
            yield Finding((*path, index, "time"), message)


def _leans(tasks: Iterable[Task]) -> Iterator[Finding]:
    """The CoM goes to one target at a time: a lean shares its time with no reach and no other lean."""
    busy = [(index, task) for index, task in enumerate(tasks) if isinstance(task, ExcursionTask)]
    busy.sort(key=lambda entry: entry[1].start)
    for (first, before), (index, task) in itertools.combinations(busy, 2):
        if task.start < before.end and LeanTask in (type(before), type(task)):
            message = f"begins at {task.start:g} s, but tasks.{first} ({before.kind}) lasts until {before.end:g} s"
            yield Finding(("tasks", index), message)


def _lifts(tasks: Iterable[Task]) -> Iterator[Finding]:
    """A lift takes both hands and never lets go: it comes after all that moves hands or CoM, and before any step."""
    lifts = [(index, task) for index, task in enumerate(tasks) if isinstance(task, LiftTask)]
    for index, _ in lifts[1:]:
        yield Finding(("tasks", index), f"a second lift task, first is tasks.{lifts[0][0]}")
    for (first, lift), (index, task) in itertools.product(lifts[:1], enumerate(tasks)):
        if isinstance(task, ExcursionTask) and task.end > lift.start:
            message = f"ends at {task.end:g} s, but tasks.{first} (lift) takes both hands from {lift.start:g} s on"
            yield Finding(("tasks", index), message)
        elif isinstance(task, ComHeightTask):
            yield Finding(("tasks", index), f"tasks.{first} (lift) has a CoM height of its own")
        elif isinstance(task, WalkTask):
            yield Finding(("tasks", index), f"the hands cannot carry in a walk, use go after tasks.{first} (lift)")
        elif isinstance(task, FootworkTask) and task.start < lift.start:
            message = f"begins at {task.start:g} s, but tasks.{first} (lift) is where the feet are, at {lift.start:g} s"
            yield Finding(("tasks", index), message)


def _footwork(tasks: Iterable[Task]) -> Iterator[Finding]:
    """The feet do one task at a time."""
    busy = [(index, task) for index, task in enumerate(tasks) if isinstance(task, FootworkTask)]
    busy.sort(key=lambda entry: entry[1].start)
    for (first, before), (index, task) in itertools.pairwise(busy):
        over = _over(before)
        if task.start < over:
            until = f"until {over:g} s" if math.isfinite(over) else "until the run ends"
            message = f"begins at {task.start:g} s, but tasks.{first} ({before.kind}) moves the feet {until}"
            yield Finding(("tasks", index), message)


def _over(task: FootworkTask) -> float:
    """When the feet are free again [s]; inf when they are not, or when nobody can tell."""
    if isinstance(task, GoTask) or (isinstance(task, WalkTask) and not task.commands[-1].is_halt):
        return math.inf
    return task.end
